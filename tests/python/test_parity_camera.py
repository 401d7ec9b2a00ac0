"""Every kind of camera against Cycles: glowing cubes at many distances before a grey world."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from test_parity import COLUMNS, ROWS, cycles, energy, grey_sky, ours, squared_bias

SPP = 200


def cubes() -> None:
    """Forty cubes in all directions, each with a colour of its own, that only shine."""
    random = np.random.default_rng(2)
    for _ in range(40):
        direction = random.normal(size=3)
        distance = random.uniform(2.0, 9.0)
        bpy.ops.mesh.primitive_cube_add(
            size=random.uniform(0.1, 0.3) * distance,
            location=tuple(distance * direction / np.linalg.norm(direction)),
            rotation=tuple(random.uniform(0.0, 3.0, 3)),
        )
        material: Any = bpy.data.materials.new("Glow")
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        inputs["Specular IOR Level"].default_value = 0.0
        inputs["Emission Color"].default_value = (*random.uniform(0.1, 1.0, 3), 1.0)
        inputs["Emission Strength"].default_value = 1.0
        bpy.context.object.data.materials.append(material)


def blades(data: Any) -> None:
    data.lens, data.dof.use_dof = 20.0, True
    data.dof.focus_distance, data.dof.aperture_fstop = 3.0, 0.05
    data.dof.aperture_blades, data.dof.aperture_rotation = 3, 0.4
    data.dof.aperture_ratio = 2.0


def along_the_axis(data: Any) -> None:
    data.type, data.ortho_scale, data.shift_x = "ORTHO", 8.0, 0.2
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 3.0, 1.0


def panorama(kind: str) -> Callable[[Any], None]:
    def make(data: Any) -> None:
        data.type = "PANO"
        holder = data if hasattr(data, "panorama_type") else data.cycles
        holder.panorama_type = kind

    return make


@pytest.mark.parametrize(
    "make",
    [
        blades,
        along_the_axis,
        *map(panorama, ["EQUIRECTANGULAR", "FISHEYE_EQUISOLID", "MIRRORBALL"]),
    ],
    ids=["blades", "axis", "equirectangular", "fisheye", "ball"],
)
def test_a_camera_sees_what_it_sees_in_cycles(
    make: Callable[[Any], None], scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cubes()
    bpy.ops.object.camera_add(rotation=(1.2, 0.1, 0.4))
    scene = bpy.context.scene
    scene.camera, scene.world = bpy.context.object, grey_sky(0.1)
    make(scene.camera.data)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = COLUMNS, ROWS, 100
    render.threads_mode, render.threads = "FIXED", 2
    theirs = (cycles(scene, SPP, 1, tmp_path), cycles(scene, SPP, 2, tmp_path))
    mine = (ours(scene, "PATH", SPP, 1, monkeypatch), ours(scene, "PATH", SPP, 2, monkeypatch))
    # The standard error of the energy is below 0.1 %, that of the bias is 1e-5 of the mean square.
    assert np.allclose(energy(mine), energy(theirs), rtol=5e-3)
    assert squared_bias(mine, theirs, np.ones_like(mine[0])) < 1e-4 * np.square(theirs[0]).mean()
