"""OpenImageDenoise behind the checkbox, and Blender's own Denoise node behind the button."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from addon import denoise, denoise_node
from addon.engine import passes
from shots import moving_cube, still

SHAPE = (32, 48)


@pytest.fixture
def noisy() -> dict[str, np.ndarray]:
    """A grey step on two materials, with noise of standard deviation 0.2."""
    random = np.random.default_rng(1)
    albedo = np.full((*SHAPE, 3), 0.3, np.float32)
    albedo[:, 24:] = 0.8
    normal = np.zeros((*SHAPE, 3), np.float32)
    normal[..., 2] = 1.0
    combined = np.concatenate([albedo, np.ones((*SHAPE, 1), np.float32)], axis=-1)
    combined[..., :3] *= np.maximum(0, 1 + random.normal(0, 0.2, (*SHAPE, 3))).astype(np.float32)
    return {"Combined": combined, "Albedo": albedo, "Normal": normal}


def test_this_blender_brings_the_library() -> None:
    """The bpy wheels do; a Blender that does not says so in words."""
    assert denoise.problem() is None


def test_noise_goes_and_edges_and_alpha_stay(noisy: dict[str, np.ndarray]) -> None:
    clean = denoise.denoise(noisy["Combined"], noisy["Albedo"], noisy["Normal"])
    assert clean.shape == (*SHAPE, 4)
    np.testing.assert_array_equal(clean[..., 3], 1.0)
    before, after = (
        np.abs(p[..., :3] / noisy["Albedo"] - 1).mean() for p in (noisy["Combined"], clean)
    )
    assert after < 0.25 * before
    assert clean[:, 23, 0].mean() < 0.4
    assert clean[:, 24, 0].mean() > 0.65


def test_the_same_noise_gives_the_same_picture(noisy: dict[str, np.ndarray]) -> None:
    first, second = (
        denoise.denoise(noisy["Combined"], noisy["Albedo"], noisy["Normal"]) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, np.ndarray]]:
    """Collect what the engine hands to Blender."""
    written: list[dict[str, np.ndarray]] = []
    monkeypatch.setattr(passes.Canvas, "write", lambda _, pixels: written.append(dict(pixels)))
    return written


def test_the_checkbox_denoises_combined_and_keeps_the_noise_in_a_pass(
    scene: Any, tmp_path: Path, written: list[dict[str, np.ndarray]]
) -> None:
    moving_cube(scene, tmp_path)
    scene.view_layers[0].dualcone.use_pass_noisy_image = True
    scene.render.resolution_x, scene.render.resolution_y = 48, 32
    lamp: Any = bpy.data.lights.new("Lamp", "AREA")
    lamp.energy, lamp.size = 500.0, 4.0
    thing = bpy.data.objects.new("Lamp", lamp)
    thing.location = (0.0, 0.0, 5.0)
    scene.collection.objects.link(thing)
    scene.dualcone.method, scene.dualcone.samples = "PATH", 1
    still(scene, 1)
    scene.dualcone.denoise = True
    still(scene, 1)
    plain, clean = written
    np.testing.assert_array_equal(plain["Combined"], plain["Noisy Image"])
    np.testing.assert_array_equal(plain["Combined"], clean["Noisy Image"])

    def roughness(picture: np.ndarray) -> float:
        return float(np.abs(np.diff(picture[..., :3], axis=1)).mean())

    assert roughness(clean["Combined"]) < 0.7 * roughness(clean["Noisy Image"])
    assert clean["Combined"].sum() == pytest.approx(plain["Combined"].sum(), rel=0.05)


def test_without_the_library_the_picture_stays_noisy_and_the_user_is_told(
    scene: Any,
    tmp_path: Path,
    written: list[dict[str, np.ndarray]],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(denoise, "problem", lambda: "there is no library")
    moving_cube(scene, tmp_path)
    scene.view_layers[0].dualcone.use_pass_noisy_image = True
    scene.dualcone.denoise = True
    still(scene, 1)
    np.testing.assert_array_equal(written[0]["Combined"], written[0]["Noisy Image"])
    assert "not denoised: there is no library" in capfd.readouterr().out


def test_the_button_wires_blenders_own_node(scene: Any) -> None:
    scene.dualcone.denoise = True
    assert bpy.ops.render.dualcone_denoise_node() == {"FINISHED"}
    assert not scene.dualcone.denoise
    assert scene.dualcone.share == "FRAMES"
    tree = denoise_node.compositor(scene)
    node = denoise_node.node(tree, "CompositorNodeDenoise")
    sources = {
        link.to_socket.name: link.from_socket.name for link in tree.links if link.to_node == node
    }
    assert sources == {"Image": "Image", "Normal": "Normal", "Albedo": "Albedo"}
    assert [link.from_node.bl_idname for link in tree.links if link.from_node == node]
    count = len(tree.nodes)
    bpy.ops.render.dualcone_denoise_node()
    assert len(tree.nodes) == count
