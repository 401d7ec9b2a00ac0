"""The sample scenes keep what their cards promise and use only what is rendered."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import bpy
import pytest
from mathutils import Vector

SAMPLES = Path(__file__).resolve().parents[2] / "blend_samples"
Sample = tuple[Path, dict[str, Any]]
MAX_BYTES = 5_000_000
NODES = {
    "ShaderNodeOutputMaterial",
    "ShaderNodeBsdfPrincipled",
    "ShaderNodeBsdfDiffuse",
    "ShaderNodeBsdfAnisotropic",  # Glossy, by its id since 4.0
    "ShaderNodeEmission",
    "ShaderNodeMixShader",
    "ShaderNodeTexImage",
    "ShaderNodeOutputWorld",
    "ShaderNodeBackground",
    "ShaderNodeTexEnvironment",
}
NOT_RENDERED = ("Transmission Weight", "Coat Weight", "Sheen Weight", "Subsurface Weight")


@pytest.fixture(params=("indoor", "loader", "stadium", "excavator", "figure"))
def sample(request: pytest.FixtureRequest, empty_file: None) -> Sample:
    """A sample opened in Blender, with its card."""
    path = SAMPLES / f"{request.param}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    return path, tomllib.loads(path.with_suffix(".toml").read_text())


def current_scene() -> Any:
    return bpy.context.scene


def trees() -> list[Any]:
    return [d.node_tree for d in (*bpy.data.materials, *bpy.data.worlds) if d.node_tree]


def instances() -> list[tuple[str, int, Any]]:
    """(object name, its triangles, its matrix) of everything that is rendered in this frame."""
    found = []
    listed: Any = bpy.context.evaluated_depsgraph_get().object_instances
    for item in listed:
        if item.object.type == "MESH":
            item.object.data.calc_loop_triangles()
            count = len(item.object.data.loop_triangles)
            found.append((item.object.name, count, item.matrix_world.copy()))
    return found


def test_the_card_counts_the_triangles(sample: Sample) -> None:
    _, card = sample
    counted = sum(count for _, count, _ in instances())
    assert counted == pytest.approx(card["triangles"], rel=0.03)


def test_the_card_gives_the_frames(sample: Sample) -> None:
    _, card = sample
    scene = current_scene()
    assert [scene.frame_start, scene.frame_end] == card["frames"]
    assert scene.render.fps == card["fps"] == 24
    assert all(card[field] for field in ("title", "author", "licence", "exercises"))
    assert card["light"] in ("interior", "sun", "overcast")


def test_the_render_settings_are_those_of_the_paper(sample: Sample) -> None:
    path, _ = sample
    scene = current_scene()
    render = scene.render
    size = (render.resolution_x, render.resolution_y, render.resolution_percentage)
    assert size == (720, 480, 100)
    assert render.engine == "CYCLES"
    assert (scene.cycles.samples, scene.cycles.use_denoising) == (64, False)
    assert not render.use_compositing
    assert render.filepath == f"//out/{path.stem}_####"


def test_the_camera_is_a_plain_one_and_moves(sample: Sample) -> None:
    scene = current_scene()
    camera = scene.camera
    assert camera is not None
    assert camera.data.type == "PERSP"
    assert not camera.data.dof.use_dof
    scene.frame_set(scene.frame_start)
    first = camera.matrix_world.copy()
    scene.frame_set(scene.frame_end)
    assert (camera.matrix_world.translation - first.translation).length > 0.1


def test_only_supported_nodes_are_used(sample: Sample) -> None:
    used = {node.bl_idname for tree in trees() for node in tree.nodes}
    assert used <= NODES
    for tree in trees():
        for node in tree.nodes:
            if node.bl_idname == "ShaderNodeBsdfPrincipled":
                assert all(node.inputs[name].default_value == 0 for name in NOT_RENDERED)


def test_the_file_is_small_and_complete(sample: Sample) -> None:
    path, _ = sample
    assert path.stat().st_size < MAX_BYTES
    assert all(image.packed_file for image in bpy.data.images if image.source == "FILE")
    assert not bpy.data.libraries


def test_no_part_is_lost_or_flat(sample: Sample) -> None:
    """A broken matrix or constraint shows as a part far away or of no size."""
    scene = current_scene()
    for frame in (scene.frame_start, (scene.frame_start + scene.frame_end) // 2, scene.frame_end):
        scene.frame_set(frame)
        for name, _, matrix in instances():
            assert matrix.translation.length < 3000, name
            assert abs(matrix.to_3x3().determinant()) > 1e-7, name


def test_something_besides_the_camera_moves(sample: Sample) -> None:
    """The stadium is the one where only the camera does."""
    path, _ = sample
    scene = current_scene()
    scene.frame_set(scene.frame_start)
    first = {name: matrix for name, _, matrix in instances()}
    scene.frame_set(scene.frame_end - 3)
    moved = {name for name, _, matrix in instances() if matrix != first[name]}
    expected = {"indoor": 3, "loader": 30, "stadium": 0, "excavator": 4, "figure": 1}[path.stem]
    assert len(moved) >= expected


def open_loader() -> Any:
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / "loader.blend"), load_ui=False)
    return current_scene()


def test_the_linkage_of_the_loader_stays_closed() -> None:
    """The link ends in the bucket's upper pin, and no piston leaves its barrel, in any frame."""
    scene = open_loader()
    objects: Any = bpy.data.objects
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        tip = objects["BucketLink"].matrix_world @ Vector((0.81, 0, 0))
        pin = objects["Bucket"].matrix_world @ Vector((0, 0, 0.48))
        assert (tip - pin).length < 1e-3
        for name, shortest, longest in (("Tilt", 1.0, 1.95), ("Lift", 0.9, 1.78)):
            base, end = (objects[name + part].matrix_world.translation for part in ("Base", "End"))
            assert shortest < (end - base).length < longest


def test_the_front_wheels_of_the_loader_roll_without_slip() -> None:
    """The way of the front axle, over the radius, is the angle that its wheels turn."""
    scene = open_loader()
    wheel = next(o for o in bpy.data.objects if o.name.startswith("Wheel") and is_left_front(o))
    way, last = 0.0, None
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        frame_of_axle: Any = bpy.data.objects["FrontFrame"]
        middle = frame_of_axle.matrix_world @ Vector((1.65, 0, 0))
        way += (middle - last).length if last else 0.0
        last = middle
    assert wheel.rotation_euler.y * 0.82 == pytest.approx(way, rel=1e-3)


def is_left_front(wheel: Any) -> bool:
    hub = wheel.parent
    return hub.parent.name == "FrontFrame" and hub.location.y > 0


def test_the_table_repeats_the_cards() -> None:
    table = (SAMPLES / "README.md").read_text()
    for path in SAMPLES.glob("*.toml"):
        row = next(line for line in table.splitlines() if line.startswith(f"| `{path.stem}`"))
        assert f"{tomllib.loads(path.read_text())['triangles']:,}" in row
