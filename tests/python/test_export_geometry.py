"""Exported meshes and instances against USD files that Blender writes and pxr reads."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from addon.export.random_number import number_of_name
from export_oracle import (
    RecordingCore,
    add_camera,
    add_material,
    add_mesh,
    add_object,
    add_primitive,
    animate,
    assert_same_meshes,
    contract_table,
    export,
    export_in_render,
    export_now,
    placed_meshes,
    scene,
    textured_diffuse,
    usd_meshes,
    write_usd,
)
from mathutils import Matrix

import dualcone

FRAMES = (1, 4, 7)


@pytest.fixture(autouse=True)
def camera() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return add_camera()


def assert_agrees_with_usd(folder: Path) -> list[Any]:
    """Export and write to USD, then compare each frame."""
    exported = export_in_render(FRAMES)
    path = folder / "oracle.usdc"
    write_usd(path, FRAMES)
    for frame in exported:
        ours, oracle = placed_meshes(frame), usd_meshes(path, frame.frame)
        assert ours, "nothing was exported"
        assert_same_meshes(ours, oracle)
    return exported


def points_move(exported: list[Any]) -> bool:
    """Whether the frames show different points, so that comparing them means something."""
    first, last = placed_meshes(exported[0]), placed_meshes(exported[-1])
    return any(not np.allclose(a.points, b.points) for a, b in zip(first, last, strict=True))


def test_objects_move_and_turn_with_their_parents(tmp_path: Path) -> None:
    parent = add_object("Parent", None, scale=(1, 2, 0.5))
    child = add_mesh()
    child.parent = parent
    animate(parent, "rotation_euler", {1: 0.0, 7: 1.5}, index=2)
    animate(child, "location", {1: 0.0, 7: 3.0}, index=0)
    assert points_move(assert_agrees_with_usd(tmp_path))


def test_modifiers_deform_and_change_topology(tmp_path: Path) -> None:
    owner = add_primitive("cube", "Cube")
    wave = owner.modifiers.new("Wave", "WAVE")
    wave.time_offset = -20
    array = owner.modifiers.new("Array", "ARRAY")
    animate(owner, 'modifiers["Array"].count', {1: 1, 7: 4})
    assert array.count
    bevel = owner.modifiers.new("Bevel", "BEVEL")
    bevel.width = 0.1
    subdivision = owner.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 1
    exported = assert_agrees_with_usd(tmp_path)
    assert len(exported[0].meshes[0].vertices) < len(exported[-1].meshes[0].vertices)


def test_an_armature_bends_its_mesh(tmp_path: Path) -> None:
    armature = bpy.data.armatures.new("Armature")
    rig = add_object("Rig", armature)
    scene().view_layers[0].objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, low, high in (("Lower", 0, 1), ("Upper", 1, 2)):
        bone = armature.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, low), (0, 0, high)
        bone.parent = armature.edit_bones.get("Lower") if name == "Upper" else None
    bpy.ops.object.mode_set(mode="OBJECT")
    owner = add_primitive("cylinder", "Arm", vertices=8, depth=2, location=(0, 0, 1))
    owner.vertex_groups.new(name="Lower").add([0, 2, 4, 6, 8, 10, 12, 14], 1.0, "REPLACE")
    owner.vertex_groups.new(name="Upper").add([1, 3, 5, 7, 9, 11, 13, 15], 1.0, "REPLACE")
    owner.modifiers.new("Armature", "ARMATURE").object = rig
    bone = rig.pose.bones["Upper"]
    bone.rotation_mode = "XYZ"
    animate(rig, 'pose.bones["Upper"].rotation_euler', {1: 0.0, 7: 1.2}, index=0)
    assert points_move(assert_agrees_with_usd(tmp_path))


def test_shape_keys_morph(tmp_path: Path) -> None:
    owner = add_mesh()
    owner.shape_key_add(name="Basis")
    key = owner.shape_key_add(name="Up")
    key.data[0].co.z = 2.0
    for frame, value in ((1, 0.0), (7, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    assert points_move(assert_agrees_with_usd(tmp_path))


def node_group() -> tuple[Any, Any, Any]:
    """A geometry node group with a geometry input and output: tree, input node, output node."""
    tree: Any = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def test_geometry_nodes_deform_by_scene_time(tmp_path: Path) -> None:
    owner = add_mesh()
    tree, source, output = node_group()
    time = tree.nodes.new("GeometryNodeInputSceneTime")
    move = tree.nodes.new("GeometryNodeSetPosition")
    tree.links.new(time.outputs["Seconds"], move.inputs["Offset"])
    tree.links.new(source.outputs[0], move.inputs["Geometry"])
    tree.links.new(move.outputs[0], output.inputs[0])
    owner.modifiers.new("Nodes", "NODES").node_group = tree
    assert points_move(assert_agrees_with_usd(tmp_path))


def instance_on_points(instance: Callable[[Any], Any]) -> tuple[Any, Any]:
    """A mesh with an instance on each of its points and on itself: its tree, its output node."""
    owner = add_mesh()
    tree, source, output = node_group()
    place = tree.nodes.new("GeometryNodeInstanceOnPoints")
    join = tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(source.outputs[0], place.inputs["Points"])
    tree.links.new(instance(tree), place.inputs["Instance"])
    tree.links.new(place.outputs[0], join.inputs[0])
    tree.links.new(source.outputs[0], join.inputs[0])
    tree.links.new(join.outputs[0], output.inputs[0])
    owner.modifiers.new("Nodes", "NODES").node_group = tree
    animate(owner, "location", {1: 0.0, 7: 3.0}, index=2)
    return tree, output


def test_geometry_nodes_instances_of_an_object(tmp_path: Path) -> None:
    shape = add_primitive("cone", "Shape", vertices=5)
    shape.hide_render = True

    def instance(tree: Any) -> Any:
        info = tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value = shape
        info.inputs["As Instance"].default_value = True
        return info.outputs["Geometry"]

    instance_on_points(instance)
    exported = assert_agrees_with_usd(tmp_path)
    assert len(exported[0].meshes) == 2
    assert len(exported[0].arrays["instance_mesh"]) == 6


def test_geometry_nodes_instances_of_a_generated_mesh(tmp_path: Path) -> None:
    """Blender writes the wrong mesh to USD here: the oracle is what Realize Instances makes."""
    tree, output = instance_on_points(
        lambda tree: tree.nodes.new("GeometryNodeMeshCube").outputs[0]
    )
    exported = export_in_render(FRAMES)
    realize = tree.nodes.new("GeometryNodeRealizeInstances")
    tree.links.new(output.inputs[0].links[0].from_socket, realize.inputs[0])
    tree.links.new(realize.outputs[0], output.inputs[0])
    path = tmp_path / "oracle.usdc"
    write_usd(path, FRAMES)
    for frame in exported:
        assert len(frame.meshes) == 2
        (oracle,) = usd_meshes(path, frame.frame)
        ours = np.concatenate([mesh.points for mesh in placed_meshes(frame)])
        assert np.allclose(in_order(ours), in_order(oracle.points), atol=1e-5)


def in_order(points: np.ndarray) -> np.ndarray:
    rounded = np.round(points, 4)
    return rounded[np.lexsort(rounded.T)]


def test_collection_instances_nest(tmp_path: Path) -> None:
    inner = bpy.data.collections.new("Inner")
    owner = add_mesh()
    scene().collection.objects.unlink(owner)
    inner.objects.link(owner)
    animate(owner, "location", {1: 0.0, 7: 1.0}, index=1)
    outer = bpy.data.collections.new("Outer")
    for step in range(2):
        empty = bpy.data.objects.new(f"Inner {step}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", inner
        empty.location.x = 5.0 * step
        outer.objects.link(empty)
    for step in range(3):
        empty = add_object(f"Outer {step}", None, location=(0, 0, step), scale=(1, 1, 1 + step))
        empty.instance_type, empty.instance_collection = "COLLECTION", outer
        animate(empty, "rotation_euler", {1: 0.0, 7: 1.0}, index=0)
    exported = assert_agrees_with_usd(tmp_path)
    assert len(exported[0].meshes) == 1
    assert len(exported[0].arrays["instance_mesh"]) == 6


def test_particle_instances(tmp_path: Path) -> None:
    emitter = add_primitive("grid", "Emitter", x_subdivisions=3, y_subdivisions=3, size=4)
    shape = add_mesh("Shape", size=0.1)
    shape.hide_render = True
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end = 12, 1, 1
    settings.lifetime, settings.physics_type = 50, "NO"
    settings.render_type, settings.instance_object = "OBJECT", shape
    animate(emitter, "location", {1: 0.0, 7: 2.0}, index=0)
    exported = assert_agrees_with_usd(tmp_path)
    assert len(exported[0].arrays["instance_mesh"]) == 13
    assert len({frame.arrays["instance_key"].tobytes() for frame in exported}) == 1


def add_waves() -> Any:
    """Add a mesh that both cache formats know to be animated, by its Wave modifier."""
    owner = add_primitive("grid", "Grid", x_subdivisions=5, y_subdivisions=5, size=4)
    owner.modifiers.new("Wave", "WAVE").time_offset = -20
    return owner


def test_an_alembic_cache_plays(tmp_path: Path) -> None:
    owner = add_waves()
    scene().frame_start, scene().frame_end = 1, 7
    path = str(tmp_path / "cache.abc")
    bpy.ops.wm.alembic_export(filepath=path, check_existing=False, as_background_job=False)
    bpy.data.objects.remove(owner)
    bpy.ops.wm.alembic_import(filepath=path, as_background_job=False)
    assert [m.type for o in scene().objects for m in o.modifiers] == ["MESH_SEQUENCE_CACHE"]
    assert points_move(assert_agrees_with_usd(tmp_path))


def test_a_usd_cache_plays(tmp_path: Path) -> None:
    owner = add_waves()
    path = tmp_path / "cache.usdc"
    write_usd(path, FRAMES)
    bpy.data.objects.remove(owner)
    bpy.ops.wm.usd_import(filepath=str(path))
    exported = export_in_render(FRAMES)
    assert points_move(exported)
    for frame in exported:
        assert_same_meshes(placed_meshes(frame), usd_meshes(path, frame.frame))


def add_curve() -> Any:
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(1)
    spline.bezier_points[1].co = (1, 0, 0)
    spline.bezier_points[1].handle_left = (1, 1, 0)
    return add_object("Curve", curve)


def add_text() -> Any:
    text: Any = bpy.data.curves.new("Text", "FONT")
    text.body, text.extrude = "ab", 0.1
    return add_object("Text", text)


def add_surface() -> Any:
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    return bpy.context.object


def add_metaball() -> Any:
    ball = bpy.data.metaballs.new("Ball")
    ball.elements.new()
    ball.resolution = ball.render_resolution  # conversion to a mesh takes the former
    return add_object("Ball", ball)


@pytest.mark.parametrize("add", [add_curve, add_text, add_surface, add_metaball])
def test_types_that_become_meshes(add: Any, tmp_path: Path) -> None:
    """Blender's own conversion to a mesh is the oracle, written to USD like the others."""
    owner = add()
    owner.location, owner.rotation_euler = (1, 2, 3), (0.3, 0.2, 0.1)
    exported = export_in_render((1,))
    scene().view_layers[0].objects.active = owner
    owner.select_set(True)
    bpy.ops.object.convert(target="MESH")
    path = tmp_path / "oracle.usdc"
    write_usd(path, (1,))
    ours, oracle = placed_meshes(exported[0]), usd_meshes(path, 1)
    assert len(ours) == 1
    assert_same_meshes(ours, oracle)


def test_an_object_in_edit_mode_is_exported() -> None:
    owner = add_mesh()
    scene().view_layers[0].objects.active = owner
    bpy.ops.object.mode_set(mode="EDIT")
    frame = export_now()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [len(mesh.triangles) for mesh in frame.meshes] == [3]


def test_corner_normals_and_uvs_follow_their_corners() -> None:
    owner = add_mesh()
    owner.data.shade_smooth()
    layers = owner.data.uv_layers
    first, second = layers.new(name="First"), layers.new(name="Second")
    corners = len(owner.data.loops)
    second.uv.foreach_set("vector", np.arange(2 * corners, dtype=np.float32))
    assert first.name
    second.active_render = True
    assert not export_now().meshes[0].corner_uvs.any(), "nothing asks for texture coordinates"
    owner.data.materials.append(add_material("Textured", textured_diffuse))
    mesh = export_now().meshes[0]
    uv_of_loop = np.arange(2 * corners).reshape(-1, 2)
    owner.data.calc_loop_triangles()
    for row, triangle in enumerate(owner.data.loop_triangles):
        assert np.array_equal(mesh.corner_uvs[row], uv_of_loop[list(triangle.loops)])
        assert list(mesh.triangles[row]) == list(triangle.vertices)
        assert np.allclose(mesh.corner_normals[row], normals_of(owner, triangle, flat=set()))


def normals_of(owner: Any, triangle: Any, flat: set[int]) -> Any:
    """Blender's normals of a triangle's corners; zeros, its own, where its face is flat."""
    if triangle.polygon_index in flat:
        return np.zeros((3, 3))
    return [owner.data.corner_normals[loop].vector for loop in triangle.loops]


def test_flat_faces_have_a_normal_for_each_triangle() -> None:
    owner = add_mesh()
    mesh = owner.data
    everything = set(range(len(mesh.polygons)))

    def check(flat: set[int]) -> None:
        rows = export_now().meshes[0].corner_normals
        mesh.calc_loop_triangles()
        expected = [normals_of(owner, triangle, flat) for triangle in mesh.loop_triangles]
        assert np.allclose(rows, expected)

    mesh.shade_flat()
    check(flat=everything)
    mesh.shade_smooth()
    check(flat=set())
    mesh.polygons[0].use_smooth = False
    check(flat={0})
    # Now Blender's normals of corners count, those of flat faces among them.
    mesh.edges[0].use_edge_sharp = True
    check(flat=set())
    mesh.edges[0].use_edge_sharp = False
    mesh.normals_split_custom_set([(0.0, 0.6, 0.8)] * len(mesh.loops))
    check(flat=set())


def test_arrays_keep_the_contract() -> None:
    add_mesh()
    add_object("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    frame = export_now()
    for name, (dtype, axes) in contract_table("FRAME").items():
        array = frame.arrays[name]
        assert (array.dtype.name, array.ndim, array.flags.c_contiguous) == (dtype, axes, True), name
    assert frame.arrays.keys() == contract_table("FRAME").keys()
    for name, (dtype, axes) in contract_table("MESH").items():
        array = getattr(frame.meshes[0], name)
        assert (array.dtype.name, array.ndim, array.flags.c_contiguous) == (dtype, axes, True), name


def test_the_renderer_takes_what_is_exported() -> None:
    owner = add_mesh()
    owner.data.materials.append(None)
    add_object("Lamp", bpy.data.lights.new("Lamp", "SPOT"))
    frame = export_now(core=dualcone)
    dualcone.SceneFrame(frame.frame, frame.meshes, frame.images, frame.arrays)


def test_an_unchanged_mesh_is_handed_over_once() -> None:
    still = add_mesh("Still")
    moving = add_mesh("Moving", size=2.0)
    deforming = add_mesh("Deforming", size=3.0)
    deforming.modifiers.new("Cast", "CAST")
    animate(moving, "location", {1: 0.0, 7: 1.0}, index=0)
    animate(deforming, 'modifiers["Cast"].factor', {1: 0.1, 7: 1.0})
    core = RecordingCore()
    first, second, third = export_in_render(FRAMES, core=core)
    assert still.name
    assert len(core.built) == 2 + len(FRAMES)
    shared = [mesh for mesh in first.meshes if any(mesh is other for other in third.meshes)]
    assert len(shared) == 2
    assert len({f.content_hash for f in (first, second, third)}) == 3


def test_a_mesh_that_blender_did_not_evaluate_again_is_not_read_again() -> None:
    still = add_mesh("Still")
    add_object("Twin", still.data, location=(0, 0, 3))
    waves = add_waves()
    animate(still, "location", {1: 0.0, 7: 1.0}, index=0)
    cache = export.ExportCache()
    frames = export_in_render(FRAMES, cache=cache)
    assert cache.statistics.meshes_read == 1 + len(FRAMES)
    assert [len(frame.meshes) for frame in frames] == [2] * len(FRAMES)
    waves.modifiers.clear()
    export_in_render(FRAMES, cache=cache)
    assert cache.statistics.meshes_read == 1 + len(FRAMES) + 2


def test_a_cache_never_shows_what_was(tmp_path: Path) -> None:
    """Frames in any order, with and without a cache, are the same to the bit."""
    frames = (1, 7, 4, 7, 2, 3, 1, 6, 5)
    add_waves()
    hidden = add_waves()
    for frame, is_hidden in ((1, False), (3, True), (6, False)):
        hidden.hide_render = is_hidden
        hidden.keyframe_insert("hide_render", frame=frame)
    for add in (add_curve, add_text, add_metaball, add_surface):
        owner = add()
        animate(owner, "location", {1: 0.0, 7: 1.0}, index=0)
    animate(bpy.data.curves["Curve"], "bevel_depth", {1: 0.1, 7: 0.3})
    animate(bpy.data.curves["Text"], "extrude", {1: 0.1, 4: 0.1, 7: 0.2})
    tree, output = instance_on_points(
        lambda tree: tree.nodes.new("GeometryNodeMeshCube").outputs[0]
    )
    time = tree.nodes.new("GeometryNodeInputSceneTime")
    cube = next(n for n in tree.nodes if n.bl_idname == "GeometryNodeMeshCube")
    tree.links.new(time.outputs["Seconds"], cube.inputs["Size"])
    assert output
    cached = export_in_render(frames)
    for frame in cached:
        (alone,) = export_in_render((frame.frame,))
        assert alone.content_hash == frame.content_hash, frame.frame


def test_an_edit_between_two_evaluations_is_not_missed() -> None:
    """Blender itself remembers the changes of the latest evaluation only.

    The edited mesh may lie where the one before it lay: from the second edit on it does.
    """
    owner = add_mesh()
    cache = export.ExportCache()
    for step in range(5):
        owner.data.vertices[0].co.z = float(step)
        owner.data.update()
        scene().view_layers[0].update()
        scene().frame_set(2 + step)
        assert export_now(cache).meshes[0].vertices[0, 2] == step


def test_another_object_with_the_same_mesh_is_not_missed() -> None:
    """A new mesh may take the memory of one that is gone."""
    cache = export.ExportCache()
    for step in range(20):
        owner = add_mesh(f"Mesh {step}", size=1.0 + step)
        frame = export_now(cache)
        assert frame.meshes[0].vertices.max() == 2.0 * (1.0 + step)
        mesh = owner.data
        bpy.data.objects.remove(owner)
        bpy.data.meshes.remove(mesh)


def test_the_handlers_go_with_the_last_cache() -> None:
    gc.collect()  # the engine classes of earlier tests hold caches in cycles
    handlers = bpy.app.handlers.frame_change_post
    before = len(handlers)
    first, second = export.ExportCache(), export.ExportCache()
    assert len(handlers) == before + 1
    del first
    assert len(handlers) == before + 1
    del second
    assert len(handlers) == before


def test_meshes_that_are_not_used_are_let_go() -> None:
    add_waves()
    cache = export.ExportCache()
    export_in_render(range(1, 81), cache=cache)
    assert len(cache.meshes) <= 34


def test_the_same_scene_has_the_same_hash_and_another_has_not() -> None:
    owner = add_mesh()
    before = export_now()
    assert export_now().content_hash == before.content_hash
    owner.data.vertices[0].co.z += 1e-3
    owner.data.update()
    assert export_now().content_hash != before.content_hash


def test_objects_of_one_mesh_share_it() -> None:
    owner = add_mesh()
    add_object("Twin", owner.data, location=(3, 0, 0), scale=(-1, 1, 1))
    frame = export_now()
    assert len(frame.meshes) == 1
    assert list(frame.arrays["instance_mesh"]) == [0, 0]
    assert sorted(np.linalg.det(frame.arrays["world_from_object"][:, :, :3])) == [-1, 1]
    assert len(set(frame.arrays["instance_key"])) == 2


def test_keys_do_not_depend_on_order() -> None:
    a, b = add_mesh("A"), add_mesh("B", size=2.0)
    before = export_now().arrays
    of_size = dict(zip(before["instance_mesh"], before["instance_key"], strict=True))
    objects = scene().collection.objects
    for owner in (a, b):
        objects.unlink(owner)
    for owner in (b, a):
        objects.link(owner)
    after = export_now().arrays
    assert set(after["instance_key"]) == set(of_size.values())


def test_keys_of_instances_do_not_depend_on_their_neighbours() -> None:
    collection = bpy.data.collections.new("Shared")
    owner = add_mesh()
    scene().collection.objects.unlink(owner)
    collection.objects.link(owner)
    instancers = [add_object(f"Instancer {x}", None, location=(x, 0, 0)) for x in range(3)]
    for instancer in instancers:
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection

    def keys_by_place() -> dict[float, int]:
        arrays = export_now().arrays
        places = arrays["world_from_object"][:, 0, 3].tolist()
        return dict(zip(places, arrays["instance_key"].tolist(), strict=True))

    before = keys_by_place()
    bpy.data.objects.remove(instancers[0])
    after = keys_by_place()
    assert len(set(before.values())) == 3
    assert after == {place: before[place] for place in (1.0, 2.0)}


def test_what_is_hidden_from_renders_is_left_out() -> None:
    add_mesh("Seen")
    add_mesh("Hidden").hide_render = True
    add_curve().hide_render = True
    for frame in (export_in_render((1,))[0], export_now()):
        assert len(frame.meshes) == len(frame.arrays["instance_mesh"]) == 1


def test_an_instancer_is_shown_only_if_asked_to() -> None:
    instancer = add_primitive("plane", "Instancer")
    add_mesh("Child", size=0.5).parent = instancer
    instancer.instance_type = "VERTS"
    instancer.show_instancer_for_render = False
    (frame,) = export_in_render((1,))
    assert len(frame.meshes) == 1
    assert len(frame.arrays["instance_mesh"]) == 4


def test_a_collection_hidden_from_renders_is_left_out() -> None:
    collection = bpy.data.collections.new("Hidden")
    scene().collection.children.link(collection)
    owner = add_mesh()
    scene().collection.objects.unlink(owner)
    collection.objects.link(owner)
    collection.hide_render = True
    assert export_in_render((1,))[0].meshes == []


def test_an_object_with_nan_is_left_out_by_name() -> None:
    add_mesh("Sound")
    broken = add_mesh("Broken", size=2.0)
    broken.data.vertices[1].co.x = math.nan
    frame = export_now()
    assert len(frame.meshes) == len(frame.arrays["instance_mesh"]) == 1
    assert frame.warnings == ["'Broken': has vertices that are not numbers and is left out"]


@pytest.mark.parametrize(
    ("scale", "is_named"),
    [((0, 0, 0), False), ((1, 0, 0), False), ((1, 0, 1), True), ((1e-20, 1e-20, 1e-20), False)],
)
def test_a_singular_instance_is_left_out_by_name_if_it_shows(
    scale: tuple[float, float, float], is_named: bool
) -> None:
    owner = add_mesh("Flat")
    owner.scale = scale
    add_mesh("Sound", size=2.0)
    frame = export_now()
    assert len(frame.arrays["instance_mesh"]) == len(frame.arrays["instance_key"]) == 1
    assert np.allclose(frame.meshes[frame.arrays["instance_mesh"][0]].vertices.max(), 4.0)
    warning = "'Flat': its matrix flattens space, this instance is left out"
    assert frame.warnings == ([warning] if is_named else [])


def test_a_matrix_whose_axes_lie_in_a_plane_is_singular() -> None:
    owner = add_mesh("Flat")
    owner.parent = add_object("Parent", None)
    owner.matrix_parent_inverse = Matrix(((1, 0, 1, 0), (0, 1, 1, 0), (0, 0, 0, 0), (0, 0, 0, 1)))
    frame = export_now()
    assert len(frame.arrays["instance_mesh"]) == 0
    assert frame.warnings == ["'Flat': its matrix flattens space, this instance is left out"]


def test_a_small_object_is_not_singular() -> None:
    add_mesh().scale = (1e-6, 1e-3, 1e-6)
    frame = export_now()
    assert len(frame.arrays["instance_mesh"]) == 1
    assert frame.warnings == []


def test_degenerate_triangles_and_loose_vertices_are_exported() -> None:
    mesh = bpy.data.meshes.new("Degenerate")
    mesh.from_pydata([(0, 0, 0)] * 3 + [(1, 1, 1)], [], [(0, 1, 2)])
    add_object("Degenerate", mesh)
    cloud = bpy.data.meshes.new("Loose")
    cloud.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    add_object("Loose", cloud)
    frame = export_now()
    assert [len(m.triangles) for m in frame.meshes] == [1]
    assert np.isfinite(frame.meshes[0].corner_normals).all()


def test_nothing_to_see_is_allowed() -> None:
    frame = export_now()
    assert frame.meshes == frame.images == []
    assert frame.arrays["world_from_object"].shape == (0, 3, 4)
    assert frame.arrays["world_radiance"].tolist() == [0.0, 0.0, 0.0]


def test_shadow_catchers_are_handed_over() -> None:
    add_mesh("Thing")
    add_mesh("Ghost").is_shadow_catcher = True
    frame = export_now()
    assert frame.warnings == []
    assert sorted(frame.arrays["instance_shadow_catcher"]) == [0, 1]


def test_things_that_glow_have_links_of_their_own() -> None:
    add_mesh("Thing")
    ghost = add_mesh("Ghost")
    collection = bpy.data.collections.new("Linked")
    collection.objects.link(bpy.data.objects["Thing"])
    ghost.light_linking.receiver_collection = collection
    scene().view_layers[0].lightgroups.add().name = "Group"
    ghost.lightgroup = "Group"
    arrays = export_now().arrays
    assert sorted(arrays["instance_links"].tolist()) == [[0, 0, 0], [1, 0, 1]]
    # The ghost, whose links they are, is not in the set; all things are in set 0.
    glows = arrays["instance_links"][:, 0] == 1
    assert arrays["instance_receiver_sets"][glows].tolist() == [1]
    assert arrays["instance_receiver_sets"][~glows].tolist() == [3]


def test_rays_that_meet_an_object_are_those_that_see_it_and_what_instances_it() -> None:
    ghost = add_mesh("Ghost")
    ghost.visible_shadow = False
    add_object("Hole", ghost.data).is_holdout = True
    library = bpy.data.collections.new("Library")
    library.objects.link(ghost)
    empty = add_object("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", library
    empty.visible_camera = False
    arrays = export_now().arrays
    flags = zip(arrays["instance_visibility"], arrays["instance_holdout"], strict=True)
    assert sorted(flags) == [(14, 0), (15, 0), (31, 1)]


def test_instances_have_blenders_random_numbers() -> None:
    """Object Info's Random is between zero and one; Blender hands out signed numbers."""
    ball, leaf = add_mesh("Ball"), add_mesh("Leaf")
    leaf.parent, ball.instance_type = ball, "VERTS"
    frame = export_now()
    instances = bpy.context.evaluated_depsgraph_get().object_instances
    signed = [item.random_id for item in instances if item.is_instance]
    assert min(signed) < 0 < max(signed)
    numbers = frame.arrays["instance_info"][:, 1]
    of_instances = np.array(signed, np.int32).view(np.uint32) / (2**32 - 1)
    of_objects = [number_of_name("Ball"), number_of_name("Leaf")]
    assert sorted(numbers) == pytest.approx(sorted([*of_objects, *of_instances]), abs=1e-6)


def test_objects_have_the_random_numbers_of_their_names() -> None:
    """Those that Cycles of 5.0 shows, by an Emission of Object Info's Random."""
    known = {"Q": 0.06749145, "Leaf.001": 0.53774709, "Ä name that is longer": 0.67340523}
    for name, number in known.items():
        assert number_of_name(name) == pytest.approx(number, abs=1e-6)


def test_shadows_are_those_of_the_smooth_form_as_far_as_the_object_says() -> None:
    ball: Any = add_mesh("Ball")
    name = "shadow_terminator_geometry_offset"
    settings = ball if hasattr(ball, name) else ball.cycles
    assert export_now().arrays["instance_lift_cosine"].tolist() == [pytest.approx(0.1)]
    setattr(settings, name, 0.25)
    ball.update_tag()  # a property of Cycles in 4.2 does not tag the object by itself
    assert export_now().arrays["instance_lift_cosine"].tolist() == [0.25]


def test_a_shading_offset_is_named() -> None:
    ball: Any = add_mesh("Ball")
    name = "shadow_terminator_shading_offset"
    what = "'Ball': Shading Offset below Shadow Terminator is not rendered yet"
    assert what not in export_now().warnings
    if hasattr(ball, name):
        setattr(ball, name, 0.5)
    else:
        ball.cycles.shadow_terminator_offset = 0.5
    ball.update_tag()
    assert what in export_now().warnings


def test_a_collection_for_indirect_light_is_hidden_from_the_camera() -> None:
    hidden = add_mesh("Hidden")
    collection = bpy.data.collections.new("Indirect")
    scene().collection.children.link(collection)
    scene().collection.objects.unlink(hidden)
    collection.objects.link(hidden)
    scene().view_layers[0].layer_collection.children["Indirect"].indirect_only = True
    assert export_now().arrays["instance_visibility"].tolist() == [30]


def add_strands(counts: list[int], radius: float) -> Any:
    """Curves straight up, side by side, one metre long."""
    data: Any = bpy.data.hair_curves.new("Hair")
    data.add_curves(counts)
    points = [(x, 0.0, i / (n - 1)) for x, n in enumerate(counts) for i in range(n)]
    data.attributes["position"].data.foreach_set("vector", np.ravel(points))
    radii = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", np.full(len(points), radius))
    return add_object("Hair", data)


def test_strands_become_tubes_as_wide_as_they_are() -> None:
    add_strands([2, 5], 0.1)
    frame = export_now()
    assert frame.warnings == []
    mesh = frame.meshes[0]
    corners = mesh.vertices[mesh.triangles]
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    # Two cylinders without ends.
    assert np.isclose(areas.sum(), 2 * 2 * np.pi * 0.1, rtol=1e-4)
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outwards * mesh.corner_normals[:, 0]).sum(axis=1) > 0.0).all()


def principled_hair(tree: Any) -> Any:
    return tree.nodes.new("ShaderNodeBsdfHairPrincipled").outputs[0]


def test_strands_tell_hair_shaders_where_they_go() -> None:
    owner = add_strands([2, 5], 0.1)
    material = add_material("Hair", principled_hair)
    owner.data.materials.append(material)
    frame = export_now()
    assert frame.warnings == []
    assert frame.meshes[0].layer_keys.tolist() == [4]
    along = frame.meshes[0].layer_values[0]
    assert np.allclose(along, (0.0, 0.0, 0.1, 8.0))
    shader = next(n for n in material.node_tree.nodes if n.bl_idname.endswith("HairPrincipled"))
    shader.inputs["Random Roughness"].default_value = 0.5
    mesh = export_now().meshes[0]
    corners = mesh.vertices[mesh.triangles]
    intercept, length, number, _ = np.moveaxis(mesh.layer_values[mesh.layer_keys == 5][0], -1, 0)
    # The spline is slower at its ends than the share of the length.
    assert np.allclose(intercept, corners[..., 2], atol=0.1)
    assert np.allclose(length, 1.0)
    assert np.array_equal(number, np.round(corners[..., 0]))


def test_principled_hair_on_a_mesh_is_named() -> None:
    owner = add_mesh("Ball")
    owner.data.materials.append(add_material("Hair", principled_hair))
    (warning,) = export_now().warnings
    assert warning.startswith("'Ball': Principled Hair is not rendered yet on meshes")


def test_a_point_cloud_becomes_balls() -> None:
    tree: Any = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    ends = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points = tree.nodes.new("GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = 0.25
    tree.links.new(ends[0].outputs[0], points.inputs[0])
    tree.links.new(points.outputs[0], ends[1].inputs[0])
    owner = add_mesh("Cloud")
    owner.modifiers.new("Points", "NODES").node_group = tree
    owner.scale = (2.0, 2.0, 2.0)
    frame = export_now()
    corners = [vertex.co for vertex in owner.data.vertices]
    matrices = frame.arrays["world_from_object"]
    assert frame.warnings == []
    assert len(frame.meshes) == 1
    assert np.allclose(matrices[:, :, 3], 2.0 * np.array(corners))
    assert np.allclose(matrices[:, :, :3], 0.5 * np.eye(3))
    assert len(set(frame.arrays["instance_key"])) == len(corners)
    radii = np.linalg.norm(frame.meshes[0].vertices, axis=1)
    assert np.allclose(radii, radii[0])
    assert np.isclose(radii[0], 1.0, atol=0.01)


def test_simulations_without_a_bake_are_named_once() -> None:
    for name in ("A", "B"):
        add_mesh(name).modifiers.new("Cloth", "CLOTH")
    frames = export_in_render((1, 2))
    advice = "simulation is not baked, its frames may be wrong: bake it before rendering"
    assert frames[0].warnings == [f"'A': the cloth {advice}", f"'B': the cloth {advice}"]


def test_export_stops_when_asked() -> None:
    add_mesh()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    core, cache = RecordingCore(), export.ExportCache()
    with pytest.raises(export.ExportStopped):
        export.export_frame(depsgraph, 1, (32, 24), cache, core, lambda: True)
    assert core.built == []


def test_the_scene_is_left_as_it_was() -> None:
    add_mesh()
    scene().frame_set(3)
    before = {name: len(getattr(bpy.data, name)) for name in ("objects", "meshes", "images")}
    export_now()
    assert before == {name: len(getattr(bpy.data, name)) for name in before}
    assert scene().frame_current == 3


def test_adaptive_subdivision_is_named(scene: Any) -> None:
    owner = add_mesh()
    modifier = owner.modifiers.new("Subdivision", "SUBSURF")
    assert export_now().warnings == []
    if bpy.app.version < (5, 0, 0):
        scene.cycles.feature_set = "EXPERIMENTAL"
        owner.cycles.use_adaptive_subdivision = True
    else:
        modifier.use_adaptive_subdivision = True
    (warning,) = export_now().warnings
    assert warning.startswith("'Mesh': adaptive subdivision is not rendered yet")
    modifier.show_render = False
    assert export_now().warnings == []
