"""Volume objects and domains of smoke as grids within boxes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import add_camera, add_material, add_mesh, add_object, export, export_now

import dualcone

VOLUME = export.__name__ + ".volume"
SIZE = (3, 4, 5)


@pytest.fixture(autouse=True)
def camera() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return add_camera()


@pytest.fixture
def openvdb() -> Any:
    """Return Blender's module for OpenVDB."""
    if hasattr(bpy.utils, "expose_bundled_modules"):
        bpy.utils.expose_bundled_modules()
    return pytest.importorskip("openvdb")


def values() -> np.ndarray:
    """Numbers that are all different and none of them zero."""
    return np.arange(1.0, 61.0, dtype=np.float32).reshape(SIZE)


def add_cloud(openvdb: Any, folder: Path, **grids: np.ndarray) -> Any:
    """Add a volume object with these grids, half a metre a voxel, from (1, 0, 0) on."""
    written = []
    for name, content in grids.items():
        grid = openvdb.Vec3SGrid() if content.ndim == 4 else openvdb.FloatGrid()
        grid.copyFromArray(content)
        grid.name, grid.transform = name, openvdb.createLinearTransform(voxelSize=0.5)
        grid.transform.postTranslate((1.0, 0.0, 0.0))
        written.append(grid)
    path = folder / "cloud.vdb"
    openvdb.write(str(path), grids=written)
    data: Any = bpy.data.volumes.new("Cloud")
    data.filepath = str(path)
    return add_object("Cloud", data)


def test_a_volume_object_becomes_a_box_with_the_grids_that_are_read(
    openvdb: Any, tmp_path: Path
) -> None:
    add_cloud(openvdb, tmp_path, density=values(), heat=values())
    frame = export_now()
    assert frame.warnings == []
    (mesh,) = frame.meshes
    (grid,) = mesh.grids.values()
    assert np.array_equal(grid.voxels[..., 0], values())
    assert grid.index_from_object == pytest.approx(
        np.array([[2.0, 0.0, 0.0, -2.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]])
    )
    # A step beyond the outermost points.
    assert mesh.vertices.min(axis=0) == pytest.approx([0.5, -0.5, -0.5])
    assert mesh.vertices.max(axis=0) == pytest.approx([2.5, 2.0, 2.5])
    assert mesh.is_scaled


def test_the_triangles_of_the_box_are_seen_from_outside(openvdb: Any, tmp_path: Path) -> None:
    add_cloud(openvdb, tmp_path, density=values())
    (mesh,) = export_now().meshes
    corners = mesh.vertices[mesh.triangles] - mesh.vertices.mean(axis=0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * corners.mean(axis=1)).sum(axis=1) > 0.0).all()


def test_materials_say_which_grids_are_read(openvdb: Any, tmp_path: Path) -> None:
    colors = np.repeat(values()[..., None], 3, axis=3)
    cloud = add_cloud(openvdb, tmp_path, density=values(), color=colors)

    def build(tree: Any) -> None:
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = "color"
        volume = tree.nodes.new("ShaderNodeVolumeScatter")
        tree.links.new(attribute.outputs["Color"], volume.inputs["Color"])
        tree.links.new(volume.outputs[0], tree.nodes["Material Output"].inputs["Volume"])

    cloud.data.materials.append(add_material("Smoke", build))
    (grid,) = export_now().meshes[0].grids.values()
    assert np.array_equal(grid.voxels, colors)


def test_a_modifier_makes_a_volume_of_a_mesh(openvdb: Any) -> None:
    cube = add_mesh("Cube")
    cloud = add_object("Cloud", bpy.data.volumes.new("Cloud"))
    modifier: Any = cloud.modifiers.new("Fill", "MESH_TO_VOLUME")
    modifier.object, modifier.density = cube, 2.0
    cube.data.from_pydata([], [], [])
    bpy.ops.mesh.primitive_cube_add()
    modifier.object = bpy.context.object
    frame = export_now()
    grids = [grid for mesh in frame.meshes for grid in mesh.grids.values()]
    assert [grid.voxels.max() for grid in grids] == [pytest.approx(2.0)]


def test_without_a_module_that_reads_it_a_volume_is_named(
    openvdb: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_cloud(openvdb, tmp_path, density=values())
    monkeypatch.setattr(f"{VOLUME}.MODULES", ())
    frame = export_now()
    assert frame.meshes == []
    assert frame.warnings == [
        "'Cloud': this Blender has no openvdb module for Python, the volume is left out"
    ]


def test_a_grid_that_is_too_large_is_named(
    openvdb: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_cloud(openvdb, tmp_path, density=values())
    monkeypatch.setattr(f"{VOLUME}.NUMBERS_MAX", 59)
    assert export_now().warnings == [
        "'Cloud': its grid 'density' has 3 x 4 x 5 points, which are too many and is left out"
    ]


def test_cubic_interpolation_is_named(openvdb: Any, tmp_path: Path) -> None:
    cloud = add_cloud(openvdb, tmp_path, density=values())

    def build(tree: Any) -> None:
        volume = tree.nodes.new("ShaderNodeVolumePrincipled")
        tree.links.new(volume.outputs[0], tree.nodes["Material Output"].inputs["Volume"])

    material = add_material("Smoke", build)
    material.cycles.volume_interpolation = "CUBIC"
    cloud.data.materials.append(material)
    assert export_now().warnings == [
        "'Smoke': Cubic interpolation of volumes is not rendered yet (Linear is used)"
    ]


def test_an_empty_volume_is_nothing_and_a_missing_file_is_named() -> None:
    cloud = add_object("Cloud", bpy.data.volumes.new("Cloud"))
    frame = export_now()
    assert (frame.meshes, frame.warnings) == ([], [])
    cloud.data.filepath = "/nowhere/cloud.vdb"
    (warning,) = export_now().warnings
    assert warning.startswith("'Cloud': its OpenVDB file cannot be read (")


class Grid(list):
    """An array of Blender's that can be read at once."""

    def foreach_get(self, numbers: np.ndarray) -> None:
        numbers[:] = self


class Domain:
    """Stands in for a simulation's settings: wheels of Blender cannot simulate."""

    domain_type = "GAS"
    cache_frame_start, cache_frame_end = 1, 10
    domain_resolution = (2, 3, 4)
    use_noise, noise_scale = False, 2
    density_grid = Grid(range(24))
    color_grid = Grid(range(96))
    flame_grid = temperature_grid = heat_grid = Grid()


def test_grids_of_smoke_lie_in_the_middles_of_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.mesh.primitive_cube_add()
    owner = bpy.context.object
    monkeypatch.setattr(f"{VOLUME}.smoke_domain", lambda _: Domain)
    volume = sys.modules[VOLUME]
    wanted = frozenset(f"attribute:{name}" for name in ("density", "color", "flame"))
    density, color = volume.read_smoke(owner, wanted, 5)
    assert density.values.shape == (2, 3, 4, 1)
    # Along X values count fastest.
    assert density.values[1, 0, 0, 0] == 1.0
    assert density.values[0, 1, 0, 0] == 2.0
    assert density.values[0, 0, 1, 0] == 6.0
    assert color.values[1, 0, 0].tolist() == [4.0, 5.0, 6.0, 7.0]
    # The cube reaches from -1 to 1: the first middle along X is at -0.5, that along Z at -0.75.
    index = density.index_from_object @ np.array([-0.5, 0.0, -0.75, 1.0])
    assert index == pytest.approx([0.0, 1.0, 0.0])
    assert volume.read_smoke(owner, wanted, 11) == []


def test_smoke_that_is_not_simulated_is_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.mesh.primitive_cube_add()
    monkeypatch.setattr(Domain, "density_grid", Grid())
    monkeypatch.setattr(Domain, "color_grid", Grid())
    for module in (VOLUME, export.__name__ + ".instance"):
        monkeypatch.setattr(
            f"{module}.smoke_domain", lambda owner: Domain if owner.type == "MESH" else None
        )
    frame = export_now()
    assert (frame.meshes, frame.warnings) == ([], [])


def test_the_renderer_refuses_what_is_no_grid() -> None:
    place = np.eye(3, 4, dtype=np.float32)
    with pytest.raises(ValueError, match="voxels"):
        dualcone.Grid(np.zeros((2, 2, 2, 2), np.float32), place)
    with pytest.raises(ValueError, match="voxels"):
        dualcone.Grid(np.zeros((0, 2, 2, 1), np.float32), place)
