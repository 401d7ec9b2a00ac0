"""`loader`: a wheel loader carries a full bucket across a yard and lifts it.

The machine is a tree of rigid parts: yard > rear frame > (cab, hood, wheels) and
front frame > boom > (bucket, bell crank). Its frames are about X forward, Y left, Z up.
"""

from __future__ import annotations

import math

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
    ease,
    empty,
    key,
    light_emitter,
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
TITLE = "Wheel loader"
EXERCISES = (
    "rigid parts in a deep parent tree, constraints, rolling wheels, linked meshes, bevel "
    "modifiers, sun and sky, packed image textures, alpha, emission, Mix shader, moving camera"
)
WHEEL_RADIUS = 0.82
AXLE = 1.65  # from the articulation joint to either axle
HALF_TRACK = 1.02
BOOM_PIVOT = Vector((0.55, 0, 2.0))  # in the front frame
BUCKET_PIN = Vector((2.9, 0, 0))  # in the boom
# The Z-bar linkage, (x, z): crank pivot in the boom, its ends, bucket pin in the bucket.
CRANK_PIVOT, CRANK_LOW, CRANK_HIGH = (
    Vector((1.5, 0.42)),
    Vector((0.4, -0.37)),
    Vector((-0.25, 0.53)),
)
BUCKET_LINK = Vector((0.0, 0.48))
LINK_LENGTH = 0.81
TILT_BASE = Vector((0.5, 0, 2.36))  # tilt cylinder, in the front frame
LIFT_BASE, LIFT_END = Vector((0.8, 0, 0.98)), Vector((1.3, 0, -0.06))  # front frame, boom


class Paints:
    """The materials of the machine and the yard."""

    def __init__(self, rng: Rng) -> None:
        worn = 0.28 + 0.35 * noise((256, 256), 6, rng, 5) ** 2
        wear = packed_image("PaintRoughness", np.repeat(worn[..., None], 3, 2), colour=False)
        self.yellow = principled("Yellow Paint", "#e0a012", rough_image=wear)
        self.black = principled("Black Paint", "#1c1d1f", 0.45)
        self.grey = principled("Grey Paint", "#55585a", 0.5)
        self.rubber = principled("Rubber", "#201f1e", 0.85, specular=0.3)
        self.steel = principled("Worn Steel", "#8a8784", 0.38, metallic=1.0)
        self.chrome = principled("Piston Chrome", "#d8dadc", 0.12, metallic=1.0)
        self.glass = principled("Cab Glass", "#223038", 0.04, alpha=0.35)
        self.seat = diffuse("Seat Cloth", "#2b2f36")
        self.lamp = light_emitter("Work Lamp", "#fff3d6", 6.0)
        self.beacon = principled("Beacon", "#ff7a10", 0.3, emission=2.5)
        self.tail = principled("Tail Lamp", "#b01010", 0.25, emission=0.6)
        self.chassis = varnished("Chassis Enamel", "#2a2b2d", 0.25, 0.06)


# ---------------------------------------------------------------- wheels


def tyre(solid: Solid, rubber: Material) -> None:
    half = [
        (0.42, 0.20),
        (0.46, 0.25),
        (0.58, 0.29),
        (0.68, 0.285),
        (0.745, 0.26),
        (0.77, 0.18),
        (0.775, 0.0),
    ]
    profile = half + [(r, -y) for r, y in half[-2::-1]]
    solid.lathe([*profile, profile[0]], rubber, Matrix.Rotation(-math.pi / 2, 4, "X"), 48)
    count = 22
    for i in range(count):
        for side in (-1, 1):
            lug(solid, rubber, 2 * math.pi * (i + 0.25 * side) / count, side)


def lug(solid: Solid, rubber: Material, angle: float, side: int) -> None:
    """One bar of the chevron tread, from the middle over the shoulder."""
    stations = (  # y, lead, inner and outer radius
        (0.0, 0.0, 0.74, WHEEL_RADIUS),
        (0.14, 0.07, 0.74, WHEEL_RADIUS),
        (0.255, 0.13, 0.72, 0.805),
        (0.292, 0.15, 0.63, 0.69),
    )
    points = []
    for y, lead, inner, outer in stations:
        for radius, half_width in ((inner, 0.062), (outer, 0.045)):
            for edge in (-half_width, half_width):
                a = angle + lead + edge
                points.append((radius * math.cos(a), side * y, radius * math.sin(a)))
    faces = [(0, 1, 3, 2), (12, 14, 15, 13)]
    for s in (0, 4, 8):
        faces += [(s + a, s + b, s + 4 + b, s + 4 + a) for a, b in ((0, 1), (1, 3), (3, 2), (2, 0))]
    solid.add(points, faces, rubber)


def wheel_mesh(paints: Paints) -> Object:
    wheel = Solid("Wheel")
    tyre(wheel, paints.rubber)
    to_axle = Matrix.Rotation(-math.pi / 2, 4, "X")
    flange = "0.43 -0.22, 0.43 0.22, 0.405 0.225, 0.385 0.18, 0.36 0.1, 0.24 0.06"
    rim = outline(f"{flange}, 0.22 0.12, 0.17 0.135, 0.15 0.2, 0.05 0.215")
    wheel.lathe(rim, paints.yellow, to_axle, 32)
    for i in range(12):
        a = 2 * math.pi * i / 12
        x, z = 0.195 * math.cos(a), 0.195 * math.sin(a)
        wheel.cylinder(0.02, (x, 0.12, z), (x, 0.155, z), paints.steel, 6)
    return wheel.to_object(uv_metres=1.5)


def wheels(parent: Object, x: float, mesh: Object, paints: Paints) -> list:
    """Two wheels on an axle; (wheel, sign of its turn) each, their rims facing outward."""
    axle = Solid("Axle")
    axle.cylinder(0.16, (x, -0.85, WHEEL_RADIUS), (x, 0.85, WHEEL_RADIUS), paints.chassis, 20)
    gear = outline("0.1 -0.3, 0.3 -0.2, 0.36 0, 0.3 0.2, 0.1 0.3")
    axle.lathe(gear, paints.chassis, placed((x, 0, WHEEL_RADIUS), (math.pi / 2, 0, 0)), 24)
    axle.to_object(parent)
    turning = []
    for side in (-1, 1):
        hub = empty("Hub", (x, side * HALF_TRACK, WHEEL_RADIUS), parent)
        hub.rotation_euler.z = 0 if side > 0 else math.pi
        wheel = copy(mesh, (0, 0, 0))
        wheel.parent = hub
        turning.append((wheel, side))
    return turning


# ---------------------------------------------------------------- rear frame


def hood(parent: Object, paints: Paints) -> None:
    body = Solid("Hood")
    shape = "-0.98 1.12, -0.98 2.12, -2.3 2.06, -3 1.95, -3.25 1.72, -3.3 1.12"
    body.prism(outline(shape), (-0.74, 0.74), paints.yellow)
    body.to_object(parent, bevel=0.07, segments=4, uv_metres=1.5)
    weight = Solid("Counterweight")
    weight.prism(
        [(-2.75, 0.66), (-3.35, 0.72), (-3.52, 0.85), (-3.52, 1.24), (-2.75, 1.24)],
        (-1.2, 1.2),
        paints.grey,
    )
    weight.to_object(parent, bevel=0.05, segments=3)
    trim = Solid("HoodTrim")
    for side in (-1, 1):
        for i in range(9):  # louvres of the engine side
            trim.box(
                (0.9, 0.03, 0.028),
                (-1.75, side * 0.75, 1.42 + 0.055 * i),
                paints.black,
                (side * 0.5, 0, 0),
            )
        trim.box((0.7, 0.02, 0.6), (-2.72, side * 0.745, 1.45), paints.black)
    for i in range(8):  # radiator grille
        trim.box((0.03, 1.2, 0.03), (-3.29 + 0.006 * i, 0, 1.3 + 0.05 * i), paints.black)
    trim.box((0.5, 0.75, 0.04), (-2.55, 0, 2.05), paints.black, (0, -0.09, 0))
    trim.to_object(parent)
    stacks = Solid("Stacks")
    stacks.tube(
        [(-1.55, 0.3, 2.0), (-1.55, 0.3, 2.62), (-1.58, 0.3, 2.72), (-1.68, 0.3, 2.8)],
        0.06,
        paints.steel,
        14,
    )
    stacks.cylinder(0.1, (-1.55, 0.3, 2.05), (-1.55, 0.3, 2.4), paints.black, 18)
    stacks.cylinder(0.05, (-1.3, -0.32, 2.0), (-1.3, -0.32, 2.4), paints.black, 14)
    stacks.lathe(
        [(0.06, 0), (0.13, 0.03), (0.13, 0.16), (0.05, 0.22)],
        paints.black,
        placed((-1.3, -0.32, 2.38)),
        18,
    )
    stacks.to_object(parent)


def rear_chassis(parent: Object, paints: Paints) -> None:
    frame = Solid("RearChassis")
    frame.box((3.0, 0.9, 0.42), (-1.65, 0, 0.95), paints.chassis)
    frame.box((0.5, 1.3, 0.5), (-0.85, 0, 0.92), paints.chassis)
    for z in (0.72, 1.14):  # the joint's ears
        frame.box((0.5, 0.36, 0.07), (-0.08, 0, z), paints.chassis)
    frame.cylinder(0.09, (0, 0, 0.6), (0, 0, 1.3), paints.steel, 20)
    frame.to_object(parent, bevel=0.02)
    arches = Solid("RearFenders")
    for side in (-1, 1):
        fender(arches, paints.yellow, -AXLE, side, 15, 150)
        arches.box(
            (0.7, 0.5, 0.42), (-0.52, side * 0.97, 0.9), paints.black
        )  # tank and battery boxes
    arches.to_object(parent, bevel=0.015, segments=1, uv_metres=1.5)
    lamps = Solid("RearLamps")
    for side in (-1, 1):
        lamps.box((0.04, 0.22, 0.1), (-3.53, side * 0.95, 1.08), paints.tail)
        lamps.box((0.04, 0.1, 0.1), (-3.53, side * 0.72, 1.08), paints.lamp)
    lamps.to_object(parent, bevel=0.01, segments=1)


def fender(solid: Solid, paint: Material, x: float, side: int, first: float, last: float) -> None:
    """A curved guard over a wheel, from `first` to `last` degrees."""
    angles = [math.radians(first + (last - first) * i / 12) for i in range(13)]
    arc = [
        (x + r * math.cos(a), WHEEL_RADIUS + r * math.sin(a))
        for r, order in ((0.99, angles), (0.95, angles[::-1]))
        for a in order
    ]
    solid.prism(arc, (side * 0.72, side * 1.34), paint)


def steps_and_rails(parent: Object, paints: Paints) -> None:
    iron = Solid("StepsAndRails")
    for side in (-1, 1):
        y = side * 1.12
        iron.box((0.95, 0.5, 0.05), (-0.42, side * 0.96, 1.2), paints.black)  # landing
        for i in range(3):
            iron.box(
                (0.46, 0.26, 0.035),
                (-0.3, y + side * 0.05 * (2 - i) * 0.5, 0.42 + 0.25 * i),
                paints.black,
            )
        for x in (-0.54, -0.06):
            iron.box((0.035, 0.05, 0.72), (x, y + side * 0.06, 0.72), paints.black)
        for x in (-0.84, -0.02):
            top = [(x, y, 1.95), (x - 0.06, y, 2.05), (x - 0.12, y - side * 0.2, 2.05)]
            iron.tube([(x, y, 1.2), *top], 0.02, paints.yellow, 8)
        rail = [(-1.1, 2.1), (-1.1, 2.4), (-1.2, 2.48), (-2.6, 2.42), (-2.72, 2.34), (-2.75, 2.0)]
        iron.tube([(x, side * 0.66, z) for x, z in rail], 0.02, paints.black, 8)
        iron.cylinder(0.018, (-1.9, side * 0.66, 2.05), (-1.9, side * 0.66, 2.44), paints.black, 8)
    iron.to_object(parent)


def cab(parent: Object, paints: Paints) -> None:
    profile = [(0.42, 1.22), (0.52, 1.9), (0.36, 3.1), (-0.86, 3.1), (-0.92, 1.9), (-0.92, 1.22)]
    shell = Solid("CabFrame")
    shell.box((1.36, 1.4, 0.1), (-0.24, 0, 1.26), paints.black)
    for side in (-1, 1):
        y = side * 0.7
        for a, b in zip(profile, profile[1:] + profile[:1], strict=True):
            shell.tube([(a[0], y, a[1]), (b[0], y, b[1])], 0.05, paints.black, 8)
        shell.tube([(-0.3, y, 1.3), (-0.3, y, 3.1)], 0.035, paints.black, 8)
        shell.box((1.3, 0.06, 0.42), (-0.22, y, 1.5), paints.yellow)  # lower panel and door
    for x, z in profile:
        shell.tube([(x, -0.7, z), (x, 0.7, z)], 0.05, paints.black, 8)
    shell.to_object(parent, uv_metres=1.5)
    roof = Solid("CabRoof")
    roof.box((1.62, 1.62, 0.16), (-0.24, 0, 3.2), paints.yellow, taper=0.93)
    roof.to_object(parent, bevel=0.05, segments=3, uv_metres=1.5)
    panes = Solid("CabGlass")
    for side in (-1, 1):
        pane = outline("0.47 1.7, 0.51 1.9, 0.36 3.08, -0.86 3.08, -0.9 1.7")
        panes.add([(x, side * 0.7, z) for x, z in pane], [range(5)], paints.glass)
    for low, high in ((0, 1), (1, 2), (4, 3)):
        edges = (
            (profile[low], -0.66),
            (profile[low], 0.66),
            (profile[high], 0.66),
            (profile[high], -0.66),
        )
        panes.add([(x, y, z) for (x, z), y in edges], [range(4)], paints.glass)
    panes.to_object(parent, smooth=False, closed=False)


def cab_inside(parent: Object, paints: Paints) -> None:
    seat = Solid("Seat")
    seat.box((0.5, 0.52, 0.14), (-0.42, 0, 1.78), paints.seat)
    seat.box((0.14, 0.5, 0.7), (-0.68, 0, 2.15), paints.seat, (0, -0.14, 0))
    seat.box((0.1, 0.28, 0.2), (-0.75, 0, 2.6), paints.seat, (0, -0.14, 0))
    seat.box((0.36, 0.36, 0.42), (-0.44, 0, 1.5), paints.black)
    seat.box((0.42, 0.12, 0.08), (-0.4, -0.34, 1.98), paints.black)
    seat.to_object(parent, bevel=0.03)
    wheel = Solid("SteeringWheel")
    ring = [(0.19 * math.cos(a), 0.19 * math.sin(a), 0) for a in np.linspace(0, 2 * math.pi, 21)]
    tilt = placed((0.02, 0, 2.05), (0, -0.6, 0))
    wheel.tube([tilt @ Vector(p) for p in ring], 0.018, paints.black, 6)
    wheel.tube([tilt @ Vector((0, -0.18, 0)), tilt @ Vector((0, 0.18, 0))], 0.014, paints.black, 6)
    wheel.cylinder(0.04, (0.25, 0, 1.35), tilt @ Vector((0, 0, 0)), paints.black, 10)
    wheel.box((0.22, 0.7, 0.3), (0.32, 0, 1.45), paints.black)
    wheel.to_object(parent)


def cab_lamps(parent: Object, paints: Paints) -> None:
    lamps = Solid("CabLamps")
    for y in (-0.6, -0.32, 0.32, 0.6):
        lamps.box((0.1, 0.16, 0.12), (0.6, y, 3.22), paints.black)
        lamps.box((0.02, 0.13, 0.09), (0.655, y, 3.22), paints.lamp)
    lamps.cylinder(0.07, (-0.75, 0.5, 3.27), (-0.75, 0.5, 3.32), paints.black, 16)
    lamps.lathe(
        [(0.062, 0), (0.062, 0.1), (0.045, 0.14), (0.015, 0.15)],
        paints.beacon,
        placed((-0.75, 0.5, 3.32)),
        16,
    )
    for side in (-1, 1):  # mirrors
        lamps.tube(
            [(0.42, side * 0.74, 2.9), (0.55, side * 1.0, 2.9), (0.55, side * 1.05, 2.7)],
            0.016,
            paints.black,
            6,
        )
        lamps.box((0.05, 0.2, 0.34), (0.55, side * 1.06, 2.55), paints.black)
        lamps.box((0.01, 0.16, 0.3), (0.522, side * 1.06, 2.55), paints.chrome)
    lamps.to_object(parent, bevel=0.01, segments=1)


# ---------------------------------------------------------------- front frame and arm


def front_chassis(parent: Object, paints: Paints) -> None:
    frame = Solid("FrontChassis")
    frame.box((1.5, 0.76, 0.4), (1.1, 0, 0.95), paints.chassis)
    frame.box((0.4, 0.34, 0.2), (0.18, 0, 0.93), paints.chassis)
    tower = [
        (0.3, 0.9),
        (1.7, 0.8),
        (1.75, 1.15),
        (0.95, 1.5),
        (0.72, 2.12),
        (0.6, 2.5),
        (0.42, 2.5),
        (0.36, 2.0),
    ]
    for y in (-0.36, 0.26):
        frame.prism(tower, (y, y + 0.1), paints.yellow)
    frame.box((0.12, 0.6, 0.5), (0.48, 0, 1.6), paints.yellow)
    frame.cylinder(0.11, (0.55, -0.66, 2.0), (0.55, 0.66, 2.0), paints.steel, 20)
    frame.cylinder(
        0.06, (TILT_BASE.x, -0.3, TILT_BASE.z), (TILT_BASE.x, 0.3, TILT_BASE.z), paints.steel, 16
    )
    frame.cylinder(
        0.07, (LIFT_BASE.x, -0.58, LIFT_BASE.z), (LIFT_BASE.x, 0.58, LIFT_BASE.z), paints.steel, 16
    )
    frame.to_object(parent, bevel=0.018, uv_metres=1.5)
    guards = Solid("FrontFenders")
    for side in (-1, 1):
        fender(guards, paints.yellow, AXLE, side, 55, 150)
        guards.box((0.1, 0.42, 0.06), (1.2, side * 0.55, 1.55), paints.black)
        guards.cylinder(0.025, (1.02, side * 0.95, 1.6), (1.02, side * 0.95, 2.1), paints.black, 8)
        guards.box((0.14, 0.26, 0.18), (1.04, side * 0.95, 2.15), paints.black)
        guards.box((0.02, 0.21, 0.13), (1.115, side * 0.95, 2.15), paints.lamp)
    guards.to_object(parent, bevel=0.015, segments=1, uv_metres=1.5)


def boom(parent: Object, paints: Paints) -> Object:
    arm = empty("Boom", BOOM_PIVOT, parent)
    plates = Solid("BoomPlates")
    below = "-0.16 -0.1, 0 -0.18, 1.3 -0.2, 2.3 -0.16, 2.95 -0.14, 3.04 0"
    above = "2.95 0.14, 2.35 0.2, 1.75 0.5, 1.4 0.56, 0.9 0.34, 0 0.18, -0.16 0.1"
    for y in (-0.58, 0.48):
        plates.prism(outline(f"{below}, {above}"), (y, y + 0.1), paints.yellow)
    plates.to_object(arm, bevel=0.02, segments=3, uv_metres=1.5)
    pins = Solid("BoomPins")
    pins.cylinder(0.15, (2.15, -0.5, 0.02), (2.15, 0.5, 0.02), paints.yellow, 24)
    x, z = CRANK_PIVOT
    pins.cylinder(0.07, (x, -0.66, z), (x, 0.66, z), paints.steel, 18)
    pins.cylinder(
        0.07, (LIFT_END.x, -0.52, LIFT_END.z), (LIFT_END.x, 0.52, LIFT_END.z), paints.steel, 18
    )
    for x in (0.0, BUCKET_PIN.x):
        for y in (-0.53, 0.53):
            pins.cylinder(0.13, (x, y - 0.085, 0), (x, y + 0.085, 0), paints.black, 24)
    pins.cylinder(0.06, (BUCKET_PIN.x, -0.68, 0), (BUCKET_PIN.x, 0.68, 0), paints.steel, 18)
    pins.to_object(arm, uv_metres=1.5)
    return arm


def bell_crank(arm: Object, paints: Paints) -> tuple[Object, Object]:
    """The lever on the boom and the link from its lower end to the bucket."""
    crank = empty("BellCrank", (CRANK_PIVOT.x, 0, CRANK_PIVOT.y), arm)
    plate = Solid("BellCrankPlate")
    low, high = CRANK_LOW, CRANK_HIGH
    upper = [(high.x + 0.1, high.y + 0.02), (high.x, high.y + 0.11), (high.x - 0.1, high.y)]
    lower = [(low.x - 0.07, low.y - 0.1), (low.x + 0.1, low.y - 0.05)]
    plate.prism([(0.17, 0.06), *upper, (-0.15, -0.08), *lower], (-0.1, 0.1), paints.yellow)
    for x, z, r in ((0, 0, 0.15), (low.x, low.y, 0.1), (high.x, high.y, 0.1)):
        plate.cylinder(r, (x, -0.16, z), (x, 0.16, z), paints.black, 24)
    plate.to_object(crank, bevel=0.02, uv_metres=1.5)
    bar = Solid("BucketLink")
    for y in (-0.19, 0.13):
        bar.box((LINK_LENGTH, 0.06, 0.14), (LINK_LENGTH / 2, y + 0.03, 0), paints.yellow)
        for x in (0, LINK_LENGTH):
            bar.cylinder(0.1, (x, y - 0.005, 0), (x, y + 0.065, 0), paints.yellow, 20)
    rod = bar.to_object(crank, at=(low.x, 0, low.y), uv_metres=1.5)
    return crank, rod


BUCKET_SHELL = [
    (1.32, -0.36),
    (0.5, -0.36),
    (0.28, -0.29),
    (0.15, -0.12),
    (0.12, 0.1),
    (0.13, 0.55),
    (0.3, 0.98),
]


def bucket(arm: Object, paints: Paints) -> Object:
    joint = empty("Bucket", BUCKET_PIN, arm)
    inner = [
        (1.32, -0.32),
        (0.52, -0.32),
        (0.31, -0.25),
        (0.19, -0.1),
        (0.165, 0.1),
        (0.175, 0.54),
        (0.34, 0.97),
    ]
    shell = Solid("BucketShell")
    shell.prism(BUCKET_SHELL + inner[::-1], (-1.5, 1.5), paints.yellow)
    side = [*BUCKET_SHELL, (0.62, 0.86), (0.98, 0.3), (1.34, -0.26)]
    for y in (-1.54, 1.48):
        shell.prism(side, (y, y + 0.06), paints.yellow)
    for y in (-0.66, -0.42, 0.36, 0.6):  # ears of the boom pins
        shell.prism(
            [(0.16, -0.2), (0.0, -0.14), (-0.12, 0), (0.0, 0.14), (0.16, 0.3)],
            (y, y + 0.06),
            paints.yellow,
        )
    for y in (-0.12, 0.06):
        shell.prism(
            [(0.16, 0.2), (-0.1, 0.42), (-0.08, 0.56), (0.16, 0.72)], (y, y + 0.06), paints.yellow
        )
    shell.to_object(joint, bevel=0.012, uv_metres=1.5)
    edge = Solid("BucketEdge")
    edge.prism([(1.2, -0.375), (1.46, -0.375), (1.2, -0.31)], (-1.55, 1.55), paints.steel)
    for i in range(8):
        y = -1.4 + 0.4 * i
        edge.prism(
            [(1.3, -0.39), (1.68, -0.37), (1.42, -0.28), (1.3, -0.28)],
            (y - 0.06, y + 0.06),
            paints.steel,
        )
    edge.cylinder(0.05, (0, -0.3, 0.48), (0, 0.3, 0.48), paints.steel, 16)
    edge.to_object(joint)
    return joint


def cylinder_pair(
    base: Object, end: Object, radius: float, lengths: tuple[float, float], paints: Paints
) -> None:
    """A hydraulic cylinder: barrel at `base` and rod at `end`, each aimed at the other."""
    barrel = Solid("Barrel")
    barrel.cylinder(radius, (0.1, 0, 0), (lengths[0], 0, 0), paints.black, 20)
    barrel.cylinder(radius * 1.15, (lengths[0] - 0.08, 0, 0), (lengths[0], 0, 0), paints.grey, 20)
    barrel.cylinder(radius * 1.1, (0, -radius, 0), (0, radius, 0), paints.black, 18)
    rod = Solid("Rod")
    rod.cylinder(radius * 0.55, (0.05, 0, 0), (lengths[1], 0, 0), paints.chrome, 16)
    rod.cylinder(radius * 1.1, (0, -radius * 0.9, 0), (0, radius * 0.9, 0), paints.black, 18)
    for solid, parent, goal in ((barrel, base, end), (rod, end, base)):
        aim(solid.to_object(parent), goal)


def aim(obj: Object, goal: Object) -> None:
    track = obj.constraints.new("DAMPED_TRACK")
    track.target, track.track_axis = goal, "TRACK_X"


def hydraulics(front: Object, arm: Object, crank: Object, paints: Paints) -> None:
    for y in (-0.42, 0.42):
        base = empty("LiftBase", (LIFT_BASE.x, y, LIFT_BASE.z), front)
        cylinder_pair(
            base, empty("LiftEnd", (LIFT_END.x, y, LIFT_END.z), arm), 0.085, (0.9, 0.9), paints
        )
    end = empty("TiltEnd", (CRANK_HIGH.x, 0, CRANK_HIGH.y), crank)
    cylinder_pair(empty("TiltBase", TILT_BASE, front), end, 0.1, (1.0, 0.98), paints)


# ---------------------------------------------------------------- motion


def crank_angle(bucket_angle: float) -> tuple[float, float]:
    """Angles of bell crank (in the boom) and link (in the crank) that hold the bucket.

    The bucket stands at `bucket_angle` in the boom; the circles about the crank's pivot and
    about the bucket's pin meet where the two levers join.
    """
    c, s = math.cos(bucket_angle), math.sin(bucket_angle)
    pin = Vector((BUCKET_PIN.x - s * BUCKET_LINK.y, c * BUCKET_LINK.y))
    span = pin - CRANK_PIVOT
    arm = CRANK_LOW.length
    along = (arm**2 - LINK_LENGTH**2 + span.length_squared) / (2 * span.length)
    off = math.sqrt(arm**2 - along**2)
    across = Vector((span.y, -span.x)).normalized()
    low = CRANK_PIVOT + span.normalized() * along + across * off
    angle = heading(low - CRANK_PIVOT) - heading(CRANK_LOW)
    return angle, heading(pin - low) - angle


def heading(v: Vector) -> float:
    return math.atan2(v.y, v.x)


def animate(
    rear: Object,
    front: Object,
    arm: Object,
    joint: Object,
    crank: Object,
    rod: Object,
    turning: list[tuple[Object, int]],
) -> None:
    """Drive along a bend while the arm lifts the full bucket; a key on each frame.

    Steering of an articulated machine: the front axle rolls along its own heading, and the
    rear follows with (v sin bend + rear * bend') / (front * cos bend + rear).
    """
    place, direction, rolled, last_bend = Vector((0.0, 0.0)), 0.0, 0.0, math.radians(22)
    for frame in range(1, FRAMES + 1):
        u = (frame - 1) / (FRAMES - 1)
        step = 2.6 / (FRAMES - 1) if frame > 1 else 0.0
        bend = math.radians(22) * (1 - 1.25 * ease(u))
        direction += (step * math.sin(bend) + AXLE * (bend - last_bend)) / (
            AXLE * math.cos(bend) + AXLE
        )
        place += step * Vector((math.cos(direction), math.sin(direction)))
        rolled, last_bend = rolled + step, bend
        hinge = place - AXLE * Vector((math.cos(direction), math.sin(direction)))
        key(rear, frame, location=(hinge.x, hinge.y, 0), rotation_euler=(0, 0, direction - bend))
        key(front, frame, rotation_euler=(0, 0, bend))
        lift = math.radians(-27 + 44 * ease(u))
        tilt = math.radians(38 + 6 * ease(2 * u)) - lift
        crank_turn, link_turn = crank_angle(tilt)
        for obj, angle in ((arm, lift), (joint, tilt), (crank, crank_turn), (rod, link_turn)):
            key(obj, frame, rotation_euler=(0, -angle, 0))
        for wheel, side in turning:
            key(wheel, frame, rotation_euler=(0, side * rolled / WHEEL_RADIUS, 0))


def machine(paints: Paints, rocks: list[Object], rng: Rng) -> None:
    rear = empty("Loader")
    for part in (hood, rear_chassis, steps_and_rails, cab, cab_inside, cab_lamps):
        part(rear, paints)
    front = empty("FrontFrame", parent=rear)
    front_chassis(front, paints)
    mesh = wheel_mesh(paints)
    turning = wheels(rear, -AXLE, mesh, paints) + wheels(front, AXLE, mesh, paints)
    bpy.data.objects.remove(mesh)
    arm = boom(front, paints)
    joint = bucket(arm, paints)
    crank, rod = bell_crank(arm, paints)
    hydraulics(front, arm, crank, paints)
    load_bucket(joint, rocks, rng)
    animate(rear, front, arm, joint, crank, rod, turning)


# ---------------------------------------------------------------- yard


STONES = ("#8b8378", "#77726b", "#9a8f7f")


def rock_kinds(rng: Rng, codes: tuple[str, ...] = STONES) -> list[Object]:
    stone = [principled(f"Stone {code}", code, 0.9, specular=0.3) for code in codes]
    kinds = []
    for i in range(6):
        solid = Solid(f"Rock{i}")
        solid.rock(0.5, stone[i % 3], rng)
        kinds.append(solid.to_object(smooth=False))
    return kinds


def scatter(rocks: list[Object], rng: Rng, at: Point, size: float, parent: Object = None) -> None:
    rock = copy(rocks[rng.integers(len(rocks))], at, tuple(rng.uniform(0, 6.28, 3)), size)
    rock.parent = parent


def load_bucket(joint: Object, rocks: list[Object], rng: Rng) -> None:
    """A heap in the bucket, in its frame, so that it lies level when the bucket is rolled back."""
    lean = math.radians(38)
    heap = Solid("BucketHeap")

    def surface(u: float, v: float) -> tuple[float, float, float]:
        x, y = 0.2 + 1.05 * u, -1.46 + 2.92 * v
        bulge = math.sin(math.pi * v) ** 0.5 * math.sin(math.pi * u) ** 0.7
        line = 0.72 - 0.98 * u
        return x, y, line + 0.25 * bulge + 0.04 * math.sin(17 * v + 9 * u)

    heap.sheet(surface, 12, 28, rocks[1].data.materials[0])
    heap.to_object(joint, closed=False)
    for _ in range(60):
        u, v = rng.uniform(0.06, 0.94), rng.uniform(0.03, 0.97)
        sunk = Vector((math.sin(lean), 0, math.cos(lean))) * 0.02
        scatter(rocks, rng, Vector(surface(u, v)) - sunk, rng.uniform(0.12, 0.3), joint)


def gravel_pile(
    rocks: list[Object], rng: Rng, centre: Vector, radius: float, height: float, count: int
) -> None:
    bumps = noise((64, 64), 6, rng)

    def surface(u: float, v: float) -> tuple[float, float, float]:
        a, r = 2 * math.pi * u, radius * v
        lump = bumps[int(u * 63), int(v * 63)] - 0.5
        edge = 1 + 0.15 * math.sin(3 * a) + 0.1 * math.sin(5 * a + 1)
        rise = height * max(1 - v**1.15, 0) + 1.1 * lump * v * (1 - v)
        return centre.x + r * edge * math.cos(a), centre.y + r * edge * math.sin(a), rise - 0.03

    heap = Solid("GravelPile")
    heap.sheet(surface, 40, 14, rocks[0].data.materials[0])
    heap.to_object(closed=False)
    for _ in range(count):
        v = rng.uniform(0.03, 1.0) ** 0.6
        size = rng.uniform(0.15, 0.5) * (0.75 + 0.5 * v)
        scatter(rocks, rng, surface(rng.random(), min(v, 1.0)), size)
    for _ in range(count // 3):  # rolled off
        a, r = rng.uniform(0, 6.28), radius * rng.uniform(1.05, 1.6)
        size = rng.uniform(0.06, 0.22)
        scatter(
            rocks, rng, (centre.x + r * math.cos(a), centre.y + r * math.sin(a), 0.25 * size), size
        )


def ground(rng: Rng, low: str = "#6e604e", high: str = "#bca98a") -> None:
    grain = noise((512, 512), 8, rng, 6, 0.75)
    patches = noise((512, 512), 3, rng, 3)
    dirt = np.round(tinted(low, high, 0.15 + 0.6 * grain + 0.25 * (patches - 0.5)) * 63) / 63
    material = principled("Dirt", "#8a7d6b", 0.95, specular=0.2, image=packed_image("Dirt", dirt))
    plane = Solid("Ground")
    plane.add(
        [(-150, -150, 0), (150, -150, 0), (150, 150, 0), (-150, 150, 0)], [range(4)], material
    )
    plane.to_object(closed=False, uv_metres=8.0)


def puddles() -> None:
    """Still water in flat hollows, a few millimetres over the plane."""
    water = principled("Puddle", "#2f2a24", 0.05, specular=0.6)
    for x, y, size in ((3.2, -3.4, 1.0), (-2.2, -3.6, 0.7), (7.4, -1.8, 0.8), (-5.5, 4.0, 1.4)):
        ring = Solid("Puddle")
        angles = np.linspace(0, 2 * math.pi, 40, endpoint=False)
        radii = size * (1 + 0.25 * np.sin(2 * angles + x) + 0.15 * np.sin(5 * angles + y))
        shore = [
            (x + 1.5 * r * math.cos(a), y + 0.7 * r * math.sin(a), 0.005)
            for r, a in zip(radii, angles, strict=True)
        ]
        ring.add(shore, [range(40)], water)
        ring.to_object(closed=False, smooth=False)


def container(code: str) -> Object:
    """A 20-foot container, origin at the middle of its floor."""
    paint = principled(f"Container {code}", code, 0.45)
    steel = principled(f"Container Frame {code}", code, 0.5)
    solid = Solid("Container")
    ridges = 16
    for side in (-1, 1):
        y, out = 1.14 * side, 0.06 * side
        ridged = []
        for i in range(ridges):
            x = -2.9 + 5.8 * i / ridges
            ridged += [(x, y), (x + 0.08, y), (x + 0.13, y + out), (x + 0.28, y + out)]
        wall = [*ridged, (2.9, y), (2.9, y - out), (-2.9, y - out)]
        upright = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
        solid.prism(wall, (0.12, 2.48), paint, upright)
    solid.box((5.9, 2.3, 0.05), (0, 0, 2.52), paint)
    for x in (-2.98, 2.98):
        solid.box((0.05, 2.3, 2.4), (x * 0.985, 0, 1.3), paint)
        for y in (-1.15, 1.15):
            solid.box((0.16, 0.16, 2.59), (x, y, 1.295), steel)
        for y in (-0.75, -0.35, 0.35, 0.75):
            solid.cylinder(0.02, (x, y, 0.2), (x, y, 2.4), steel, 6)
        for z in (0.08, 2.51):
            solid.box((0.14, 2.3, 0.16), (x, 0, z), steel)
    for y in (-1.15, 1.15):
        for z in (0.08, 2.51):
            solid.box((5.9, 0.14, 0.16), (0, y, z), steel)
    return solid.to_object()


def containers() -> None:
    stacks = (
        ("#35566a", ((-1.2, 15.2, 0, 0.03), (5.6, 15.4, 2.6, 0.02))),
        ("#7d4436", ((5.5, 15.3, 0, -0.01), (11.9, 15.0, 0, 0.04))),
        ("#4f6b57", ((-1.4, 15.3, 2.6, -0.02), (-7.6, 15.6, 0, 0.01))),
    )
    for code, places in stacks:
        box = container(code)
        for x, y, z, turn in places:
            copy(box, (x, y, z), (0, 0, turn))
        bpy.data.objects.remove(box)


def concrete_block(concrete: Material, knobs: bool) -> Object:
    """A stacking block; only the top ones need the knobs that hold the next row."""
    block = Solid("Block")
    block.box((1.56, 0.78, 0.78), (0, 0, 0.39), concrete)
    for x in (-0.4, 0.4) if knobs else ():
        block.lathe([(0.14, 0.78), (0.11, 0.88), (0.02, 0.88)], concrete, placed((x, 0, 0)), 8)
    return block.to_object(bevel=0.04, segments=1)


def concrete_bay(corner: Vector) -> None:
    """Walls of stacked concrete blocks with knobs on two sides of a bay."""
    concrete = principled("Concrete", "#9b978f", 0.85, specular=0.3)
    plain, knobbed = concrete_block(concrete, knobs=False), concrete_block(concrete, knobs=True)
    for row in range(3):
        source = knobbed if row == 2 else plain
        for i in range(7 - row):
            copy(
                source,
                corner
                + Vector((1.6 * i + 0.8 * (row % 2), 0.02 * ((i * 7 + row) % 3), 0.785 * row)),
            )
        for i in range(4 - row):
            copy(
                source,
                corner + Vector((-0.4, -1.2 - 1.6 * i - 0.8 * (row % 2), 0.785 * row)),
                (0, 0, math.pi / 2),
            )
    for source in (plain, knobbed):
        bpy.data.objects.remove(source)


def cone_mesh() -> Object:
    orange, white = (
        principled("Cone Orange", "#e04a10", 0.45),
        principled("Cone White", "#e8e6e0", 0.4),
    )
    cone = Solid("TrafficCone")
    cone.box((0.4, 0.4, 0.04), (0, 0, 0.02), orange)
    for low, high, paint in ((0.04, 0.3, orange), (0.3, 0.45, white), (0.45, 0.7, orange)):
        radius = [0.15 - 0.17 * z for z in (low, high)]
        cone.cylinder(radius[0], (0, 0, low), (0, 0, high), paint, 20, radius[1])
    return cone.to_object()


def conifer(name: str, green: Material, rng: Rng) -> Object:
    """A fir of five ragged skirts, 9 m high."""
    tree = Solid(name)
    tree.cylinder(0.16, (0, 0, 0), (0, 0, 1.6), green, 5)
    for tier in range(5):
        low, high, wide = 1.0 + 1.5 * tier, 3.4 + 1.45 * tier, 2.1 - 0.36 * tier
        rim = []
        for i in range(11):
            a, r = (
                2 * math.pi * i / 11 + tier,
                wide * rng.uniform(0.7, 1.05) * (0.82 + 0.18 * (i % 2)),
            )
            rim.append((r * math.cos(a), r * math.sin(a), low + rng.uniform(-0.25, 0.2)))
        faces = [(i, (i + 1) % 11, 11) for i in range(11)]
        tree.add([*rim, (0, 0, high)], faces, green)
    return tree.to_object(closed=False, smooth=False)


def surroundings(rng: Rng) -> None:
    cone = cone_mesh()
    for x, y in ((4.6, 4.6), (1.9, 5.4), (-1.0, 5.9), (6.6, 3.2)):
        copy(cone, (x, y, 0), (0, 0, x))
    bpy.data.objects.remove(cone)
    leaf = [diffuse(f"Fir {code}", code) for code in ("#3d4b2f", "#465634", "#33422e")]
    trees = [conifer(f"Conifer{i}", green, rng) for i, green in enumerate(leaf)]
    for i in range(60):
        a, r = math.radians(rng.uniform(60, 215)), rng.uniform(38, 62)
        copy(
            trees[i % 3],
            (r * math.cos(a), r * math.sin(a), 0),
            (0, 0, a * 7),
            rng.uniform(0.7, 1.25),
        )
    for tree in trees:
        bpy.data.objects.remove(tree)
    hills = Solid("Hills")
    ridge = noise((256, 8), 4, rng)[:, 0]

    def surface(u: float, v: float) -> Point:
        a, r = 2 * math.pi * u, 130 * (1 + v)
        rise = 2 + 60 * max(ridge[int(u * 255)] - 0.3, 0.0)
        return r * math.cos(a), r * math.sin(a), -1 + v * rise

    hills.sheet(surface, 96, 1, diffuse("Hills", "#5c6a5a"))
    hills.to_object(closed=False)


def make() -> None:
    """Build the scene and save it with its card."""
    rng = np.random.default_rng(59)
    start(FRAMES)
    paints = Paints(rng)
    ground(rng)
    puddles()
    rocks = rock_kinds(rng)
    machine(paints, rocks, rng)
    gravel_pile(rocks, rng, Vector((-9.6, 3.6, 0)), 3.2, 2.6, 110)
    concrete_bay(Vector((-13.2, 8.0, 0)))
    containers()
    surroundings(rng)
    for rock in rocks:
        bpy.data.objects.remove(rock)
    towards = sun(33, -38, 5.0)
    sky(towards, 1.0, 0.4, "#5f93cf", "#c9d8e4", "#6e665a", seed=5)
    camera(
        [(1, (8.2, -7.2, 1.5), (0.1, 0.2, 1.6)), (FRAMES, (10.2, -5.8, 2.2), (1.5, 0.5, 2.05))],
        36,
        (0.05, 600),
    )
    save("loader", TITLE, EXERCISES, "sun")


if __name__ == "__main__":
    make()
