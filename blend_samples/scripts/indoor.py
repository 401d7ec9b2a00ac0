"""`indoor`: a living room lit by sun and sky through two windows.

The room spans 0..ROOM in X, Y and Z; the windows are in the wall x = 0. A ceiling fan and
a clock's pendulum turn, a ball rolls over the floor, and the camera moves slowly in.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np
from common import (
    Material,
    Object,
    Point,
    Rng,
    Solid,
    camera,
    copy,
    diffuse,
    key,
    light_emitter,
    linear,
    link,
    noise,
    outline,
    packed_image,
    placed,
    principled,
    save,
    sky,
    start,
    sun,
    tinted,
    varnished,
)
from mathutils import Matrix, Vector

FRAMES = 72
TITLE = "Living room"
EXERCISES = (
    "light through windows, many bounces, sun, sky, a point light and emission, packed image "
    "textures for colour and roughness, Mix shader, linked meshes, bevel modifiers, turning and "
    "rolling parts, slow camera"
)
ROOM = (6.4, 5.0, 2.75)
WINDOWS = ((0.95, 2.15), (2.95, 4.15))  # spans in y
SILL, LINTEL = 0.45, 2.35


# ---------------------------------------------------------------- images


def planks(rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Colour and roughness of a wood floor, 1.5 m a side; the planks run along v."""
    size, across = 384, 10
    v, u = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    plank = u * across // size
    end = ((v + (plank * 151) % size) % size) * 2 // size
    tone = rng.random((across, 2))[plank, end]
    grain = noise((size, size), 4, rng, 2)[(v // 3) % size, (u * 9 + plank * 37) % size]
    amount = 0.15 + 0.45 * tone + 0.4 * grain
    colour = tinted("#83582f", "#cb9a66", amount)
    beside = (u * across) % size
    joint = (beside < 10) | (((v + (plank * 151) % size) % (size // 2)) < 2)
    colour[joint] *= 0.45
    rough = 0.28 + 0.22 * grain + 0.25 * joint
    return np.round(colour * 40) / 40, np.round(np.repeat(rough[..., None], 3, 2) * 32) / 32


def rug_pattern(rng: Rng) -> np.ndarray:
    """A woven rug, 3:2: borders and diamonds in a few yarns."""
    height, width = 256, 384
    y, x = np.meshgrid(
        (np.arange(height) + 0.5) / 256, (np.arange(width) + 0.5) / 256, indexing="ij"
    )
    edge = np.minimum(np.minimum(x, 1.5 - x), np.minimum(y, 1 - y))
    diamond = np.abs((x * 4) % 1 - 0.5) + np.abs((y * 4) % 1 - 0.5)
    yarn = np.full((height, width), 0)
    yarn[diamond < 0.36] = 1
    yarn[diamond < 0.18] = 2
    yarn[edge < 0.13] = 3
    yarn[(edge < 0.1) & ((x * 16).astype(int) + (y * 16).astype(int)) % 2 == 1] = 2
    yarn[edge < 0.05] = 1
    codes = ("#8c3b2e", "#d8c49a", "#2f4a5c", "#5a2a26")
    palette = np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in codes])
    weave = 0.86 + 0.14 * rng.integers(0, 3, (height, width))[..., None] / 2
    return palette[yarn] * weave


def landscape(rng: Rng, low: str, high: str, land: str) -> np.ndarray:
    """A small painting: a sky and three ridges."""
    height, width = 160, 128
    y = np.linspace(0, 1, height)[:, None] * np.ones((1, width))
    picture = tinted(low, high, y)
    for i, level in enumerate((0.55, 0.4, 0.22)):
        ridge = level + 0.25 * (noise((width, 8), 3, rng, 3)[:, 0] - 0.5)
        below = y < ridge[None, :]
        picture[below] = tinted(land, high, np.array([0.55 - 0.27 * i]))[0]
    return np.round(picture * 40) / 40


# ---------------------------------------------------------------- room


def shell(rng: Rng) -> None:
    plaster, accent = diffuse("Plaster", "#f0ece3"), diffuse("Sage Wall", "#a9b8a8")
    white = principled("White Lacquer", "#eeece6", 0.3)
    x, y, z = ROOM
    walls = Solid("Walls")
    walls.box((0.2, y + 0.4, z), (x + 0.1, y / 2, z / 2), plaster)
    walls.box((x, 0.2, z), (x / 2, -0.1, z / 2), plaster)
    walls.box((x, 0.2, z), (x / 2, y + 0.1, z / 2), accent)
    walls.box((x + 0.4, y + 0.4, 0.2), (x / 2, y / 2, z + 0.1), plaster)
    edges = [-0.2, *(e for span in WINDOWS for e in span), y + 0.2]
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        walls.box((0.25, high - low, z), (-0.125, (low + high) / 2, z / 2), plaster)
    for low, high in WINDOWS:
        middle = (low + high) / 2
        walls.box((0.25, high - low, SILL), (-0.125, middle, SILL / 2), plaster)
        walls.box((0.25, high - low, z - LINTEL), (-0.125, middle, (z + LINTEL) / 2), plaster)
        window(white, low, high)
    walls.to_object(smooth=False)
    colour, rough = planks(rng)
    floor = Solid("Floor")
    grain = packed_image("FloorColour", colour)
    gloss = packed_image("FloorRoughness", rough, colour=False)
    wood = principled("Oak Floor", "#96673c", specular=0.45, image=grain, rough_image=gloss)
    floor.box((x + 0.4, y + 0.4, 0.1), (x / 2, y / 2, -0.05), wood)
    floor.to_object(smooth=False, uv_metres=1.5)
    trim = Solid("Skirting")
    trim.box((x, 0.018, 0.1), (x / 2, y - 0.009, 0.05), white)
    trim.box((0.018, y, 0.1), (0.009, y / 2, 0.05), white)
    trim.box((x, 0.05, 0.06), (x / 2, y - 0.025, z - 0.03), white)
    trim.box((0.05, y, 0.06), (0.025, y / 2, z - 0.03), white)
    trim.to_object(bevel=0.008, segments=1)


def window(white: Material, low: float, high: float) -> None:
    """Frame, two sashes with a bar each, and the sill."""
    frame = Solid("Window")
    width, height = high - low, LINTEL - SILL
    middle, centre = (low + high) / 2, (SILL + LINTEL) / 2
    for y in (low + 0.03, middle, high - 0.03):
        frame.box((0.07, 0.07, height), (-0.15, y, centre), white)
    for z in (SILL + 0.03, centre + 0.3, LINTEL - 0.03):
        frame.box((0.06, width, 0.05), (-0.15, middle, z), white)
    frame.box((0.34, width + 0.12, 0.035), (0.04, middle, SILL + 0.0175), white)
    for side in (-0.05, 0.05):
        frame.box(
            (0.05, 0.02, 0.1),
            (-0.1, middle + side, centre),
            principled("Brass", "#b08d4a", 0.3, metallic=1.0),
        )
    frame.to_object(bevel=0.008, segments=1)


def curtains() -> None:
    cloth, rod = diffuse("Linen", "#d9cdb6"), principled("Bronze", "#4a3a2a", 0.35, metallic=1.0)
    for low, high in WINDOWS:
        bar = Solid("CurtainRod")
        bar.cylinder(0.014, (0.11, low - 0.38, 2.5), (0.11, high + 0.38, 2.5), rod, 10)
        for y in (low - 0.38, high + 0.38):
            knob = outline("0.005 -0.03, 0.026 -0.015, 0.026 0.015, 0.005 0.03")
            bar.lathe(knob, rod, placed((0.11, y, 2.5), (math.pi / 2, 0, 0)), 12)
        for y in (low - 0.28, high + 0.28):
            bar.box((0.12, 0.02, 0.03), (0.055, y, 2.5), rod)
        bar.to_object()
        for first, last in ((low - 0.34, low + 0.12), (high - 0.12, high + 0.34)):
            curtain(cloth, first, last)


def curtain(cloth: Material, first: float, last: float) -> None:
    """A panel with folds that grow wider towards the floor."""

    def surface(u: float, v: float) -> tuple[float, float, float]:
        fold = 2 * math.pi * 6 * u
        depth = 0.02 + 0.035 * v
        sway = 0.02 * v * math.sin(5 * u + 3 * v)
        return (
            0.11 + depth * math.sin(fold + 0.8 * v),
            first + (last - first) * u + sway,
            2.49 - 2.46 * v,
        )

    panel = Solid("Curtain")
    panel.sheet(surface, 42, 4, cloth)
    panel.to_object(closed=False)


# ---------------------------------------------------------------- furniture


def sofa(at: Vector) -> None:
    cloth = diffuse("Sofa Cloth", "#c9beab")
    wood = varnished("Walnut", "#4d3220", 0.25, 0.07)
    body = Solid("SofaBody")
    body.box((2.2, 0.86, 0.2), (0, 0, 0.24), cloth)
    body.box((2.2, 0.2, 0.5), (0, 0.36, 0.55), cloth, (-0.12, 0, 0))
    for side in (-1, 1):
        body.box((0.2, 0.88, 0.46), (side * 1.12, 0, 0.37), cloth)
    body.to_object(at=at, bevel=0.05)
    for i in (-1, 0, 1):
        seat, back = Solid("SeatCushion"), Solid("BackCushion")
        seat.box((0.67, 0.66, 0.17), (0, 0, 0), cloth)
        seat.to_object(at=at + Vector((0.678 * i, -0.08, 0.42)), bevel=0.06, segments=3)
        back.box((0.66, 0.19, 0.46), (0, 0, 0), cloth, (-0.2, 0, 0.02 * i))
        back.to_object(at=at + Vector((0.678 * i, 0.2, 0.69)), bevel=0.07, segments=3)
    legs = Solid("SofaLegs")
    for x in (-1.08, 1.08):
        for y in (-0.36, 0.36):
            legs.cylinder(0.018, (x, y, 0), (x * 0.98, y * 0.96, 0.16), wood, 10, 0.028)
    legs.to_object(at=at)
    for x, z, turn, code in (
        (-0.8, 0.7, 0.3, "#c58a2c"),
        (-0.5, 0.68, -0.1, "#2f6168"),
        (0.82, 0.69, -0.35, "#c58a2c"),
    ):
        cushion = pillow(code)
        cushion.location = at + Vector((x, -0.02, z))
        cushion.rotation_euler = (-0.35, turn * 0.4, turn)


def pillow(code: str) -> Object:
    """A stuffed square: thick in the middle, thin at the seams, upright along X and Z."""
    cloth = diffuse(f"Pillow {code}", code)

    def side(sign: float) -> Callable[[float, float], Point]:
        def surface(u: float, v: float) -> tuple[float, float, float]:
            x, z = 2 * u - 1, 2 * v - 1
            thick = max((1 - x**4) * (1 - z**4), 0.0) ** 0.6
            pinch = 1 - 0.08 * (1 - x * x * z * z)
            return 0.21 * x * pinch, sign * (0.085 * thick + 0.003), 0.21 * z * pinch

        return surface

    solid = Solid("Pillow")
    for sign in (-1, 1):
        solid.sheet(side(sign), 8, 8, cloth)
    return solid.to_object()


def coffee_table(at: Vector) -> None:
    wood = varnished("Table Oak", "#8a5a33", 0.2, 0.08)
    iron = principled("Black Iron", "#1d1d1e", 0.4, metallic=0.6)
    top = Solid("CoffeeTable")
    top.box((1.1, 0.6, 0.035), (0, 0, 0.41), wood)
    top.box((1.0, 0.5, 0.02), (0, 0, 0.16), wood)
    top.to_object(at=at, bevel=0.01)
    legs = Solid("CoffeeTableLegs")
    for x in (-0.5, 0.5):
        for y in (-0.25, 0.25):
            legs.box((0.025, 0.025, 0.395), (x, y, 0.1975), iron)
    legs.to_object(at=at, bevel=0.003, segments=1)
    bowl = Solid("Bowl")
    glaze = principled("Blue Glaze", "#3c6f8f", 0.12)
    outside = "0.001 0, 0.06 0, 0.07 0.012, 0.12 0.045, 0.15 0.085"
    inside = "0.143 0.085, 0.11 0.05, 0.06 0.022, 0.001 0.018"
    bowl.lathe(outline(f"{outside}, {inside}"), glaze, None, 24)
    for i, (x, y) in enumerate(((0.045, 0.01), (-0.04, 0.035), (-0.01, -0.05))):
        fruit = principled(
            ("Orange", "Lemon", "Apple")[i], ("#d9791e", "#d9b92e", "#9c2f22")[i], 0.4
        )
        profile = [(0.045 * math.sin(a), -0.043 * math.cos(a)) for a in np.linspace(0.05, 3.09, 7)]
        bowl.lathe(profile, fruit, placed((x, y, 0.066)), 10)
    bowl.to_object(at=at + Vector((0.2, 0.05, 0.4275)))


def magazines(books: list[Object], at: Vector) -> None:
    for i, turn in enumerate((0.15, 0.32, -0.1)):
        book = copy(books[i], at + Vector((0, 0, 0.034 * i)), (0, 0, turn))
        book.rotation_euler = (0, math.pi / 2, turn + 1.6)
        book.location = at + Vector((0, 0, 0.036 * i + 0.018))


def book_kinds() -> list[Object]:
    """Books standing up, origin at the middle of the foot of the spine's side."""
    paper = diffuse("Paper", "#e6dcc4")
    codes = ("#7d2e2a", "#2f4a63", "#c9a24a", "#41583d", "#6b5a4c", "#d6cfc0", "#1f2a33", "#a8532f")
    kinds = []
    for i, code in enumerate(codes):
        cover = principled(f"Cover {code}", code, 0.45 + 0.05 * (i % 4))
        book = Solid("Book")
        thick, deep, high = 0.036, 0.17, 0.24
        x, y = thick / 2, deep / 2
        around = [
            (-x, y),
            (-x, -y),
            (x, -y),
            (x, y),
            (x - 0.004, y),
            (x - 0.004, 0.004 - y),
            (0.004 - x, 0.004 - y),
            (0.004 - x, y),
        ]
        book.prism(
            around,
            (0, high),
            cover,
            Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, 1, 0, 0), (0, 0, 0, 1))),
        )
        book.box((thick - 0.004, deep - 0.012, high - 0.012), (0, -0.002, high / 2), paper)
        kinds.append(book.to_object(smooth=False))
    return kinds


def shelves(books: list[Object], at: Vector, rng: Rng) -> None:
    """A case of five boards with books, a vase and a few boxes on it."""
    wood = varnished("Shelf Oak", "#94683f", 0.3, 0.06)
    width, depth, height, levels = 1.3, 0.3, 2.0, 5
    case = Solid("Shelves")
    for x in (-width / 2, 0, width / 2):
        case.box((0.025, depth, height), (x, 0, height / 2), wood)
    for i in range(levels + 1):
        case.box((width, depth - 0.004, 0.025), (0, 0, 0.08 + (height - 0.0925) * i / levels), wood)
    case.box((width, 0.01, height), (0, depth / 2 - 0.005, height / 2), wood)
    case.to_object(at=at, bevel=0.004, segments=1)
    for level in range(levels):
        z = 0.0925 + (height - 0.0925) * level / levels
        for bay in (0, 1):
            first = -width / 2 + bay * width / 2 + 0.035
            fill_shelf(books, at + Vector((first, -0.02, z)), width / 2 - 0.07, rng)


def fill_shelf(books: list[Object], at: Vector, room: float, rng: Rng) -> None:
    """Books from the left for a random part of the board; the last one leans."""
    x, until = 0.02, room * rng.uniform(0.4, 0.85)
    while x < until:
        scale = (rng.uniform(0.85, 1.7), rng.uniform(0.85, 1.05), rng.uniform(0.8, 1.2))
        copy(books[rng.integers(len(books))], at + Vector((x + 0.02 * scale[0], 0, 0)), scale=scale)
        x += 0.043 * scale[0]
    if room - x > 0.14:
        lean = 0.28
        copy(
            books[rng.integers(len(books))],
            at + Vector((x + 0.024 + 0.24 * math.sin(lean), 0, 0.006)),
            (0, -lean, 0),
        )


def floor_lamp(at: Vector) -> None:
    brass = principled("Lamp Brass", "#b08d4a", 0.25, metallic=1.0)
    shade = principled("Lamp Shade", "#f3e2bf", 0.9, emission=0.5)
    lamp = Solid("FloorLamp")
    foot = "0.001 0, 0.15 0, 0.15 0.015, 0.02 0.035, 0.012 0.06, 0.012 1.42, 0.001 1.42"
    lamp.lathe(outline(foot), brass, None, 20)
    lamp.lathe(
        [(0.13, 1.62), (0.2, 1.3), (0.197, 1.3), (0.127, 1.62), (0.13, 1.62)], shade, None, 24
    )
    for turn in (0, 2.1, 4.2):
        c, s = math.cos(turn), math.sin(turn)
        lamp.tube([(0, 0, 1.41), (0.14 * c, 0.14 * s, 1.56)], 0.004, brass, 6)
    bulb = [(0.03 * math.sin(a), 1.47 - 0.03 * math.cos(a)) for a in np.linspace(0.05, 3.09, 8)]
    lamp.lathe(bulb, light_emitter("Bulb", "#ffdca8", 12.0), None, 12)
    lamp.to_object(at=at)
    data = bpy.data.lights.new("FloorLampLight", "POINT")
    data.energy, data.shadow_soft_size, data.color = 14, 0.05, linear("#ffd9a0")
    link(bpy.data.objects.new("FloorLampLight", data)).location = at + Vector((0, 0, 1.56))


def plant(at: Vector, rng: Rng) -> None:
    clay, soil = principled("Terracotta", "#a35a38", 0.8), diffuse("Soil", "#2c2118")
    leaf, stem = principled("Leaf", "#3f6b2f", 0.4), diffuse("Stem", "#5b6b3a")
    pot = Solid("Pot")
    rim = "0.195 0.3, 0.195 0.35, 0.17 0.35, 0.165 0.31, 0.001 0.31"
    pot.lathe(outline(f"0.001 0, 0.13 0, 0.18 0.3, {rim}"), clay, None, 20)
    pot.lathe([(0.16, 0.312), (0.16, 0.322), (0.001, 0.325)], soil, None, 20)
    pot.to_object(at=at)
    green = Solid("Leaves")
    for i in range(19):
        turn = 2.4 * i
        out, top = rng.uniform(0.12, 0.42), rng.uniform(0.75, 1.55)
        path = [
            (out * t**1.6 * math.cos(turn), out * t**1.6 * math.sin(turn), 0.32 + (top - 0.32) * t)
            for t in (0, 0.35, 0.7, 1.0)
        ]
        green.tube(path, 0.006, stem, 4)
        blade(green, leaf, Vector(path[-1]), turn, rng.uniform(0.24, 0.36), rng.uniform(0.1, 0.7))
    green.to_object(at=at, closed=False)


def blade(
    solid: Solid, leaf: Material, at: Vector, turn: float, length: float, droop: float
) -> None:
    """One leaf: folded along its rib, bending down towards its tip."""

    def surface(u: float, v: float) -> tuple[float, float, float]:
        wide = 0.36 * length * math.sin(math.pi * min(u + 0.02, 1.0)) ** 0.8 * (1.1 - 0.5 * u)
        side = (2 * v - 1) * wide
        return length * u, side, 0.25 * abs(side) + length * (0.3 * u - droop * u * u)

    solid.sheet(surface, 6, 2, leaf, placed(at, (0, 0, turn)))


def chair_mesh(wood: Material, cloth: Material) -> Object:
    """A dining chair facing +X."""
    chair = Solid("Chair")
    for x, y in ((-0.19, -0.19), (-0.19, 0.19), (0.19, -0.19), (0.19, 0.19)):
        chair.cylinder(0.012, (x * 1.12, y * 1.12, 0), (x, y, 0.44), wood, 10, 0.019)
    for y in (-0.19, 0.19):
        chair.tube([(-0.19, y, 0.42), (-0.21, y, 0.6), (-0.26, y * 0.97, 0.88)], 0.016, wood, 8)
    chair.box((0.44, 0.44, 0.025), (0, 0, 0.445), wood)
    chair.box((0.42, 0.42, 0.045), (0, 0, 0.478), cloth)
    for z, x in ((0.86, -0.256), (0.74, -0.234), (0.64, -0.216)):
        arc = [(x - 0.04 * math.cos(t), 0.2 * t / 1.2, z) for t in np.linspace(-1.15, 1.15, 7)]
        chair.tube([(p[0] + 0.016, p[1], p[2]) for p in arc], 0.017, wood, 7)
    return chair.to_object()


def dining(at: Vector) -> None:
    wood, cloth = varnished("Chair Beech", "#9a6a3e", 0.25, 0.06), diffuse("Chair Cloth", "#37545a")
    table = Solid("RoundTable")
    table.lathe(
        [(0.001, 0.715), (0.44, 0.715), (0.46, 0.725), (0.46, 0.74), (0.45, 0.75), (0.001, 0.75)],
        wood,
        None,
        36,
    )
    table.lathe(
        [
            (0.001, 0),
            (0.25, 0),
            (0.25, 0.02),
            (0.06, 0.06),
            (0.04, 0.2),
            (0.04, 0.66),
            (0.12, 0.716),
        ],
        wood,
        None,
        18,
    )
    table.to_object(at=at)
    chair = chair_mesh(wood, cloth)
    for turn in (0.35, 1.75, 3.75):
        copy(chair, at + Vector((-0.62 * math.cos(turn), -0.62 * math.sin(turn), 0)), (0, 0, turn))
    bpy.data.objects.remove(chair)
    vase = Solid("Vase")
    outside = "0.001 0, 0.045 0, 0.07 0.05, 0.075 0.1, 0.03 0.19, 0.035 0.22"
    glaze = principled("White Glaze", "#e4e0d6", 0.15)
    vase.lathe(outline(f"{outside}, 0.028 0.22, 0.024 0.19, 0.001 0.15"), glaze, None, 20)
    stalk, bloom = diffuse("Stalk", "#55703d"), diffuse("Bloom", "#c8505a")
    for i in range(5):
        a, out = 1.26 * i, 0.03 + 0.018 * i
        tip = Vector((out * math.cos(a), out * math.sin(a), 0.4 - 0.012 * i))
        vase.tube([(0, 0, 0.17), tip * 0.7 + Vector((0, 0, 0.06)), tip], 0.003, stalk, 5)
        ball = [
            (0.028 * math.sin(t) * (1 + 0.2 * math.cos(5 * t)), -0.024 * math.cos(t))
            for t in np.linspace(0.1, 3.0, 5)
        ]
        vase.lathe(ball, bloom, placed(tip), 8)
    vase.to_object(at=at + Vector((0.05, 0.1, 0.75)))


def pictures(rng: Rng) -> None:
    frame_paint, mat = principled("Frame", "#2a211b", 0.35), diffuse("Passepartout", "#efeadf")
    motifs = (
        ("#e8c9a0", "#7fa3b8", "#3a4a4f"),
        ("#f0d9b0", "#c46f4a", "#4a2d33"),
        ("#dfe6df", "#6f93a0", "#2f4a3a"),
    )
    for i, (x, z, w, h) in enumerate(
        ((1.25, 1.72, 0.46, 0.58), (2.1, 1.78, 0.62, 0.78), (2.95, 1.72, 0.46, 0.58))
    ):
        frame = Solid("PictureFrame")
        for side in (-1, 1):
            frame.box((0.03, 0.03, h), (side * (w / 2 - 0.015), 0, 0), frame_paint)
            frame.box((w - 0.06, 0.03, 0.03), (0, 0, side * (h / 2 - 0.015)), frame_paint)
        frame.box((w - 0.05, 0.008, h - 0.05), (0, 0.008, 0), mat)
        frame.to_object(at=(x, ROOM[1] - 0.016, z), bevel=0.004, segments=1)
        image = packed_image(f"Painting{i}", landscape(rng, *motifs[i]))
        textured_quad(f"Painting{i}", image, (x, ROOM[1] - 0.016 + 0.002, z), w - 0.18, h - 0.2)


def textured_quad(
    name: str, image: bpy.types.Image | None, at: Point, width: float, height: float
) -> None:
    """An upright picture facing -Y with its whole image on it."""
    quad = Solid(name)
    corners = [
        (-width / 2, 0, -height / 2),
        (width / 2, 0, -height / 2),
        (width / 2, 0, height / 2),
        (-width / 2, 0, height / 2),
    ]
    quad.add(corners, [range(4)], principled(name, "#808080", 0.5, specular=0.3, image=image))
    obj = quad.to_object(at=at, closed=False, smooth=False)
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])


def rug(at: Vector, rng: Rng) -> None:
    wool = principled(
        "Rug", "#8c3b2e", 0.95, specular=0.1, image=packed_image("RugColour", rug_pattern(rng))
    )
    solid = Solid("Rug")
    x, y = 1.35, 0.9
    solid.add([(-x, -y, 0.012), (x, -y, 0.012), (x, y, 0.012), (-x, y, 0.012)], [range(4)], wool)
    top = solid.to_object(at=at, closed=False, smooth=False)
    top.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    hem = Solid("RugHem")
    hem.box((2 * x, 2 * y, 0.0115), (0, 0, 0.00575), diffuse("Rug Hem", "#5a2a26"))
    fringe = diffuse("Fringe", "#d8c49a")
    for i in range(30):
        for side in (-1, 1):
            hem.box(
                (0.06, 0.022, 0.006),
                (side * (x + 0.028), -y + 0.03 + 0.06 * i, 0.004),
                fringe,
                (0, 0, 0.1 * math.sin(i * 7)),
            )
    hem.to_object(at=at, smooth=False)


# ---------------------------------------------------------------- moving things


def ceiling_fan(at: Vector) -> None:
    brass, wood = (
        principled("Fan Brass", "#9c7b3f", 0.3, metallic=1.0),
        varnished("Fan Blade", "#5a3b25", 0.25, 0.06),
    )
    mount = Solid("FanMount")
    mount.cylinder(0.07, at, at - Vector((0, 0, 0.04)), brass, 24)
    mount.cylinder(0.012, at, at - Vector((0, 0, 0.3)), brass, 12)
    mount.to_object()
    fan = Solid("Fan")
    fan.lathe(
        [(0.02, 0.05), (0.09, 0.03), (0.1, -0.03), (0.06, -0.07), (0.001, -0.075)], brass, None, 28
    )
    for i in range(4):
        turn = Matrix.Rotation(math.pi / 2 * i, 4, "Z")
        plan = outline("0.16 -0.055, 0.62 -0.075, 0.66 -0.05, 0.66 0.05, 0.62 0.075, 0.16 0.055")
        flat = Matrix.Rotation(math.radians(90 + 11), 4, "X")
        fan.prism(plan, (-0.004, 0.004), wood, turn @ flat)
        fan.box((0.14, 0.03, 0.008), turn @ Vector((0.13, 0, 0)), brass, (0, 0, math.pi / 2 * i))
    obj = fan.to_object(at=at - Vector((0, 0, 0.32)))
    for frame, turn in ((1, 0.0), (FRAMES + 1, 2 * math.pi * 1.5)):
        key(obj, frame, rotation_euler=(0, 0, turn))


def pendulum_clock(at: Vector) -> None:
    wood, brass = (
        varnished("Clock Walnut", "#4d3220", 0.2, 0.08),
        principled("Clock Brass", "#c09a4a", 0.2, metallic=1.0),
    )
    face, ink = diffuse("Clock Face", "#efe8d6"), diffuse("Ink", "#1c1a18")
    case = Solid("Clock")
    case.box((0.3, 0.02, 0.78), (0, 0.06, 0), wood)
    for side in (-1, 1):
        case.box((0.02, 0.12, 0.78), (side * 0.14, 0.01, 0), wood)
        case.box((0.34, 0.15, 0.03), (0, 0, side * 0.4), wood)
    case.cylinder(0.118, (0, 0.05, 0.22), (0, 0.0, 0.22), brass, 24)
    case.cylinder(0.105, (0, 0.01, 0.22), (0, -0.004, 0.22), face, 24)
    for hour in range(12):
        a = math.pi / 6 * hour
        case.box(
            (0.006, 0.002, 0.02),
            (0.088 * math.sin(a), -0.005, 0.22 + 0.088 * math.cos(a)),
            ink,
            (0, a, 0),
        )
    for length, a in ((0.055, 5.3), (0.08, 1.05)):
        middle = (0.5 * length * math.sin(a), -0.008, 0.22 + 0.5 * length * math.cos(a))
        case.box((0.008, 0.002, length), middle, ink, (0, a, 0))
    case.to_object(at=at)
    bob = Solid("Pendulum")
    bob.cylinder(0.004, (0, 0, 0), (0, 0, -0.36), brass, 8)
    disk = outline("0.001 -0.008, 0.04 -0.006, 0.05 0, 0.04 0.006, 0.001 0.008")
    bob.lathe(disk, brass, placed((0, 0, -0.38), (math.pi / 2, 0, 0)), 20)
    swinging = bob.to_object(at=at + Vector((0, 0.025, 0.12)))
    for frame in range(1, FRAMES + 1):
        key(swinging, frame, rotation_euler=(0, 0.16 * math.sin(2 * math.pi * (frame - 1) / 36), 0))


def rolling_ball(begin: Vector, end: Vector) -> None:
    """A striped ball that rolls without slip and slows down."""
    radius = 0.09
    paints = principled("Ball Red", "#b8322a", 0.3), principled("Ball White", "#e9e3d5", 0.3)
    ball = Solid("Ball")
    for i, band in enumerate(np.linspace(0, math.pi, 7)[:-1]):
        profile = [
            (radius * math.sin(a), -radius * math.cos(a))
            for a in np.linspace(band, band + math.pi / 6, 4)
        ]
        profile[0 if i == 0 else -1] = (
            max(profile[0 if i == 0 else -1][0], 1e-4),
            profile[0 if i == 0 else -1][1],
        )
        ball.lathe(profile, paints[i % 2], placed((0, 0, 0), (0.5, 0.9, 0)), 16)
    obj = ball.to_object()
    path = end - begin
    axis = Vector((0, 0, 1)).cross(path.normalized())
    obj.rotation_mode = "QUATERNION"
    for frame in range(1, FRAMES + 1):
        u = (frame - 1) / (FRAMES - 1)
        done = 1 - (1 - u) ** 2
        turn = Matrix.Rotation(done * path.length / radius, 4, axis).to_quaternion()
        key(
            obj,
            frame,
            location=begin + done * path + Vector((0, 0, radius)),
            rotation_quaternion=turn,
        )


# ---------------------------------------------------------------- outside


def garden(rng: Rng) -> None:
    lawn = Solid("Lawn")
    lawn.add(
        [(-60, -40, -0.35), (-0.3, -40, -0.35), (-0.3, 45, -0.35), (-60, 45, -0.35)],
        [range(4)],
        diffuse("Lawn", "#667048"),
    )
    lawn.to_object(closed=False, smooth=False)
    bush = Solid("Bush")
    bush.rock(1.0, diffuse("Bush", "#4c5634"), rng, 2)
    source = bush.to_object()
    for i in range(9):
        size = rng.uniform(1.0, 1.9)
        copy(
            source,
            (-9 - rng.uniform(0, 5), -8 + 2.6 * i, -0.4 + 0.6 * size),
            (0, 0, 2.4 * i),
            (size, size, 0.9 * size),
        )
    bpy.data.objects.remove(source)


def make() -> None:
    """Build the scene and save it with its card."""
    rng = np.random.default_rng(19)
    scene = start(FRAMES)
    shell(rng)
    curtains()
    sofa(Vector((2.1, 4.42, 0)))
    rug(Vector((2.15, 3.0, 0)), rng)
    coffee_table(Vector((2.15, 3.1, 0.0125)))
    books = book_kinds()
    magazines(books, Vector((1.85, 3.05, 0.44)))
    shelves(books, Vector((4.45, 4.845, 0)), rng)
    for book in books:
        bpy.data.objects.remove(book)
    floor_lamp(Vector((0.62, 4.5, 0)))
    plant(Vector((0.5, 2.55, 0)), rng)
    dining(Vector((1.35, 1.3, 0)))
    pictures(rng)
    ceiling_fan(Vector((2.6, 2.7, ROOM[2])))
    pendulum_clock(Vector((3.5, 4.93, 1.75)))
    rolling_ball(Vector((5.1, 3.5, 0)), Vector((3.75, 3.0, 0)))
    garden(rng)
    towards = sun(30, 168, 8.0)
    sky(towards, 4.5, 0.45, "#6f9fd8", "#dfe8ee", "#6a7a50", seed=8)
    camera(
        [
            (1, (5.75, 0.55, 1.42), (2.0, 3.6, 1.08)),
            (FRAMES, (5.2, 0.75, 1.36), (1.95, 3.65, 1.05)),
        ],
        22,
        (0.05, 200),
    )
    scene.view_settings.exposure = 1.25
    save("indoor", TITLE, EXERCISES, "interior")


if __name__ == "__main__":
    make()
