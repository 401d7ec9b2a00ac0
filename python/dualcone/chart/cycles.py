"""Cycles in the same process, on the same scene, towards the same picture."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

from .scene import Resolution, Scene


@dataclass(frozen=True)
class Timed:
    """Pictures (frames, H, W, 3) and seconds a frame: of light alone, and of all."""

    pictures: NDArray[np.float32]
    seconds: float
    cpu_seconds: float
    total_seconds: float


class Cycles:
    """Renders frames of the open scene and tells the time that goes into light.

    Cycles does not tell export, trees and sampling apart to the millisecond, so each frame is
    rendered once with a single sample: what more samples take beyond that is proportional to them.
    """

    def __init__(self, scene: Scene, resolution: Resolution) -> None:
        self._scene = scene
        self._resolution = resolution
        self._once: dict[int, tuple[float, float]] = {}

    def render(
        self, frames: Sequence[int], samples: int, seed: int, *, is_denoised: bool = False
    ) -> Timed:
        """Render frames one after the other."""
        pictures: list[NDArray[np.float32]] = []
        times: list[tuple[float, float, float]] = []
        for frame in frames:
            self._scene.go_to(frame, self._resolution)
            if frame not in self._once:
                self._shoot(1, 0, is_denoised=False)  # Loads kernels and, once, everything.
                self._once[frame] = self._shoot(1, 0, is_denoised=False)[1]
            picture, (wall, cpu) = self._shoot(samples, seed, is_denoised=is_denoised)
            fixed_wall, fixed_cpu = self._once[frame]
            share = samples / max(1, samples - 1)
            pictures.append(picture)
            times.append(
                (max(0.0, wall - fixed_wall) * share, max(0.0, cpu - fixed_cpu) * share, wall)
            )
        wall, cpu, total = np.mean(times, axis=0)
        return Timed(np.stack(pictures), float(wall), float(cpu), float(total))

    def _shoot(
        self, samples: int, seed: int, *, is_denoised: bool
    ) -> tuple[NDArray[np.float32], tuple[float, float]]:
        """Render one frame; return it with its wall and processor seconds."""
        scene: Any = bpy.context.scene
        prepare(scene, samples, seed, is_denoised=is_denoised)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frame.exr"
            scene.render.filepath = str(path)
            wall, cpu = time.perf_counter(), time.process_time()
            with silent():
                bpy.ops.render.render(write_still=True)
            times = time.perf_counter() - wall, time.process_time() - cpu
            return read(path), times


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Keep Blender from writing a line for each frame over the progress bar."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def without_bias(scene: Any, samples: int, seed: int) -> None:
    """Choose Cycles, without anything that trades bias for noise."""
    settings = scene.cycles
    scene.render.engine, settings.device = "CYCLES", "CPU"
    settings.samples, settings.seed = samples, seed
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.blur_glossy = 0.0
    settings.light_sampling_threshold = 0.0
    settings.caustics_reflective = settings.caustics_refractive = True


def prepare(scene: Any, samples: int, seed: int, *, is_denoised: bool) -> None:
    """Set up Cycles for a fair race."""
    render, settings = scene.render, scene.cycles
    without_bias(scene, samples, seed)
    render.threads_mode, render.threads = "FIXED", os.cpu_count() or 1
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    settings.pixel_filter_type, settings.filter_width = "BLACKMAN_HARRIS", 1.5
    settings.use_denoising = is_denoised
    if is_denoised:
        settings.denoiser = "OPENIMAGEDENOISE"
        settings.denoising_input_passes = "RGB_ALBEDO_NORMAL"
        settings.denoising_prefilter = "ACCURATE"
    image = render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    image.exr_codec = "NONE"


def can_denoise() -> bool:
    """Tell whether this Cycles was built with OpenImageDenoise."""
    return bool(importlib.import_module("_cycles").with_openimagedenoise)


def read(path: Path) -> NDArray[np.float32]:
    """Return the colours of an image file (H, W, 3), rows from the bottom up."""
    image: Any = bpy.data.images.load(str(path))
    try:
        width, height = image.size
        pixels = np.empty((height, width, image.channels), np.float32)
        image.pixels.foreach_get(pixels.ravel())
        return pixels[..., :3].copy()
    finally:
        bpy.data.images.remove(image)
