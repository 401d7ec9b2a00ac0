"""PATH against Cycles pixel by pixel, and the energy of DUAL_CONE against that of PATH."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from addon.engine import passes
from numpy.typing import NDArray
from shots import read, write_single_layer

from dualcone.chart.cycles import without_bias

SAMPLES = Path(__file__).resolve().parents[2] / "blend_samples"
COLUMNS, ROWS = 64, 48
SPP = 64
Picture = NDArray[np.float64]  # (ROWS, COLUMNS, 3)
Pair = tuple[Picture, Picture]  # the same picture with other noise


def solids() -> dict[str, int]:
    """A cube and a sphere on a floor, all diffuse, under a sun and a grey sky."""
    bpy.ops.mesh.primitive_plane_add(size=12.0)
    floor: Any = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(location=(-1.2, 0.3, 1.0), rotation=(0.0, 0.0, 0.5))
    cube: Any = bpy.context.object
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(1.3, 0.0, 1.0))
    bpy.ops.object.shade_smooth()
    sphere: Any = bpy.context.object
    for thing, color in (
        (floor, (0.7, 0.7, 0.6)),
        (cube, (0.8, 0.2, 0.1)),
        (sphere, (0.2, 0.5, 0.8)),
    ):
        thing.data.materials.append(matt(color))
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.4, 0.3))
    sun: Any = bpy.context.object
    sun.data.energy, sun.data.angle = 2.0, 0.1
    bpy.ops.object.camera_add(location=(0.0, -7.0, 3.0), rotation=(1.2, 0.0, 0.0))
    scene: Any = bpy.context.scene
    scene.camera = bpy.context.object
    scene.world = grey_sky(0.4)
    return {"max_bounces": 2, "diffuse_bounces": 2, "glossy_bounces": 2}


def matt(color: tuple[float, float, float]) -> Any:
    material: Any = bpy.data.materials.new("Matt")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Roughness"].default_value = 1.0
    inputs["Specular IOR Level"].default_value = 0.0
    return material


def grey_sky(radiance: float) -> Any:
    world: Any = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    color = world.node_tree.nodes["Background"].inputs["Color"]
    color.default_value = (radiance, radiance, radiance, 1.0)
    return world


def stadium() -> dict[str, int]:
    """The sample with an image as sky, thin beams, and a ground of 3 km in two triangles."""
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / "stadium.blend"), load_ui=False)
    scene: Any = bpy.context.scene
    scene.frame_set(20)
    return {"max_bounces": 12, "diffuse_bounces": 4, "glossy_bounces": 4}


Build = Callable[[], dict[str, int]]


@pytest.fixture(params=[solids, stadium])
def shot(request: pytest.FixtureRequest, scene: Any) -> Any:
    """One of the scenes, small, with the same light paths in both engines."""
    build: Build = request.param
    bounces = build()
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = COLUMNS, ROWS, 100
    render.threads_mode, render.threads = "FIXED", 2
    render.film_transparent = False
    scene.cycles.transparent_max_bounces = 8
    for name, count in bounces.items():
        setattr(scene.cycles, name, count)
        setattr(scene.dualcone, name, count)
    return scene


def cycles(scene: Any, samples: int, seed: int, folder: Path) -> Picture:
    """Render with Cycles."""
    without_bias(scene, samples, seed)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    write_single_layer(scene)
    scene.render.filepath = str(folder / f"cycles{seed}.exr")
    bpy.ops.render.render(write_still=True)
    return read(Path(scene.render.filepath)).reshape(ROWS, COLUMNS, 4)[..., :3].astype(np.float64)


def ours(
    scene: Any, method: str, samples: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> Picture:
    """Render with DualCone and take what it hands to Blender."""
    scene.render.engine = "DUALCONE"
    scene.dualcone.method = method
    scene.dualcone.samples, scene.dualcone.seed = samples, seed
    pictures: list[Picture] = []
    with monkeypatch.context() as patch:
        patch.setattr(
            passes.Canvas, "write", lambda _canvas, pixels: pictures.append(pixels["Combined"])
        )
        bpy.ops.render.render()
    return pictures[0][..., :3].astype(np.float64)


def energy(pair: Pair) -> NDArray[np.float64]:
    """Mean of each channel."""
    return np.mean(pair, axis=(0, 1, 2))


def squared_bias(ours: Pair, theirs: Pair, weight: Picture) -> float:
    """Squared difference of two expectations, weighted, from two renders of each.

    The four noises are independent and of zero mean: their products have none left, unlike the
    square of one difference.
    """
    (x, y), (a, b) = ours, theirs
    return float(((x - a) * (y - b) * weight).mean())


def test_path_is_cycles(shot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Energy within 1 % in each channel, relMSE beyond the noise of both at most 1e-3.

    A single render at 64 samples has a relMSE of 4e-4 (solids) to 4e-3 (stadium) in either engine.
    Measured over the 3072 pixels, that leaves a standard error of at most 2.2e-4 in the squared
    bias and of 0.13 % in the ratio of energies: the bounds are four and seven of them away.
    """
    theirs = cycles(shot, SPP, 0, tmp_path), cycles(shot, SPP, 1, tmp_path)
    mine = ours(shot, "PATH", SPP, 2, monkeypatch), ours(shot, "PATH", SPP, 3, monkeypatch)
    reference = 0.5 * (theirs[0] + theirs[1])
    assert squared_bias(mine, theirs, 1.0 / (reference**2 + 0.01)) < 1e-3
    np.testing.assert_allclose(energy(mine), energy(theirs), rtol=0.01)


def test_dual_cone_keeps_the_energy_of_path(shot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within 1 % in each channel; the noise of either is as above or less."""
    dual_cone, path = (
        (ours(shot, method, SPP, 4, monkeypatch), ours(shot, method, SPP, 5, monkeypatch))
        for method in ("DUAL_CONE", "PATH")
    )
    np.testing.assert_allclose(energy(dual_cone), energy(path), rtol=0.01)
