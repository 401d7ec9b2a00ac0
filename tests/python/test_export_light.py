"""Lights: the exported power and size against what Cycles makes of the same lamp."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import (
    add_camera,
    add_material,
    add_object,
    export_now,
    render_with_cycles,
    scene,
)
from mathutils import Vector

HEIGHT = 2.0
SUN, POINT, SPOT, RECTANGLE, ELLIPSE = range(5)


@pytest.fixture(autouse=True)
def empty_scene() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def add_light(kind: Any, **properties: Any) -> Any:
    """Add a lamp above the origin that shines down; skip where this Blender lacks a property."""
    data: Any = bpy.data.lights.new("Lamp", kind)
    for name, value in properties.items():
        if not hasattr(data, name):
            pytest.skip(f"this Blender has no {name}")
        setattr(data, name, value)
    return add_object("Lamp", data, location=(0, 0, HEIGHT))


def add_white_plate() -> None:
    """A small diffuse plate at the origin that fills the camera's view."""

    def diffuse(tree: Any) -> Any:
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = (1, 1, 1, 1)
        return node.outputs[0]

    mesh: Any = bpy.data.meshes.new("Plate")
    corners = [(-0.02, -0.02, 0), (0.02, -0.02, 0), (0.02, 0.02, 0), (-0.02, 0.02, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(add_material("White", diffuse))
    add_object("Plate", mesh)
    camera = add_camera(lens=4000, clip_start=0.01)
    camera.location = (0.5, 0, 0.2)
    camera.rotation_euler = (-Vector(camera.location)).to_track_quat("-Z", "Y").to_euler()


def irradiance(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """At the origin, facing up, from the one light above: closed forms over the contract's arrays.

    Point: intensity P / (4 pi). Area: radiance P / (pi A), times the form factor. Sun: P itself.
    """
    kind, power = arrays["light_kind"][0], arrays["light_power"][0].astype(float)
    width, depth = arrays["light_size"][0].astype(float)
    if kind == SUN:
        return power
    if kind in (POINT, SPOT):
        falloff = HEIGHT**2
        if arrays["light_soft_falloff"][0]:
            falloff += width**2
        return power / (4 * math.pi) / falloff
    if kind == RECTANGLE:
        a, b = width / 2 / HEIGHT, depth / 2 / HEIGHT
        hypot_a, hypot_b = math.hypot(1, a), math.hypot(1, b)
        sides = a / hypot_a * math.atan(b / hypot_a) + b / hypot_b * math.atan(a / hypot_b)
        return power / (width * depth) * (2 * sides / math.pi)
    assert width == depth, "the form factor of an ellipse is not elementary"
    radius = width / 2
    return power / (math.pi * radius**2) * radius**2 / (radius**2 + HEIGHT**2)


LAMPS = [
    ("SUN", {"energy": 3.0, "angle": 0.2, "color": (1, 0.5, 0.25)}),
    ("SUN", {"energy": 300.0, "angle": 0.2, "normalize": False}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.0, "color": (1, 0.5, 0.25)}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.5, "use_soft_falloff": True}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.5, "use_soft_falloff": False}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.25, "normalize": False}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.0, "normalize": False}),
    ("POINT", {"energy": 10.0, "shadow_soft_size": 0.0, "exposure": 1.5}),
    (
        "POINT",
        {"energy": 10.0, "shadow_soft_size": 0.0, "use_temperature": True, "temperature": 3000},
    ),
    ("SPOT", {"energy": 10.0, "shadow_soft_size": 0.1, "spot_size": 1.0, "spot_blend": 0.5}),
    ("AREA", {"energy": 10.0, "shape": "SQUARE", "size": 0.5}),
    ("AREA", {"energy": 10.0, "shape": "RECTANGLE", "size": 0.5, "size_y": 1.5}),
    ("AREA", {"energy": 10.0, "shape": "DISK", "size": 0.8}),
    (
        "AREA",
        {"energy": 10.0, "shape": "RECTANGLE", "size": 1.0, "size_y": 0.5, "normalize": False},
    ),
    ("AREA", {"energy": 10.0, "shape": "DISK", "size": 0.8, "normalize": False}),
]


@pytest.mark.parametrize(("kind", "properties"), LAMPS)
def test_power_is_what_cycles_makes_of_it(
    kind: str, properties: dict[str, Any], tmp_path: Path
) -> None:
    add_light(kind, **properties)
    add_white_plate()
    frame = export_now()
    assert frame.warnings == []
    # The standard error of Cycles' mean over 64 pixels of 256 stratified samples is below 0.1 %.
    measured = render_with_cycles(tmp_path, 8, samples=256)[..., :3].mean(axis=(0, 1)) * math.pi
    assert np.allclose(irradiance(frame.arrays), measured, rtol=5e-3)


@pytest.mark.parametrize("shape", ["RECTANGLE", "DISK"])
def test_an_area_light_grows_with_its_object(shape: str, tmp_path: Path) -> None:
    lamp = add_light("AREA", energy=10.0, shape=shape, size=0.5, size_y=0.25)
    lamp.scale = (2, 2, 7) if shape == "DISK" else (2, 3, 7)
    add_white_plate()
    arrays = export_now().arrays
    assert np.allclose(arrays["light_size"], [(1, 1) if shape == "DISK" else (1, 0.75)])
    rotation = arrays["world_from_light"][0, :, :3]
    assert np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
    measured = render_with_cycles(tmp_path, 8, samples=256)[..., :3].mean(axis=(0, 1)) * math.pi
    assert np.allclose(irradiance(arrays), measured, rtol=5e-3)


def test_a_point_light_does_not_grow_with_its_object() -> None:
    lamp = add_light("POINT", shadow_soft_size=0.5)
    lamp.scale = (3, 3, 3)
    add_camera()
    assert export_now().arrays["light_size"][0, 0] == 0.5


@pytest.mark.parametrize("is_visible", [True, False])
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
def test_lamps_are_seen_where_cycles_shows_them(
    kind: str, is_visible: bool, tmp_path: Path
) -> None:
    sizes = {"AREA": {"size": 1.0}, "SUN": {"angle": 0.5}}
    lamp = add_light(kind, energy=10.0, **sizes.get(kind, {"shadow_soft_size": 0.5}))
    lamp.visible_camera = is_visible
    camera = add_camera()
    camera.location, camera.rotation_euler = (0, 0, 0), (math.pi, 0, 0)
    seen = (export_now().arrays["light_visibility"] & 1).tolist()
    pixels = render_with_cycles(tmp_path, 8, samples=1)
    assert seen == [int(pixels[4, 4, 0] > 0.0)]
    assert seen == [int(is_visible)]


def test_kinds_spots_and_keys() -> None:
    add_camera()
    add_light("SPOT", spot_size=0.7, spot_blend=0.3, shadow_soft_size=0.2)
    for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        add_light("AREA", shape=shape, size=2.0, size_y=1.0)
    add_light("SUN", angle=0.1)
    arrays = export_now().arrays
    order = np.lexsort((arrays["light_size"][:, 1], arrays["light_kind"]))
    kinds, sizes = arrays["light_kind"][order].tolist(), arrays["light_size"][order]
    assert kinds == [SUN, SPOT, RECTANGLE, RECTANGLE, ELLIPSE, ELLIPSE]
    assert np.allclose(sizes, [(0.1, 0), (0.2, 0), (2, 1), (2, 2), (2, 1), (2, 2)])
    assert np.allclose(arrays["light_spot"][order][1], (0.7, 0.3))
    assert len(set(arrays["light_key"])) == 6


def emission_of(data: Any) -> Any:
    data.use_nodes = True
    return next(n for n in data.node_tree.nodes if n.bl_idname == "ShaderNodeEmission")


def test_a_lamps_nodes_scale_its_power(tmp_path: Path) -> None:
    lamp = add_light("POINT", energy=10.0, shadow_soft_size=0.0)
    node = emission_of(lamp.data)
    node.inputs["Color"].default_value = (0.5, 1, 0.25, 1)
    node.inputs["Strength"].default_value = 3.0
    add_white_plate()
    arrays = export_now().arrays
    assert np.allclose(arrays["light_power"], [(15, 30, 7.5)])
    measured = render_with_cycles(tmp_path, 8, samples=16)[..., :3].mean(axis=(0, 1)) * math.pi
    assert np.allclose(irradiance(arrays), measured, rtol=5e-3)


def test_rays_that_see_a_lamp_its_spread_and_its_last_bounce_are_handed_over() -> None:
    add_camera()
    lamp = add_light("AREA", spread=1.0, use_shadow=False)
    lamp.visible_camera, lamp.visible_glossy = True, False
    lamp.data.cycles.max_bounces = 3
    arrays = export_now().arrays
    assert arrays["light_visibility"].tolist() == [1 + 2 + 8]
    assert arrays["light_max_bounces"].tolist() == [3]
    assert arrays["light_spread"].tolist() == [1.0]


def link(lamp: Any, kind: str, things: dict[Any, str]) -> None:
    """Link a lamp to things that are included or excluded."""
    collection = bpy.data.collections.new("Linked")
    for thing in things:
        collection.objects.link(thing)
    for entry, state in zip(collection.collection_objects, things.values(), strict=True):
        entry.light_linking.link_state = state
    setattr(lamp.light_linking, f"{kind}_collection", collection)


def test_linked_lamps_name_the_sets_of_things() -> None:
    add_camera()
    mesh: Any = bpy.data.meshes.new("Triangle")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    one, two, three = (add_object(name, mesh) for name in ("One", "Two", "Three"))
    lamps = [add_light("POINT") for _ in range(4)]
    link(lamps[1], "receiver", {one: "INCLUDE", two: "INCLUDE"})
    link(lamps[2], "receiver", {one: "INCLUDE", two: "INCLUDE"})
    link(lamps[3], "receiver", {one: "EXCLUDE"})
    link(lamps[3], "blocker", {three: "INCLUDE"})
    frame = export_now()
    arrays = frame.arrays
    assert frame.warnings == []
    links = {tuple(row[:2]) for row in arrays["light_links"].tolist()}
    assert links == {(0, 0), (1, 0), (2, 1)} or links == {(0, 0), (2, 0), (1, 1)}
    pair = next(receivers for receivers, blockers in links if receivers and not blockers)
    rest = 3 - pair
    sets = (arrays[f"instance_{kind}_sets"].tolist() for kind in ("receiver", "blocker"))
    by_thing = sorted(zip(*sets, strict=True))
    expected = [(1 + 2**pair, 1), (1 + 2**pair + 2**rest, 1), (1 + 2**rest, 3)]
    assert by_thing == sorted(expected)


def test_a_portal_is_no_lamp() -> None:
    add_camera()
    add_light("AREA").data.cycles.is_portal = True
    frame = export_now()
    assert frame.warnings == []
    assert len(frame.arrays["light_kind"]) == 0


def test_a_lamp_without_size_in_space_is_left_out_by_name() -> None:
    add_camera()
    add_light("POINT").scale = (0, 0, 0)
    frame = export_now()
    assert frame.warnings == ["'Lamp': has a scale of zero and is left out"]
    assert frame.arrays["light_kind"].shape == (0,)


def test_lamps_in_collection_instances_are_exported() -> None:
    add_camera()
    collection = bpy.data.collections.new("Lamps")
    lamp = add_light("POINT")
    scene().collection.objects.unlink(lamp)
    collection.objects.link(lamp)
    for x in range(3):
        empty = add_object(f"Empty {x}", None, location=(x, 0, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
    arrays = export_now().arrays
    assert sorted(arrays["world_from_light"][:, 0, 3]) == [0, 1, 2]
    assert len(set(arrays["light_key"])) == 3


def add_nodes(lamp: Any, color_node: str) -> None:
    """Give a lamp an Emission whose colour a node computes."""
    lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    tree.links.new(tree.nodes.new(color_node).outputs[0], emission.inputs["Color"])


def test_nodes_of_lamps_become_programs() -> None:
    add_camera()
    add_nodes(add_light("POINT"), "ShaderNodeTexChecker")
    frame = export_now()
    assert frame.warnings == []
    arrays = frame.arrays
    assert arrays["light_material"].tolist() == [0]
    assert np.allclose(arrays["light_power"], 10.0)
    assert len(arrays["material_programs"]) == 1


def test_unknown_nodes_of_lamps_are_named() -> None:
    add_camera()
    add_nodes(add_light("POINT"), "ShaderNodePointInfo")
    (warning,) = export_now().warnings
    assert "Point Info in Color is not rendered yet" in warning


def test_lamps_with_constant_nodes_need_no_program() -> None:
    add_camera()
    lamp = add_light("SPOT")
    lamp.scale = (1.0, 2.0, 0.5)
    lamp.data.use_nodes = True
    frame = export_now()
    assert frame.warnings == []
    assert frame.arrays["light_material"].tolist() == [-1]
    assert np.allclose(frame.arrays["light_scale"], [(1.0, 2.0, 0.5)])
