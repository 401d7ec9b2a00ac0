"""Lamps."""

from __future__ import annotations

from math import pi, sin
from typing import Any

import bmesh
import bpy
import numpy as np

from .rows import table
from .stage import Stage, add_node, give, matt, node_tree, output, shade

# What the stage's own lamp shines with, as a sun [W/m^2].
SUN = 2.0


def lamp(
    stage: Stage, kind: str, scale: tuple[float, ...] = (1.0, 1.0, 1.0), **values: Any
) -> None:
    """A lamp alone."""
    values.setdefault("energy", SUN if kind == "SUN" else 600.0)
    stage.only(kind, **values).scale = scale


def seen_lamp(stage: Stage, kind: str, visible: bool = True, **values: Any) -> None:
    """A lamp in the picture; the floor mirrors it."""
    lamp(stage, kind, **values)
    stage.lamp.location = (0.0, 6.0, 3.0)
    stage.lamp.rotation_euler = (-1.2, 0.0, 0.0)
    stage.lamp.visible_camera = visible
    stage.lamp.data.energy = 100.0
    give(stage.floor, glossy(0.3))


def hidden_lamp(stage: Stage, ray: str, **values: Any) -> None:
    """A lamp that one kind of ray does not see; floor and ball are glossy."""
    lamp(stage, **values)
    give(stage.floor, glossy(0.4))
    give(stage.ball, glossy(0.2))
    setattr(stage.lamp, f"visible_{ray}", False)


def glossy(roughness: float) -> Any:
    material = bpy.data.materials.new("Glossy")
    return shade(
        material, "ShaderNodeBsdfAnisotropic", Color=(0.8,) * 3 + (1.0,), Roughness=roughness
    )


def noded_lamp(stage: Stage, kind: str, **emission: Any) -> None:
    """A lamp with an Emission node of these values."""
    lamp(stage, kind)
    shade(stage.lamp.data, "ShaderNodeEmission", **emission)


def blackbody_lamp(stage: Stage, temperature: float) -> None:
    lamp(stage, "AREA")
    tree = node_tree(stage.lamp.data)
    color = add_node(tree, "ShaderNodeBlackbody", Temperature=temperature)
    emission = add_node(tree, "ShaderNodeEmission", Color=color.outputs[0], Strength=1.0)
    tree.links.new(emission.outputs[0], output(tree).inputs[0])


def falloff_lamp(stage: Stage, output_name: str, strength: float) -> None:
    lamp(stage, "POINT", shadow_soft_size=0.1)
    tree = node_tree(stage.lamp.data)
    falloff = add_node(tree, "ShaderNodeLightFalloff", Strength=strength)
    emission = add_node(tree, "ShaderNodeEmission", Strength=falloff.outputs[output_name])
    tree.links.new(emission.outputs[0], output(tree).inputs[0])


def patterned_lamp(stage: Stage, kind: str, coordinate: str, scale: float, **values: Any) -> None:
    """A lamp that shines as a checker over one of its coordinates."""
    lamp(stage, kind, **values)
    tree = node_tree(stage.lamp.data)
    place = add_node(tree, "ShaderNodeTexCoord")
    pattern = add_node(tree, "ShaderNodeTexChecker", Vector=place.outputs[coordinate], Scale=scale)
    emission = add_node(tree, "ShaderNodeEmission", Color=pattern.outputs["Color"], Strength=1.0)
    tree.links.new(emission.outputs[0], output(tree).inputs[0])


def gobo(stage: Stage) -> None:
    """A spot that shines through a pattern."""
    lamp(stage, "SPOT", shadow_soft_size=0.0, spot_size=1.0)
    tree = node_tree(stage.lamp.data)
    place = add_node(tree, "ShaderNodeTexCoord")
    pattern = add_node(tree, "ShaderNodeTexChecker", Vector=place.outputs["Normal"], Scale=12.0)
    emission = add_node(tree, "ShaderNodeEmission", Color=pattern.outputs["Color"], Strength=1.0)
    tree.links.new(emission.outputs[0], output(tree).inputs[0])


def ies_lamp(stage: Stage, kind: int, around: list[float], polar: list[float]) -> None:
    """A lamp that shines as an IES file of this photometric type and these angles says."""
    lamp(stage, "POINT", shadow_soft_size=0.05, energy=10.0)
    strengths = [
        f"{700.0 + 500.0 * sin(3.0 * p * pi / 180.0) + 150.0 * sin(2.0 * a * pi / 180.0):.1f}"
        for a in around
        for p in polar
    ]
    lines = [
        "IESNA:LM-63-2002",
        "TILT=NONE",
        f"1 1000 1.5 {len(polar)} {len(around)} {kind} 2 0 0 0",
        "1.0 1.0 50",
        *(" ".join(map(str, angles)) for angles in (polar, around, strengths)),
    ]
    file: Any = bpy.data.texts.new("Lamp.ies")
    file.write("\n".join(lines) + "\n")
    tree = node_tree(stage.lamp.data)
    texture = add_node(tree, "ShaderNodeTexIES", mode="INTERNAL", ies=file, Strength=1.0)
    emission = add_node(tree, "ShaderNodeEmission", Strength=texture.outputs[0])
    tree.links.new(emission.outputs[0], output(tree).inputs[0])


def linked_glow(stage: Stage, kind: str, state: str = "INCLUDE") -> None:
    """A glowing disk that lights, or is shadowed by, the ball alone or all but the ball."""
    lamp(stage, "POINT", energy=0.0)
    bpy.ops.mesh.primitive_circle_add(radius=0.4, fill_type="NGON", location=(2.0, -2.0, 3.5))
    disk: Any = bpy.context.object
    disk.rotation_euler = stage.lamp.rotation_euler
    material = bpy.data.materials.new("Glow")
    give(disk, shade(material, "ShaderNodeEmission", Strength=60.0))
    link_ball(stage, disk, kind, state)


def linked_lamp(stage: Stage, kind: str, state: str = "INCLUDE") -> None:
    """A lamp that lights, or is shadowed by, the ball alone or all but the ball."""
    lamp(stage, "AREA", size=0.5)
    link_ball(stage, stage.lamp, kind, state)


def link_ball(stage: Stage, light: Any, kind: str, state: str) -> None:
    collection = bpy.data.collections.new("Linked")
    collection.objects.link(stage.ball)
    setattr(light.light_linking, f"{kind}_collection", collection)
    collection.collection_objects[0].light_linking.link_state = state


def many_lamps(stage: Stage, count: int, radius: float) -> None:
    """Small lamps of all colours in a square above the stage."""
    lamp(stage, "POINT", energy=1.0)
    side = round(count**0.5)
    for i in range(side * side):
        x, y = (12.0 * ((k + 0.5) / side - 0.5) for k in divmod(i, side))
        color = tuple(0.5 + 0.5 * sin(i * k) for k in (1.0, 2.3, 4.1))
        stage.add_lamp(
            "POINT",
            (x, y, 0.3 + 0.2 * sin(i)),
            color=color,
            energy=1500.0 / count,
            shadow_soft_size=radius,
        )


def glowing_ball(stage: Stage, strength: float) -> None:
    lamp(stage, "POINT", energy=0.0)
    material = bpy.data.materials.new("Glow")
    give(stage.ball, shade(material, "ShaderNodeEmission", Strength=strength))


def glowing_windows(stage: Stage, count: int, side: float, height: float) -> None:
    """One mesh of squares that shine down, in rows above the stage."""
    lamp(stage, "POINT", energy=0.0)
    rows = round(count**0.5)
    around = 0.5 * side * np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)])
    middles = np.stack(np.meshgrid(*[np.arange(rows) - 0.5 * (rows - 1)] * 2), -1).reshape(-1, 1, 2)
    flat = (around + middles * max(1.0, 12.0 / rows)).reshape(-1, 2)
    vertices = np.column_stack([flat, np.full(len(flat), height)])
    mesh: Any = bpy.data.meshes.new("Windows")
    mesh.from_pydata(vertices.tolist(), [], np.arange(len(flat)).reshape(-1, 4).tolist())
    windows = bpy.data.objects.new("Windows", mesh)
    stage.scene.collection.objects.link(windows)
    strength = 100.0 / (count * side * side)
    give(windows, shade(bpy.data.materials.new("Glow"), "ShaderNodeEmission", Strength=strength))


def portal(stage: Stage) -> None:
    """A room with a window, the portal in it."""
    stage.clear()
    bpy.ops.mesh.primitive_cube_add(size=10.0, location=(0.0, 0.0, 4.0))
    room: Any = bpy.context.object
    give(room, matt((0.7, 0.7, 0.7)))
    form = bmesh.new()
    form.from_mesh(room.data)
    wall = next(face for face in form.faces if face.normal.y > 0.5)
    bmesh.ops.inset_region(form, faces=[wall], thickness=4.0)
    form.faces.remove(wall)
    form.to_mesh(room.data)
    stage.only("AREA", shape="RECTANGLE", size=2.0, size_y=2.0)
    stage.lamp.data.cycles.is_portal = True
    stage.lamp.location, stage.lamp.rotation_euler = (0.0, 4.9, 4.0), (-pi / 2, 0.0, 0.0)
    stage.camera.location, stage.camera.rotation_euler = (0.0, -4.5, 3.0), (pi / 2, 0.0, 0.0)
    shade(stage.scene.world, "ShaderNodeBackground", Strength=3.0)


ROWS = table(
    "light",
    ("point, radius 0", lamp, {"kind": "POINT", "shadow_soft_size": 0.0}),
    ("point, radius 0.5 m", lamp, {"kind": "POINT", "shadow_soft_size": 0.5}),
    ("point, no soft falloff", lamp, {"kind": "POINT", "shadow_soft_size": 0.5, "use_soft_falloff": False}),
    ("spot, blend 0", lamp, {"kind": "SPOT", "spot_blend": 0.0, "shadow_soft_size": 0.0}),
    ("spot, blend 1", lamp, {"kind": "SPOT", "spot_blend": 1.0, "shadow_soft_size": 0.1}),
    ("spot, radius 0.5 m", lamp, {"kind": "SPOT", "spot_size": 0.6, "shadow_soft_size": 0.5}),
    ("spot, 170 degrees", lamp, {"kind": "SPOT", "spot_size": 2.967, "shadow_soft_size": 0.2}),
    ("spot, scaled", lamp, {"kind": "SPOT", "spot_size": 0.6, "shadow_soft_size": 0.1, "scale": (1.0, 2.0, 1.0)}),
    ("area, square 2 m", lamp, {"kind": "AREA", "size": 2.0}),
    ("area, rectangle", lamp, {"kind": "AREA", "shape": "RECTANGLE", "size": 3.0, "size_y": 0.2}),
    ("area, disk", lamp, {"kind": "AREA", "shape": "DISK", "size": 2.0}),
    ("area, ellipse", lamp, {"kind": "AREA", "shape": "ELLIPSE", "size": 3.0, "size_y": 1.0}),
    ("area, scaled", lamp, {"kind": "AREA", "size": 1.0, "scale": (2.0, 0.5, 1.0)}),
    ("area, spread 120 degrees", lamp, {"kind": "AREA", "size": 1.0, "spread": 2.094}),
    ("area, spread 60 degrees", lamp, {"kind": "AREA", "size": 1.0, "spread": 1.047}),
    ("area, spread 20 degrees", lamp, {"kind": "AREA", "size": 1.0, "spread": 0.349}),
    ("area, spread 2 degrees", lamp, {"kind": "AREA", "size": 2.0, "spread": 0.035}),
    ("area, disk, spread 60 degrees", lamp, {"kind": "AREA", "shape": "DISK", "size": 1.0, "spread": 1.047}),
    ("sun, angle 0", lamp, {"kind": "SUN", "angle": 0.0}),
    ("sun, angle 10 degrees", lamp, {"kind": "SUN", "angle": 0.1745}),
    ("sun, angle 120 degrees", lamp, {"kind": "SUN", "angle": 2.094}),
    ("sun, angle 180 degrees", lamp, {"kind": "SUN", "angle": pi}),
    ("colour", lamp, {"kind": "POINT", "color": (1.0, 0.3, 0.05)}),
    ("temperature 3000 K", lamp, {"kind": "POINT", "use_temperature": True, "temperature": 3000.0}),
    ("exposure 1", lamp, {"kind": "POINT", "exposure": 1.0, "energy": 300.0}),
    ("area, not normalised", lamp, {"kind": "AREA", "size": 2.0, "normalize": False, "energy": 150.0}),
    ("point, not normalised", lamp, {"kind": "POINT", "shadow_soft_size": 0.3, "normalize": False, "energy": 300.0}),
    ("sun, not normalised", lamp, {"kind": "SUN", "angle": 0.5, "normalize": False, "energy": 10.0}),
    ("point, seen", seen_lamp, {"kind": "POINT", "shadow_soft_size": 0.7}),
    ("area, seen", seen_lamp, {"kind": "AREA", "size": 1.5}),
    ("area with spread, seen", seen_lamp, {"kind": "AREA", "size": 1.5, "spread": 1.5}),
    ("spot, seen", seen_lamp, {"kind": "SPOT", "shadow_soft_size": 0.5, "spot_size": 2.0}),
    ("area, hidden from the camera", seen_lamp, {"kind": "AREA", "size": 1.5, "visible": False}),
    ("hidden from diffuse rays", hidden_lamp, {"kind": "AREA", "size": 2.0, "ray": "diffuse"}),
    ("hidden from glossy rays", hidden_lamp, {"kind": "AREA", "size": 2.0, "ray": "glossy"}),
    ("hidden from transmission rays", hidden_lamp, {"kind": "POINT", "ray": "transmission"}),
    ("no shadow", lamp, {"kind": "AREA", "size": 1.0, "use_shadow": False}),
    ("node: strength and colour", noded_lamp, {"kind": "AREA", "Strength": 2.5, "Color": (1.0, 0.5, 0.2, 1.0)}),
    ("node: blackbody", blackbody_lamp, {"temperature": 3500.0}),
    ("node: light falloff, linear", falloff_lamp, {"output_name": "Linear", "strength": 0.2}),
    ("node: pattern", gobo),
    ("node: spot, UV", patterned_lamp, {"kind": "SPOT", "coordinate": "UV", "scale": 6.0, "shadow_soft_size": 0.0, "spot_size": 1.0}),
    ("node: point, UV", patterned_lamp, {"kind": "POINT", "coordinate": "UV", "scale": 16.0, "shadow_soft_size": 0.1}),
    ("node: ball, normal", patterned_lamp, {"kind": "POINT", "coordinate": "Normal", "scale": 8.0, "shadow_soft_size": 0.5, "use_soft_falloff": False}),
    ("node: area, UV", patterned_lamp, {"kind": "AREA", "coordinate": "UV", "scale": 2.0, "size": 3.0}),
    ("node: area, generated", patterned_lamp, {"kind": "AREA", "coordinate": "Generated", "scale": 1.5, "size": 3.0}),
    ("node: IES, type C, a quadrant", ies_lamp, {"kind": 1, "around": [0.0, 30.0, 60.0, 90.0], "polar": [0.0, 20.0, 45.0, 70.0, 90.0]}),
    ("node: IES, type C, one plane", ies_lamp, {"kind": 1, "around": [0.0], "polar": [0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0]}),
    ("node: IES, type B", ies_lamp, {"kind": 2, "around": [0.0, 30.0, 60.0, 90.0], "polar": [-90.0, -45.0, 0.0, 45.0, 90.0]}),
    ("node: IES, type A", ies_lamp, {"kind": 3, "around": [-90.0, -30.0, 30.0, 90.0], "polar": [-90.0, -45.0, 0.0, 45.0, 90.0]}),
    ("linking: lights the ball alone", linked_lamp, {"kind": "receiver"}),
    ("linking: lights all but the ball", linked_lamp, {"kind": "receiver", "state": "EXCLUDE"}),
    ("linking: shadow of all but the ball", linked_lamp, {"kind": "blocker", "state": "EXCLUDE"}),
    ("linking: glow lights the ball alone", linked_glow, {"kind": "receiver"}),
    ("linking: glow lights all but the ball", linked_glow, {"kind": "receiver", "state": "EXCLUDE"}),
    ("linking: shadow of a glow by all but the ball", linked_glow, {"kind": "blocker", "state": "EXCLUDE"}),
    ("100 lamps", many_lamps, {"count": 100, "radius": 0.05}),
    ("1024 lamps", many_lamps, {"count": 1024, "radius": 0.0}),
    ("glowing ball", glowing_ball, {"strength": 5.0}),
    ("glowing ceiling", glowing_windows, {"count": 1, "side": 7.0, "height": 3.0}),
    ("glowing windows, 400 in a mesh", glowing_windows, {"count": 400, "side": 0.1, "height": 2.5}),
    ("portal", portal),
)  # fmt: skip


def bounded_lamp(stage: Stage, bounces: int) -> None:
    lamp(stage, "AREA", size=1.0)
    stage.lamp.data.cycles.max_bounces = bounces


ROWS += table(
    "light",
    ("point, below zero", lamp, {"kind": "POINT", "energy": -100.0, "shadow_soft_size": 0.3}),
    ("area, below zero", lamp, {"kind": "AREA", "energy": -100.0, "size": 1.0}),
    ("sun, below zero", lamp, {"kind": "SUN", "energy": -0.3, "angle": 0.1}),
    ("max bounces 0", bounded_lamp, {"bounces": 0}),
    ("max bounces 1", bounded_lamp, {"bounces": 1}),
)
