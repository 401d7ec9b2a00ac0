"""`stadium`: a bowl of woven steel trusses, after the Beijing National Stadium.

The steel lies on one surface, addressed by (theta, w): theta is the parametric angle of the
plan's ellipses; w runs from 0 at the ground over 1 at the eaves to 2 at the roof's opening.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np
from common import (
    Material,
    Object,
    Rng,
    Solid,
    camera,
    copy,
    diffuse,
    light_emitter,
    noise,
    packed_image,
    principled,
    save,
    sky,
    start,
    sun,
    tinted,
)
from mathutils import Vector

FRAMES = 72
TITLE = "Stadium"
EXERCISES = (
    "many thin beams in a few large meshes, fine occlusion, a large outdoor scale, sun and sky, "
    "emission, a packed image texture, metal, linked trees, camera on a curved flight"
)
EAVES, OPENING, FOOT = (166.0, 147.0), (93.0, 64.0), 0.87
PRIMARY = 24
TRUSS_DEPTH = 9.0
# Section of the bowl: w, way from the foot to the eaves (up to w = 1), fraction of the height.
SECTION = np.array(
    [
        (0, 0.0, 0.0),
        (0.5, 0.62, 0.47),
        (0.8, 0.9, 0.76),
        (0.93, 0.985, 0.9),
        (1.0, 1.0, 0.955),
        (1.08, 0.985, 0.992),
        (1.25, 0.985, 1.01),
        (2.0, 0.985, 0.965),
    ]
)


# ---------------------------------------------------------------- the surface


def rim_height(theta: float) -> float:
    """The saddle: highest at the ends of the short axis."""
    return 53.0 - 12.0 * math.cos(2 * theta)


def ellipse(w: float) -> tuple[float, float]:
    """Half axes of the plan curve at w."""
    if w <= 1:
        out = FOOT + (1 - FOOT) * float(np.interp(w, SECTION[:, 0], SECTION[:, 1]))
        return EAVES[0] * out, EAVES[1] * out
    t = w - 1
    return EAVES[0] + (OPENING[0] - EAVES[0]) * t, EAVES[1] + (OPENING[1] - EAVES[1]) * t


def surface(theta: float, w: float, depth: float = 0.0) -> Vector:
    """A point of the surface, or `depth` metres under it."""
    a, b = ellipse(w)
    z = rim_height(theta) * float(np.interp(w, SECTION[:, 0], SECTION[:, 2]))
    point = Vector((a * math.cos(theta), b * math.sin(theta), z))
    return point - normal(theta, w) * depth if depth else point


def normal(theta: float, w: float) -> Vector:
    """Outward normal of the section, turned smoothly from the wall to the roof."""
    lean = math.radians(float(np.interp(w, (0, 0.7, 1.15, 2), (-14, -8, 88, 90))))
    outward = Vector((math.cos(theta) / EAVES[0], math.sin(theta) / EAVES[1], 0)).normalized()
    return outward * math.cos(lean) + Vector((0, 0, math.sin(lean)))


def address(x: float, y: float) -> tuple[float, float]:
    """(theta, w) of a plan point on the roof, by bisection over its confocal-like ellipses."""
    low, high = 1.0, 2.0
    for _ in range(30):
        w = (low + high) / 2
        a, b = ellipse(w)
        low, high = (w, high) if (x / a) ** 2 + (y / b) ** 2 < 1 else (low, w)
    a, b = ellipse(low)
    return math.atan2(y / b, x / a), low


Address = tuple[float, float]


def roof_line(theta: float, sign: int) -> list[Address]:
    """From the opening's tangent point outward to the eaves, straight in plan."""
    origin = Vector((OPENING[0] * math.cos(theta), OPENING[1] * math.sin(theta)))
    along = (
        sign * Vector((-OPENING[0] * math.sin(theta), OPENING[1] * math.cos(theta))).normalized()
    )
    a = (along.x / EAVES[0]) ** 2 + (along.y / EAVES[1]) ** 2
    b = origin.x * along.x / EAVES[0] ** 2 + origin.y * along.y / EAVES[1] ** 2
    c = (origin.x / EAVES[0]) ** 2 + (origin.y / EAVES[1]) ** 2 - 1
    reach = (-b + math.sqrt(b * b - a * c)) / a
    return [address(*(origin + along * reach * i / 9)) for i in range(10)]


def wall_line(start_theta: float, drift: float, steps: int = 7) -> list[Address]:
    """From the eaves down to the ground, drifting around the bowl."""
    return [(start_theta + drift * i / steps, 1 - i / steps) for i in range(1, steps + 1)]


# ---------------------------------------------------------------- steel


def beam(
    solid: Solid,
    path: Sequence[Vector],
    ups: Sequence[Vector],
    width: float,
    height: float,
    steel: Material,
) -> None:
    """A box section swept along a path; `ups` are the directions of its height."""
    ring, rows = [], len(path)
    for i, (p, up) in enumerate(zip(path, ups, strict=True)):
        tangent = (path[min(i + 1, rows - 1)] - path[max(i - 1, 0)]).normalized()
        side = tangent.cross(up).normalized() * (width / 2)
        high = side.cross(tangent).normalized() * (height / 2)
        ring += [p - side - high, p + side - high, p + side + high, p - side + high]
    last = 4 * (rows - 1)
    faces: list[Sequence[int]] = [(0, 1, 2, 3), (last + 3, last + 2, last + 1, last)]
    for i in range(0, last, 4):
        faces += [(i + j, i + (j + 1) % 4, i + 4 + (j + 1) % 4, i + 4 + j) for j in range(4)]
    solid.add(ring, faces, steel)


def on_surface(
    solid: Solid,
    line: Sequence[Address],
    width: float,
    steel: Material,
    depth: float = 0.0,
    height: float = 0.0,
) -> None:
    beam(
        solid,
        [surface(t, w, depth) for t, w in line],
        [normal(t, w) for t, w in line],
        width,
        height or width,
        steel,
    )


def primary_truss(solid: Solid, line: Sequence[Address], steel: Material) -> None:
    """Outer and inner chord with a zigzag between them; the chords meet at the ground."""
    depths = [TRUSS_DEPTH * min(1.0, 0.25 + w) for _, w in line]
    on_surface(solid, line, 1.7, steel)
    inner = [surface(t, w, d) for (t, w), d in zip(line, depths, strict=True)]
    ups = [normal(t, w) for t, w in line]
    beam(solid, inner, ups, 1.2, 1.2, steel)
    for i in range(len(line) - 1):
        outer = surface(*line[i + 1])
        for a, b in ((inner[i], outer), (outer, inner[i + 1])):
            beam(
                solid,
                [a, b],
                [Vector((0.3, 0.1, 1)).cross(b - a).normalized()] * 2,
                0.7,
                0.7,
                steel,
            )


def weave(solid: Solid, rng: Rng, count: int, steel: Material) -> None:
    """Secondary members: over the wall, round the shoulder, across the roof."""
    for i in range(count):
        theta = 2 * math.pi * (i + rng.uniform(-0.45, 0.45)) / count
        sign = 1 if i % 2 else -1
        roof = roof_line(theta, sign)
        cut = int(rng.integers(0, 8))
        foot = sign * rng.uniform(0.02, 0.4)
        line = roof[cut:] + wall_line(roof[-1][0], foot)
        on_surface(solid, line, rng.uniform(0.8, 1.3), steel, rng.uniform(0.0, 0.5))


def wall_members(solid: Solid, rng: Rng, count: int, steel: Material) -> None:
    """Members of the wall alone, from steep to flat, some ending on others."""
    for i in range(count):
        theta = 2 * math.pi * (i + rng.uniform(-0.5, 0.5)) / count
        low, high = sorted(rng.uniform(0, 1.12, 2))
        if high - low < 0.35:
            low, high = max(0.0, low - 0.3), min(1.12, high + 0.25)
        drift = rng.choice((-1, 1)) * rng.uniform(0.05, 0.42)
        line = [(theta + drift * u, low + (high - low) * u) for u in np.linspace(0, 1, 8)]
        on_surface(solid, line, rng.uniform(0.7, 1.2), steel, rng.uniform(-0.1, 0.6))


def ring(
    solid: Solid, w: float, width: float, height: float, steel: Material, depth: float = 0.0
) -> None:
    on_surface(solid, [(2 * math.pi * i / 96, w) for i in range(97)], width, steel, depth, height)


def structure(rng: Rng) -> None:
    steel = principled("Painted Steel", "#b4b3ae", 0.42, metallic=0.35)
    dark = principled("Shaded Steel", "#8f908e", 0.5, metallic=0.35)
    trusses = Solid("PrimaryTrusses")
    for k in range(PRIMARY):
        theta = 2 * math.pi * (k + 0.5) / PRIMARY
        for sign in (-1, 1):
            roof = roof_line(theta, sign)
            primary_truss(trusses, roof + wall_line(roof[-1][0], sign * 0.13), steel)
    ring(trusses, 2.0, 1.6, 3.0, steel)
    ring(trusses, 2.0, 1.6, 1.6, steel, TRUSS_DEPTH)
    ring(trusses, 1.03, 1.4, 1.4, steel)
    trusses.to_object(smooth=False)
    secondary = Solid("SecondaryMembers")
    weave(secondary, rng, 182, steel)
    secondary.to_object(smooth=False)
    members = Solid("WallMembers")
    wall_members(members, rng, 214, dark)
    members.to_object(smooth=False)


def membranes() -> None:
    """The ceiling under the roof and the screen around the opening."""
    white = principled("Membrane", "#dcdad2", 0.7, specular=0.3)
    sheet = Solid("Membrane")
    sheet.sheet(
        lambda u, v: surface(2 * math.pi * u, 1.12 + 0.88 * v, TRUSS_DEPTH * 0.45), 96, 5, white
    )
    sheet.sheet(
        lambda u, v: surface(2 * math.pi * u, 1.995, TRUSS_DEPTH * (0.05 + 0.9 * v)), 96, 1, white
    )
    sheet.to_object(closed=False)


# ---------------------------------------------------------------- the bowl


def bowl_radius(tier: int, row: int) -> tuple[float, float]:
    """Distance outward from the pitch's edge and height of a row."""
    tiers = ((0.0, 2.0, 0.82, 0.42), (22.0, 14.0, 0.8, 0.55), (37.0, 25.0, 0.78, 0.66))
    out, z, run, rise = tiers[tier]
    return out + run * row, z + rise * row


def seating(rng: Rng) -> None:
    """Three tiers of steps; each block of seats takes one of a few reds."""
    concrete = diffuse("Concrete Step", "#8d8982")
    reds = [
        principled(f"Seats {code}", code, 0.5)
        for code in ("#a3231f", "#b8372c", "#7f1c1c", "#c9b9a8")
    ]
    solid = Solid("Seating")
    blocks = 96
    for tier, rows in enumerate((22, 15, 14)):
        for row in range(rows):
            (r0, z0), (r1, _) = bowl_radius(tier, row), bowl_radius(tier, row + 1)
            top = z0 + 0.75
            points = [
                p
                for i in range(blocks)
                for p in step_points(2 * math.pi * i / blocks, r0, r1, z0, top)
            ]
            for i in range(blocks):
                a, b = 3 * i, 3 * ((i + 1) % blocks)
                share = row / rows
                seat = (
                    reds[3] if rng.random() < 0.32 * (1 - share) + 0.03 else reds[rng.integers(3)]
                )
                quads = [(a, b, b + 1, a + 1), (a + 1, b + 1, b + 2, a + 2)]
                if i % 8 == 0:
                    seat = concrete  # stairs
                solid.add([points[j] for q in quads for j in q], [(0, 1, 2, 3), (4, 5, 6, 7)], seat)
    solid.to_object(closed=False, smooth=False)


def step_points(theta: float, r0: float, r1: float, z0: float, top: float) -> list[Vector]:
    c, s = math.cos(theta), math.sin(theta)
    a, b = 88.0, 56.0
    return [Vector(((a + r) * c, (b + r) * s, z)) for r, z in ((r0, z0), (r0, top), (r1, top))]


def core(rng: Rng) -> None:
    """The concrete building behind the steel: red walls, floor slabs, lit galleries."""
    red = principled("Red Wall", "#9c1f18", 0.6)
    slab, glow = diffuse("Slab", "#a09a90"), light_emitter("Gallery Light", "#ffd9a0", 2.2)
    solid = Solid("Core")
    levels = (0.0, 6.5, 12.0, 17.5, 23.0, 28.5)
    for i, z in enumerate(levels):
        out = 0.80 + 0.012 * i
        floor_ring(solid, slab, 0.50 + 0.03 * i, out + 0.012, z + 5.3, z + 5.9)
        wall_ring(solid, red, out - 0.035, z, z + 5.3)
        if i % 2 == 1:
            floor_ring(solid, glow, out - 0.032, out - 0.012, z + 5.12, z + 5.24)
    for k in range(72):
        t = 2 * math.pi * k / 72
        foot = Vector((EAVES[0] * 0.8 * math.cos(t), EAVES[1] * 0.8 * math.sin(t), 0))
        head = Vector((EAVES[0] * 0.865 * math.cos(t), EAVES[1] * 0.865 * math.sin(t), 34.2))
        beam(solid, [foot, head], [Vector((-head.y, head.x, 0)).normalized()] * 2, 0.9, 0.9, slab)
    solid.to_object(smooth=False)


def wall_ring(
    solid: Solid, material: Material, scale: float, low: float, high: float, segments: int = 72
) -> None:
    points = [
        (EAVES[0] * scale * math.cos(t), EAVES[1] * scale * math.sin(t), z)
        for z in (low, high)
        for t in np.linspace(0, 2 * math.pi, segments, endpoint=False)
    ]
    faces = [
        (i, (i + 1) % segments, segments + (i + 1) % segments, segments + i)
        for i in range(segments)
    ]
    solid.add(points, faces, material)


def floor_ring(
    solid: Solid,
    material: Material,
    inner: float,
    outer: float,
    low: float,
    high: float,
    segments: int = 72,
) -> None:
    """A flat elliptic ring of four faces per segment."""
    points = []
    for i in range(segments):
        c, s = math.cos(2 * math.pi * i / segments), math.sin(2 * math.pi * i / segments)
        points += [
            (EAVES[0] * r * c, EAVES[1] * r * s, z)
            for r, z in ((inner, low), (outer, low), (outer, high), (inner, high))
        ]
    faces = []
    for i in range(segments):
        a, b = 4 * i, 4 * ((i + 1) % segments)
        faces += [(a + j, b + j, b + (j + 1) % 4, a + (j + 1) % 4) for j in range(4)]
    solid.add(points, faces, material)


# ---------------------------------------------------------------- surroundings


def pitch_image(rng: Rng) -> np.ndarray:
    """Grass in stripes with its lines, the red track around it; 200 m x 140 m."""
    height, width = 280, 400
    y, x = np.meshgrid(
        (np.arange(height) + 0.5) / 2 - 70, (np.arange(width) + 0.5) / 2 - 100, indexing="ij"
    )
    grass = tinted(
        "#3d6b2c", "#558238", 0.35 * ((x // 6) % 2) + 0.5 * noise((height, width), 12, rng, 3)
    )
    straight = np.maximum(np.abs(x) - 42.0, 0)
    from_line = np.hypot(straight, y)
    picture = np.where(
        (from_line > 36.5)[..., None],
        tinted("#7a3226", "#8f3d2c", noise((height, width), 20, rng, 3)),
        grass,
    )
    lanes = (from_line > 36.5) & (from_line < 46.5) & (np.abs((from_line - 36.5) % 1.25) < 0.25)
    outside = from_line > 46.5
    inside = (np.abs(x) < 52.5) & (np.abs(y) < 34)
    lines = inside & (
        (np.abs(x) > 52)
        | (np.abs(y) > 33.5)
        | (np.abs(x) < 0.3)
        | (np.abs(np.hypot(x, y) - 9.15) < 0.4)
    )
    lines |= inside & (np.abs(np.abs(x) - 36) < 0.3) & (np.abs(y) < 20.2)
    lines |= inside & (np.abs(x) > 36) & (np.abs(np.abs(y) - 20.2) < 0.3)
    picture[lanes | lines] = (0.85, 0.84, 0.8)
    picture[outside] = tinted("#5d6a52", "#66735a", noise((height, width), 20, rng, 2))[outside]
    return np.round(picture * 48) / 48


def pitch(rng: Rng) -> None:
    grass = principled(
        "Pitch", "#4c7a34", 0.9, specular=0.2, image=packed_image("Pitch", pitch_image(rng))
    )
    solid = Solid("Pitch")
    solid.add(
        [(-100, -70, 0.4), (100, -70, 0.4), (100, 70, 0.4), (-100, 70, 0.4)], [range(4)], grass
    )
    obj = solid.to_object(closed=False, smooth=False)
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])


def plaza(rng: Rng) -> None:
    """Paving around the bowl with bands of stone, and a canal."""
    tiles = 0.55 * noise((384, 384), 5, rng, 5, 0.6)
    grid = np.arange(384) % 24 < 1
    tiles[grid] -= 0.12
    tiles[:, grid] -= 0.12
    image = packed_image("Paving", np.round(tinted("#7d776c", "#bcb5a6", tiles + 0.25) * 48) / 48)
    ground = Solid("Plaza")
    stone = principled("Paving", "#9a9488", 0.8, specular=0.3, image=image)
    corners = [(-1500, -1500, 0), (1500, -1500, 0), (1500, 1500, 0), (-1500, 1500, 0)]
    ground.add(corners, [range(4)], stone)
    ground.to_object(closed=False, smooth=False, uv_metres=60.0)
    water = Solid("Canal")
    water.box((2400, 60, 0.2), (0, 420, 0.1), principled("Canal", "#31424a", 0.05, specular=0.6))
    water.to_object(smooth=False)
    bands = Solid("StoneBands")
    pale, dark = principled("Pale Stone", "#c6bfb0", 0.6), principled("Dark Stone", "#6c675f", 0.6)
    floor_ring(bands, pale, 1.2, 1.225, 0.0, 0.06)
    floor_ring(bands, dark, 1.06, 1.085, 0.0, 0.06)
    for k in range(SECTORS * 2):
        sector(
            bands, dark if k % 2 else pale, (k - 0.04, k + 0.04), (1.085, 1.2), 0.05, SECTORS * 2
        )
    bands.to_object(smooth=False)


SECTORS = 14
LAWNS = (1.27, 1.62)  # inner and outer edge, in half axes of the eaves


def sector(
    solid: Solid,
    material: Material,
    span: tuple[float, float],
    reach: tuple[float, float],
    top: float,
    count: int,
) -> None:
    """A part of an elliptic ring: `span` counts in 1 / count of the turn, `reach` in half axes."""
    steps = 6
    points = []
    for i in range(steps + 1):
        t = 2 * math.pi * (span[0] + (span[1] - span[0]) * i / steps) / count
        corners = ((reach[0], 0), (reach[0], top), (reach[1], top), (reach[1], 0))
        c, s = EAVES[0] * math.cos(t), EAVES[1] * math.sin(t)
        points += [(c * r, s * r, z) for r, z in corners]
    last = 4 * steps
    faces = [(0, 1, 2, 3), (last + 3, last + 2, last + 1, last)]
    faces += [
        (4 * i + j, 4 * i + 4 + j, 4 * i + 4 + (j + 1) % 4, 4 * i + (j + 1) % 4)
        for i in range(steps)
        for j in range(4)
    ]
    solid.add(points, faces, material)


def park(rng: Rng) -> None:
    """Lawns in a ring around the plaza, with trees on them."""
    meadow = diffuse("Meadow", "#6b7a4c")
    grass, kerb = diffuse("Lawn", "#5d7638"), diffuse("Kerb", "#a8a295")
    green = Solid("Lawns")
    kinds = tree_kinds(rng)
    for k in range(SECTORS):
        sector(green, meadow, (k + 0.55, k + 1.45), (LAWNS[1] + 0.09, 2.6), 0.3, SECTORS)
        sector(green, kerb, (k + 0.08, k + 0.92), LAWNS, 0.3, SECTORS)
        inner = (LAWNS[0] + 0.006, LAWNS[1] - 0.006)
        sector(green, grass, (k + 0.09, k + 0.91), inner, 0.45, SECTORS)
        for _ in range(10):
            t = 2 * math.pi * (k + rng.uniform(0.13, 0.87)) / SECTORS
            r = math.sqrt(rng.uniform((LAWNS[0] + 0.04) ** 2, (LAWNS[1] - 0.04) ** 2))
            tree = (EAVES[0] * r * math.cos(t), EAVES[1] * r * math.sin(t), 0.3)
            copy(kinds[rng.integers(3)], tree, (0, 0, 7 * t), rng.uniform(0.6, 1.15))
    green.to_object(smooth=False)
    for kind in kinds:
        bpy.data.objects.remove(kind)


def tree_kinds(rng: Rng) -> list[Object]:
    bark = diffuse("Bark", "#4a3b2c")
    kinds = []
    for i, code in enumerate(("#4a6130", "#56692f", "#3e5530")):
        tree = Solid(f"Tree{i}")
        tree.rock(4.2, diffuse(f"Crown {code}", code), rng, 2)
        tree.vertices = [v + Vector((0, 0, 6.4)) for v in tree.vertices]
        tree.cylinder(0.35, (0, 0, -0.2), (0, 0, 4.5), bark, 5)
        kinds.append(tree.to_object())
    return kinds


def city(rng: Rng) -> None:
    """Blocks of houses in the haze behind the park."""
    walls = [
        diffuse(f"House {code}", code) for code in ("#c2c6c9", "#cbc8c2", "#b3bbc2", "#a9b1b8")
    ]
    solid = Solid("City")
    for _ in range(170):
        a, r = math.radians(rng.uniform(20, 190)), rng.uniform(640, 1400)
        height = rng.uniform(15, 60) if rng.random() < 0.8 else rng.uniform(70, 130)
        size = (rng.uniform(22, 60), rng.uniform(22, 60), height)
        solid.box(
            size,
            (r * math.cos(a), r * math.sin(a), height / 2),
            walls[rng.integers(4)],
            (0, 0, rng.integers(2) * 0.2),
        )
    solid.to_object(smooth=False)


def lamp_posts() -> None:
    iron, head = (
        principled("Post", "#4a4c4e", 0.5, metallic=0.6),
        light_emitter("Post Lamp", "#fff0d0", 2.0),
    )
    post = Solid("LampPost")
    post.cylinder(0.16, (0, 0, 0), (0, 0, 9), iron, 6, 0.09)
    post.box((1.6, 0.4, 0.18), (0.6, 0, 9), iron)
    post.box((1.0, 0.3, 0.04), (0.7, 0, 8.88), head)
    source = post.to_object(smooth=False)
    for k in range(36):
        t = 2 * math.pi * k / 36
        copy(source, (203 * math.cos(t), 181 * math.sin(t), 0), (0, 0, t + math.pi))
    bpy.data.objects.remove(source)


def flight() -> None:
    """An arc of 16 degrees around the bowl, rising."""
    keys = []
    for i in range(5):
        u = i / 4
        a = math.radians(-66 + 16 * u)
        keys.append(
            (
                1 + round((FRAMES - 1) * u),
                (392 * math.cos(a), 392 * math.sin(a), 112 + 50 * u),
                (0, 0, 18 - 4 * u),
            )
        )
    camera(keys, 34, (1.0, 6000))


def make() -> None:
    """Build the scene and save it with its card."""
    rng = np.random.default_rng(114)
    start(FRAMES)
    structure(rng)
    membranes()
    seating(rng)
    core(rng)
    pitch(rng)
    plaza(rng)
    park(rng)
    city(rng)
    lamp_posts()
    towards = sun(26, -146, 4.6, "#ffe2ba")
    sky(towards, 0.95, 0.35, "#5b8dc9", "#d5dbe0", "#8a857a", seed=21)
    flight()
    save("stadium", TITLE, EXERCISES, "sun")


if __name__ == "__main__":
    make()
