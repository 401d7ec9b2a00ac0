"""What the benches share: a sample of blend_samples/, its references, and pictures to look at."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

import local_addon
from dualcone.chart import scene
from dualcone.chart.measures import Reference
from dualcone.chart.scene import Rendering, Resolution, Scene, Settings, machine

local_addon.load()

__all__ = ["Rendering", "Resolution", "Sample", "enlarged", "machine", "reference", "save_picture"]

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "blend_samples"
REFERENCES = ROOT / "build" / "references"
JPEG_QUALITY = 90


class Sample(Scene):
    """A scene of blend_samples/."""

    def __init__(self, name: str) -> None:
        path = SAMPLES / f"{name}.blend"
        super().__init__(path)
        self.triangles: int = tomllib.loads(path.with_suffix(".toml").read_text())["triangles"]

    def make_overcast(self) -> None:
        """Swap world and lamps for the overcast sky of the sample `figure`."""
        scene = bpy.context.scene
        libraries: Any = bpy.data.libraries  # the stubs say that load returns nothing
        with libraries.load(str(SAMPLES / "figure.blend")) as (source, target):
            target.worlds = source.worlds[:1]
        scene.world = target.worlds[0]
        for lamp in [each for each in scene.objects if each.type == "LIGHT"]:
            bpy.data.objects.remove(lamp)
        self.name += ", overcast"
        self.forget_exports()


def reference(
    sample: Sample, frames: Sequence[int], resolution: Resolution, settings: Settings
) -> Reference:
    """Path trace `settings["samples"]` per pixel, or read what an earlier run left in build/."""
    return scene.reference(sample, frames, resolution, settings, REFERENCES)


def enlarged(picture: NDArray[Any], times: int) -> NDArray[Any]:
    """Repeat every pixel `times` in both directions."""
    return picture.repeat(times, axis=0).repeat(times, axis=1)


def save_picture(picture: NDArray[Any], path: Path) -> None:
    """Write radiance (H, W, 3) as the open scene shows it, as JPEG."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.quality = "JPEG", JPEG_QUALITY
    height, width, _ = picture.shape
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = picture
    image: Any = bpy.data.images.new(path.stem, width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)
