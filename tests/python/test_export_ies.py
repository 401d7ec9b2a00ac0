"""IES files as grids of intensities, against what the standard says of them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import add_camera, add_object, export_now

AROUND = (np.arange(720) + 0.5) / 2.0


def ies_file(kind: int, around: list[float], polar: list[float], values: Any, **extra: Any) -> str:
    """Write a file whose strengths (A, P) are in candela times two."""
    lines = [polar, around, *np.asarray(values).tolist()]
    numbers = " \n".join(" ".join(map(str, line)) for line in lines)
    return (
        f"IESNA:LM-63-1995\n[TEST]\nTILT={extra.get('tilt', 'NONE')}\n"
        f"1 -1 2.0 {len(polar)} {len(around)} {kind} 1 0,0,0\n0.5 1 100\n"
        f"{numbers}\n{extra.get('tail', '')}"
    )


def grid_of(text: str) -> np.ndarray:
    """Return the grid in candela: rows every half degree from straight down."""
    from addon.export.ies import WATT_PER_CANDELA, intensity_grid

    grid = intensity_grid(text)
    assert grid.shape == (361, 720, 4)
    assert (grid == grid[..., :1]).all()
    return grid[..., 0] / WATT_PER_CANDELA


def test_one_plane_is_the_same_all_around() -> None:
    polar = [0.0, 30.0, 60.0, 90.0]
    grid = grid_of(ies_file(1, [0.0], polar, [[5.0, 4.0, 3.0, 2.0]]))
    assert np.allclose(grid, grid[:, :1], rtol=1e-6)
    assert np.allclose(grid[[0, 60, 120, 180], 0], [5.0, 4.0, 3.0, 2.0])
    # Straight lines stay straight, and nothing goes up.
    assert np.allclose(grid[60:121, 0], np.linspace(4.0, 3.0, 61))
    assert not grid[181:].any()


@pytest.mark.parametrize("last", [90.0, 180.0])
def test_what_symmetry_leaves_out_is_mirrored(last: float) -> None:
    around = np.linspace(0.0, last, 4).tolist()
    values = [[1.0, 1.0], [2.0, 2.0], [5.0, 5.0], [3.0, 3.0]]
    grid = grid_of(ies_file(1, around, [0.0, 180.0], values))[90]
    assert np.allclose(grid, grid[::-1], atol=1e-5)
    if last == 90.0:
        assert np.allclose(grid[:360], grid[:360][::-1], atol=1e-5)
    near = [grid[np.abs(AROUND - angle).argmin()] for angle in around[1:3]]
    assert np.allclose(near, [2.0, 5.0], rtol=0.02)


def test_a_missing_last_angle_is_the_first() -> None:
    around = [0.0, 90.0, 180.0, 270.0]
    grid = grid_of(ies_file(1, around, [0.0, 180.0], [[v, v] for v in (1.0, 3.0, 2.0, 4.0)]))[90]
    # A cubic curve through its neighbours: (-1, 9, 9, -1) / 16 in the middle.
    middle = (9.0 * (4.0 + 1.0) - (2.0 + 3.0)) / 16.0
    assert grid[np.abs(AROUND - 315.0).argmin()] == pytest.approx(middle, rel=0.01)


def test_types_a_and_b_are_turned() -> None:
    angles = [-90.0, 0.0, 90.0]
    by_height = [[1.0, 2.0, 3.0]] * 3
    grid = grid_of(ies_file(3, angles, angles, by_height))
    ahead = np.abs(AROUND - 180.0).argmin()
    assert np.allclose(grid[[0, 180, 360], ahead], [1.0, 2.0, 3.0])
    assert not grid[180, AROUND < 90.0].any()
    # Of type B the axis lies: heights become angles around.
    grid = grid_of(ies_file(2, [0.0, 90.0], angles, [[1.0, 2.0, 3.0]] * 2))
    half = [grid[180, np.abs(AROUND - angle).argmin()] for angle in (0.0, 90.0, 180.0)]
    assert np.allclose(half, [1.0, 2.0, 3.0], atol=0.02)
    assert np.allclose(grid[:, 180], grid[::-1, 180])
    assert not grid[180, AROUND > 180.0].any()


def test_a_tilt_is_passed_over_and_so_is_what_follows() -> None:
    values = [[5.0, 4.0]]
    plain = ies_file(1, [0.0], [0.0, 90.0], values)
    tilted = ies_file(1, [0.0], [0.0, 90.0], values, tilt="INCLUDE\n1 2 0 90 1 0.5", tail="END")
    assert (grid_of(plain) == grid_of(tilted)).all()


@pytest.mark.parametrize("text", ["", "no\nfile", "\nTILT=NONE\n1 2 3", "\nTILT=NONE\nx"])
def test_what_is_no_ies_file_is_an_error(text: str) -> None:
    from addon.export.ies import parse

    with pytest.raises(ValueError, match=r".+"):
        parse(text)


def test_a_lamp_reads_its_file_and_bad_ones_are_named() -> None:
    add_camera()
    lamp: Any = bpy.data.lights.new("Lamp", "POINT")
    add_object("Lamp", lamp)
    lamp.use_nodes = True
    tree = lamp.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    texture = tree.nodes.new("ShaderNodeTexIES")
    tree.links.new(texture.outputs[0], emission.inputs["Strength"])
    (warning,) = export_now().warnings
    assert "the IES file of a texture cannot be read (no TILT line)" in warning
    texture.ies = bpy.data.texts.new("Lamp.ies")
    texture.ies.write(ies_file(1, [0.0], [0.0, 90.0], [[5.0, 4.0]]))
    frame = export_now()
    assert frame.warnings == []
    assert len(frame.images) == 1
