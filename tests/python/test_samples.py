"""The sample scenes keep what their cards promise and use only what is rendered."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import bpy
import pytest

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


def trees() -> list[Any]:
    return [d.node_tree for d in (*bpy.data.materials, *bpy.data.worlds) if d.node_tree]


def instances() -> list[tuple[str, int, Any]]:
    """(object name, its triangles, its matrix) of everything that is rendered in this frame."""
    found = []
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
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
    scene = bpy.context.scene
    assert [scene.frame_start, scene.frame_end] == card["frames"]
    assert scene.render.fps == card["fps"] == 24
    assert all(card[field] for field in ("title", "author", "licence", "exercises"))


def test_the_render_settings_are_those_of_the_paper(sample: Sample) -> None:
    path, _ = sample
    scene = bpy.context.scene
    render = scene.render
    size = (render.resolution_x, render.resolution_y, render.resolution_percentage)
    assert size == (720, 480, 100)
    assert render.engine == "CYCLES"
    assert (scene.cycles.samples, scene.cycles.use_denoising) == (64, False)
    assert not render.use_compositing
    assert render.filepath == f"//out/{path.stem}_####"


def test_the_camera_is_a_plain_one_and_moves(sample: Sample) -> None:
    scene = bpy.context.scene
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


def test_no_vertex_lies_outside_reason(sample: Sample) -> None:
    """A broken matrix or constraint shows as a part far from the others or of no size."""
    scene = bpy.context.scene
    for frame in (scene.frame_start, (scene.frame_start + scene.frame_end) // 2, scene.frame_end):
        scene.frame_set(frame)
        for name, _, matrix in instances():
            assert matrix.translation.length < 3000, name
            assert abs(matrix.to_3x3().determinant()) > 1e-7, name


def test_something_besides_the_camera_moves(sample: Sample) -> None:
    """The stadium is the one where only the camera does."""
    path, _ = sample
    scene = bpy.context.scene
    scene.frame_set(scene.frame_start)
    first = {name: matrix for name, _, matrix in instances()}
    scene.frame_set(scene.frame_end - 3)
    moved = {name for name, _, matrix in instances() if matrix != first[name]}
    armatures = any(o.type == "ARMATURE" for o in bpy.data.objects)
    expected = {"indoor": 3, "loader": 30, "stadium": 0, "excavator": 4, "figure": 1}[path.stem]
    assert len(moved) >= expected or armatures
