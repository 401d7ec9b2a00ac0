"""One small scene for each way in which sharing samples may fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

Point = tuple[float, float, float]
Color = tuple[float, float, float]
GREY: Color = (0.6, 0.6, 0.6)


def material(name: str, color: Color, roughness: float = 1.0, metallic: float = 0.0) -> Any:
    """A Principled material; without a highlight where it is fully rough."""
    made: Any = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Roughness"].default_value = roughness
    inputs["Metallic"].default_value = metallic
    inputs["Specular IOR Level"].default_value = 0.0 if roughness == 1.0 else 0.5
    return made


def solid(name: str, vertices: Sequence[Point], faces: Sequence[Sequence[int]], look: Any) -> Any:
    """An object made of a mesh."""
    mesh: Any = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(look)
    made: Any = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def box(name: str, low: Point, high: Point, look: Any) -> Any:
    """A box with its sides along the axes."""
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    ends = (low, high)
    vertices = [(ends[x][0], ends[y][1], ends[z][2]) for x, y, z in corners]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return solid(name, vertices, faces, look)


def floor(size: float = 10.0, look: Any = None) -> Any:
    """A square at z = 0."""
    corners = [(-size, -size, 0.0), (size, -size, 0.0), (size, size, 0.0), (-size, size, 0.0)]
    return solid("Floor", corners, [(0, 1, 2, 3)], look or material("Floor", GREY))


def ball(name: str, center: Point, radius: float, look: Any) -> Any:
    """A smooth sphere."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=radius, location=center)
    bpy.ops.object.shade_smooth()
    made: Any = bpy.context.object
    made.data.materials.append(look)
    return made


def sky(radiance: float) -> None:
    """A world of one grey."""
    world: Any = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    background = world.node_tree.nodes["Background"].inputs["Color"]
    background.default_value = (radiance, radiance, radiance, 1.0)
    bpy.context.scene.world = world


def lamp(kind: str, at: Point, energy: float, size: float, turn: Point = (0, 0, 0)) -> Any:
    """A lamp; `size` is a sun's angle [rad], a point's radius or an area's side [m]."""
    data: Any = bpy.data.lights.new(kind, kind)
    data.energy = energy
    setattr(data, {"SUN": "angle", "AREA": "size"}.get(kind, "shadow_soft_size"), size)
    made: Any = bpy.data.objects.new(kind, data)
    made.location, made.rotation_euler = at, turn
    bpy.context.scene.collection.objects.link(made)
    return made


def camera(at: Point, target: Point, lens: float = 35.0) -> Any:
    """The scene's camera, looking at a point."""
    made: Any = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.data.lens = lens
    made.location = at
    made.rotation_euler = (Vector(target) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made
    return made


def move(thing: Any, path: str, keys: Sequence[tuple[int, Point]]) -> None:
    """Key a property at frames, with straight lines between."""
    for frame, value in keys:
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)
    action = thing.animation_data.action
    curves = getattr(action, "fcurves", None)
    if curves is None:  # Blender 5: layers, strips and channel bags.
        curves = action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def contact() -> None:
    """A box and a ball stand on a floor under a sky and a window of light."""
    sky(0.3)
    floor()
    box("Box", (-1.4, -0.5, 0.0), (-0.4, 0.5, 1.0), material("Box", (0.7, 0.5, 0.3)))
    ball("Ball", (0.9, 0.0, 0.6), 0.6, material("Ball", (0.4, 0.5, 0.7)))
    lamp("AREA", (3.0, -2.0, 4.0), 200.0, 1.0, (0.6, 0.5, 0.0))
    camera((0.0, -5.5, 2.6), (0.0, 0.0, 0.4))


def sun_and_sky() -> None:
    """Columns in the light of a sun alone, or of a sky with a bright patch alone."""
    floor()
    stone = material("Stone", (0.7, 0.7, 0.65))
    for x in (-2.0, 0.0, 2.0):
        box(f"Column {x}", (x - 0.2, -0.2, 0.0), (x + 0.2, 0.2, 2.5), stone)
    camera((0.0, -8.0, 3.0), (0.0, 0.0, 1.0))


def sun_alone() -> None:
    """The columns in the sun."""
    sun_and_sky()
    sky(0.0)
    lamp("SUN", (0, 0, 5), 3.0, 0.01, (0.7, 0.3, 0.0))


def bright_patch() -> None:
    """The columns under an image whose brightest texels are 200 times its mean."""
    sun_and_sky()
    sky(1.0)
    pixels = np.full((32, 64, 4), 0.2, np.float32)
    pixels[24:26, 40:43, :3] = 60.0
    pixels[..., 3] = 1.0
    image: Any = bpy.data.images.new("Patch", 64, 32, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    tree: Any = bpy.context.scene.world.node_tree
    node: Any = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def many_lamps() -> None:
    """A hundred small lamps over columns."""
    sun_and_sky()
    sky(0.0)
    for index in range(100):
        x, y = index % 10 - 4.5, index // 10 - 4.5
        lamp("POINT", (x, y, 3.0), 4.0, 0.03)


def glossy_ramp() -> None:
    """Metal balls from a near mirror to matt; the camera moves past them."""
    sky(0.4)
    floor()
    for index, roughness in enumerate((0.05, 0.2, 0.35, 0.5, 0.65, 0.8)):
        look = material(f"Metal {roughness}", (0.9, 0.8, 0.6), roughness, 1.0)
        ball(f"Ball {roughness}", (index * 0.9 - 2.25, 0.0, 0.4), 0.4, look)
    lamp("AREA", (0.0, -3.0, 4.0), 150.0, 1.5, (0.6, 0.0, 0.0))
    eye = camera((-0.4, -6.0, 1.6), (-0.4, 0.0, 0.4))
    move(eye, "location", [(1, (-0.6, -6.0, 1.6)), (5, (0.6, -6.0, 1.6))])


def checker() -> None:
    """A wall of squares about as large as pixels: what is copied between them shows."""
    sky(0.8)
    dark, light = material("Dark", (0.05, 0.05, 0.05)), material("Light", (0.9, 0.9, 0.9))
    count, side = 32, 0.125
    for parity, look in ((0, dark), (1, light)):
        cells = [(x, z) for x in range(count) for z in range(count // 2) if (x + z) % 2 == parity]
        corners = [
            ((x + dx) * side - 2.0, 0.0, (z + dz) * side)
            for x, z in cells
            for dx, dz in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        faces = [range(4 * i, 4 * i + 4) for i in range(len(cells))]
        solid(f"Squares {parity}", corners, faces, look)
    camera((0.0, -4.0, 1.0), (0.0, 0.0, 1.0))


def thicket() -> None:
    """Thin blades and beams over a floor, in sun and sky."""
    sky(0.5)
    floor()
    lamp("SUN", (0, 0, 5), 2.0, 0.02, (0.6, 0.4, 0.0))
    random = np.random.default_rng(1)
    starts = random.uniform((-2.5, -2.0, 0.0), (2.5, 2.5, 0.0), (300, 3))
    leans = random.uniform((-0.4, -0.4, 0.6), (0.4, 0.4, 1.6), (300, 3))
    vertices: list[Point] = []
    for start, lean in zip(starts, leans, strict=True):
        across = np.cross(lean, (0.3, 1.0, 0.1))
        across *= 0.02 / np.linalg.norm(across)
        end = start + lean
        for x, y, z in (start - across, start + across, end):
            vertices.append((float(x), float(y), float(z)))
    faces = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(starts))]
    solid("Blades", vertices, faces, material("Blade", (0.2, 0.5, 0.1)))
    camera((0.0, -5.0, 1.8), (0.0, 0.0, 0.6))


def thin_wall() -> None:
    """A wall of 1 mm between a bright room and a dark one, both in view."""
    sky(0.0)
    white = material("White", (0.8, 0.8, 0.8))
    floor(3.0, white)
    box("Wall", (-0.0005, -3.0, 0.0), (0.0005, 3.0, 2.0), white)
    box("Lid", (-3.0, -3.0, 2.0), (0.0, 3.0, 2.1), white)
    box("Back", (-3.0, 2.9, 0.0), (3.0, 3.0, 2.0), white)
    box("End", (-3.0, -3.0, 0.0), (-2.9, 3.0, 2.0), white)
    lamp("AREA", (1.5, 0.0, 1.9), 100.0, 1.0)
    camera((0.0, -2.9, 1.0), (0.0, 0.0, 0.6), 20.0)


def whip_pan() -> None:
    """The camera turns by most of its view from frame to frame."""
    contact()
    eye: Any = bpy.context.scene.camera
    turn = tuple(eye.rotation_euler)
    keys = [(frame, (turn[0], turn[1], turn[2] + 0.5 * (frame - 3))) for frame in range(1, 6)]
    move(eye, "rotation_euler", keys)


def fan() -> None:
    """Blades turn fast in front of a wall."""
    sky(0.5)
    floor()
    box("Wall", (-4.0, 1.5, 0.0), (4.0, 1.6, 4.0), material("Wall", (0.8, 0.3, 0.2)))
    white = material("White", (0.8, 0.8, 0.8))
    vertices: list[Point] = []
    for blade in range(3):
        for angle, radius in ((-0.25, 1.2), (0.25, 1.2), (0.0, 0.1)):
            turn = angle + blade * math.tau / 3
            vertices.append((radius * math.cos(turn), 0.0, radius * math.sin(turn)))
    blades = solid("Fan", vertices, [(0, 1, 2), (3, 4, 5), (6, 7, 8)], white)
    blades.location = (0.0, 0.0, 1.4)
    keys = [(1, (0.0, 0.0, 0.0)), (5, (0.0, 4 * 0.6, 0.0))]
    move(blades, "rotation_euler", keys)
    lamp("AREA", (2.0, -3.0, 4.0), 200.0, 1.0, (0.8, 0.4, 0.0))
    camera((0.0, -5.0, 1.5), (0.0, 0.0, 1.3))


def blurred_fan() -> None:
    """The fan turns three times as fast, before a camera that pans, with motion blur."""
    fan()
    scene: Any = bpy.context.scene
    move(bpy.data.objects["Fan"], "rotation_euler", [(1, (0, 0, 0)), (5, (0, 4 * 1.8, 0))])
    turn = tuple(scene.camera.rotation_euler)
    keys = [(frame, (turn[0], turn[1], turn[2] + 0.08 * (frame - 3))) for frame in (1, 5)]
    move(scene.camera, "rotation_euler", keys)
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 0.8


def hard_cut() -> None:
    """The camera jumps to the other side of a coloured wall at frame 3."""
    contact()
    box("Screen", (-4.0, 1.5, 0.0), (4.0, 1.6, 3.0), material("Screen", (0.8, 0.1, 0.1)))
    eye: Any = bpy.context.scene.camera
    keys = [(2, (0.0, -5.5, 2.6)), (3, (0.0, 7.0, 1.0)), (5, (0.0, 7.0, 1.0))]
    move(eye, "location", keys)
    back = (Vector((0.0, 1.6, 1.0)) - Vector((0.0, 7.0, 1.0))).to_track_quat("-Z", "Y").to_euler()
    front = tuple(eye.rotation_euler)
    move(eye, "rotation_euler", [(2, front), (3, tuple(back)), (5, tuple(back))])


def moving_sun() -> None:
    """A sun moves behind blinds; their stripes wander over the floor."""
    sky(0.05)
    floor()
    wood = material("Wood", (0.5, 0.4, 0.3))
    for index in range(10):
        x = index * 0.5 - 2.5
        box(f"Slat {index}", (x, -2.0, 2.0), (x + 0.25, 2.0, 2.02), wood)
    sun = lamp("SUN", (0, 0, 5), 3.0, 0.01)
    keys = [(frame, (0.1, 0.06 * (frame - 5), 0.0)) for frame in range(1, 10)]
    move(sun, "rotation_euler", keys)
    camera((0.0, -4.5, 1.4), (0.0, 0.0, 0.2))


def fireflies() -> None:
    """A small, bright panel that no light sampling finds through a mirror."""
    sky(0.1)
    floor()
    box("Mirror", (-1.5, 0.8, 0.0), (1.5, 0.9, 1.5), material("Mirror", (0.9, 0.9, 0.9), 0.1, 1.0))
    lamp("AREA", (0.0, -1.5, 1.5), 60.0, 0.15, (1.2, 0.0, 0.0))
    camera((0.5, -5.0, 2.0), (0.0, 0.0, 0.4))


def room() -> None:
    """A closed room with a window: nearly all of its light is indirect."""
    sky(3.0)
    white = material("White", (0.75, 0.75, 0.75))
    box("Floor", (-2.0, -2.0, -0.1), (2.0, 2.0, 0.0), white)
    box("Lid", (-2.0, -2.0, 2.0), (2.0, 2.0, 2.1), white)
    box("Back", (-2.0, 1.9, 0.0), (2.0, 2.0, 2.0), material("Red", (0.7, 0.2, 0.2)))
    box("Front", (-2.0, -2.0, 0.0), (2.0, -1.9, 2.0), white)
    box("Right", (1.9, -2.0, 0.0), (2.0, 2.0, 2.0), white)
    box("Left low", (-2.0, -2.0, 0.0), (-1.9, 2.0, 0.7), white)
    box("Left high", (-2.0, -2.0, 1.4), (-1.9, 2.0, 2.0), white)
    ball("Ball", (0.2, 0.4, 0.4), 0.4, material("Ball", (0.3, 0.5, 0.7)))
    camera((0.9, -1.8, 1.2), (-0.2, 0.6, 0.6), 22.0)


Build = Callable[[], None]
