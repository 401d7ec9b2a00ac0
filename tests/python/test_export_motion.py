"""What the export tells of motion while the shutter is open."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import RecordingCore, export_in_render, scene

KEYS = ("CONSTANT", "LINEAR", "BEZIER")


@pytest.fixture(autouse=True)
def shot() -> Any:
    """A cube and a camera that stand still, with motion blur."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.object.camera_add(location=(0.0, -7.0, 3.0), rotation=(1.2, 0.0, 0.0))
    scene().camera = bpy.context.object
    bpy.ops.mesh.primitive_cube_add()
    scene().render.use_motion_blur = True
    scene().render.motion_blur_shutter = 0.5
    return scene()


def cube() -> Any:
    return bpy.data.objects["Cube"]


def key(owner: Any, path: str, values: dict[int, Any]) -> None:
    """Linear keyframes of a property."""
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def drive(owner: Any, path: str, expression: str, index: int = -1) -> None:
    """Let a property follow the frame number."""
    owner.driver_add(path, index).driver.expression = expression


def export_frames(*frames: int) -> list[Any]:
    return export_in_render(frames)


def ways(exported: Any) -> dict[int, np.ndarray]:
    """Placements (times, 3, 4) of the instances that move."""
    arrays = exported.arrays
    spans = zip(arrays["motion_instances"], arrays["motion_spans"], strict=True)
    return {
        int(instance): arrays["motion_placements"][first : first + count]
        for instance, (first, count) in spans
    }


def test_what_stands_still_is_sent_once(shot: Any) -> None:
    with_blur = export_frames(5)[0]
    shot.render.use_motion_blur = False
    without = export_frames(5)[0]
    assert with_blur.content_hash == without.content_hash
    assert not ways(with_blur)
    assert len(with_blur.arrays["camera_motion"]) == 0
    assert with_blur.meshes[0].motion_vertices is None


@pytest.mark.parametrize(
    ("position", "shutter", "expected"),
    [
        ("CENTER", 0.5, (4.75, 5.0, 5.25)),
        ("START", 0.5, (5.0, 5.25, 5.5)),
        ("END", 1.5, (3.5, 4.25, 5.0)),
    ],
)
def test_an_object_is_looked_at_while_the_shutter_is_open(
    shot: Any, position: str, shutter: float, expected: tuple[float, ...]
) -> None:
    shot.render.motion_blur_position = position
    shot.render.motion_blur_shutter = shutter
    drive(cube(), "location", "frame", 0)
    exported = export_frames(5)[0]
    (way,) = ways(exported).values()
    assert np.allclose(way[:, 0, 3], expected, atol=1e-5)
    # Everything else is shown as it is in the middle.
    assert exported.arrays["world_from_object"][0, 0, 3] == pytest.approx(expected[1], abs=1e-5)


def test_steps_are_those_of_cycles() -> None:
    drive(cube(), "rotation_euler", "frame", 2)
    cube().cycles.motion_steps = 2
    (way,) = ways(export_frames(5)[0]).values()
    angles = 5.0 + np.linspace(-0.25, 0.25, 5)
    expected = np.array([[[cos(a), -sin(a)], [sin(a), cos(a)]] for a in angles])
    assert np.allclose(way[:, :2, :2], expected, atol=1e-5)


def test_an_object_without_motion_blur_stands_still() -> None:
    drive(cube(), "location", "frame", 0)
    cube().cycles.use_motion_blur = False
    assert not ways(export_frames(5)[0])


def test_what_an_instancer_moves_is_blurred_and_its_switch_counts() -> None:
    collection = bpy.data.collections.new("Group")
    collection.objects.link(cube())
    scene().collection.objects.unlink(cube())
    bpy.ops.object.collection_instance_add(collection="Group")
    empty: Any = bpy.context.object
    drive(empty, "location", "2 * frame", 2)
    (way,) = ways(export_frames(5)[0]).values()
    assert np.allclose(way[:, 2, 3], (9.5, 10.0, 10.5), atol=1e-5)
    empty.cycles.use_motion_blur = False
    assert not ways(export_frames(5)[0])


def test_the_camera_moves_and_zooms() -> None:
    camera = scene().camera
    drive(camera, "location", "frame", 0)
    drive(camera.data, "lens", "10 * frame")
    arrays = export_frames(5)[0].arrays
    assert np.allclose(arrays["camera_motion"][:, 0, 3], (4.75, 5.0, 5.25), atol=1e-5)
    zoom = arrays["camera_motion_clip"][:, 0, 0] / arrays["clip_from_camera"][0, 0]
    assert np.allclose(zoom, (0.95, 1.0, 1.05), atol=1e-5)
    camera.cycles.use_motion_blur = False
    assert len(export_frames(5)[0].arrays["camera_motion"]) == 0


def stretched_by_key() -> None:
    """A shape key that stretches the cube by the frame's number."""
    cube().shape_key_add(name="Basis")
    shape = cube().shape_key_add(name="Long")
    for point in shape.data:
        point.co.z *= 2.0
    shape.slider_max = 10.0
    drive(shape, "value", "frame / 10")


def test_vertices_that_a_shape_key_moves_are_sent_at_their_times() -> None:
    stretched_by_key()
    exported = export_frames(5)[0]
    (mesh,) = exported.meshes
    heights = mesh.motion_vertices[:, :, 2].max(axis=1)
    assert np.allclose(heights, (1.475, 1.5, 1.525), atol=1e-5)
    assert np.array_equal(mesh.motion_vertices[1], mesh.vertices)
    assert exported.arrays["instance_mesh"].tolist() == [0]
    assert not ways(exported)
    cube().cycles.use_deform_motion = False
    assert export_frames(5)[0].meshes[0].motion_vertices is None


def test_a_still_twin_of_what_deforms_keeps_its_mesh() -> None:
    still = cube().copy()
    still.data = cube().data.copy()
    scene().collection.objects.link(still)
    # At frame 0 the two have the same form; only one of them is leaving it.
    stretched_by_key()
    exported = export_frames(0)[0]
    moving = [mesh.motion_vertices is not None for mesh in exported.meshes]
    assert sorted(moving) == [False, True]
    assert sorted(exported.arrays["instance_mesh"].tolist()) == [0, 1]


def test_hair_moves_with_its_points() -> None:
    data: Any = bpy.data.hair_curves.new("Hair")
    data.add_curves([4] * 3)
    points = np.zeros((12, 3), np.float32)
    points[:, 2] = np.tile(np.arange(4), 3)
    points[:, 0] = np.repeat(np.arange(3), 4)
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    hair = bpy.data.objects.new("Hair", data)
    scene().collection.objects.link(hair)
    tree: Any = bpy.data.node_groups.new("Sway", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = tree.nodes, tree.links
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    shift, time = nodes.new("GeometryNodeSetPosition"), nodes.new("GeometryNodeInputSceneTime")
    offset = nodes.new("ShaderNodeCombineXYZ")
    links.new(start.outputs[0], shift.inputs["Geometry"])
    links.new(time.outputs["Frame"], offset.inputs["X"])
    links.new(offset.outputs[0], shift.inputs["Offset"])
    links.new(shift.outputs[0], end.inputs[0])
    hair.modifiers.new("Sway", "NODES").node_group = tree
    bpy.data.objects.remove(cube())
    (mesh,) = export_frames(5)[0].meshes
    moved = mesh.motion_vertices - mesh.vertices
    assert np.allclose(moved[:, :, 0], np.array([-0.25, 0.0, 0.25])[:, None], atol=1e-5)
    assert np.allclose(moved[:, :, 1:], 0.0, atol=1e-5)


def test_a_mesh_that_gains_vertices_is_not_blurred() -> None:
    array = cube().modifiers.new("Array", "ARRAY")
    drive(array, "count", "int(frame * 4)")
    exported = export_frames(5)[0]
    assert exported.meshes[0].motion_vertices is None


def test_the_curve_is_sent_where_it_is_not_even(shot: Any) -> None:
    drive(cube(), "location", "frame", 0)
    assert len(export_frames(5)[0].arrays["shutter_curve"]) == 0
    points = shot.render.motion_blur_shutter_curve.curves[0].points
    points[0].location, points[-1].location = (0.0, 0.0), (1.0, 1.0)
    for point in list(points)[1:-1]:
        points.remove(point)
    for point in points:
        point.handle_type = "VECTOR"
    shot.render.motion_blur_shutter_curve.update()
    curve = export_frames(5)[0].arrays["shutter_curve"]
    assert np.allclose(curve, (np.arange(len(curve)) + 0.5) / len(curve), atol=0.01)


def test_rolling_shutter_is_named(shot: Any) -> None:
    shot.cycles.rolling_shutter_type = "TOP"
    assert "'Scene': Rolling shutter is not rendered yet" in export_frames(5)[0].warnings


def test_a_frame_is_the_same_alone_and_among_others() -> None:
    drive(cube(), "location", "sin(frame)", 0)
    stretched_by_key()
    alone = {frame: export_frames(frame)[0].content_hash for frame in (4, 5, 6)}
    together = export_in_render((4, 5, 6), core=RecordingCore())
    assert {exported.frame: exported.content_hash for exported in together} == alone
