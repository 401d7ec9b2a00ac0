"""What the benches share: open a sample, render its frames by a method, judge the pictures.

A sequence of pictures is an array (frames, H, W, 3) of scene-linear radiance, the lowest row first.
The measures are relative to a reference R, with (R^2 + 0.01) keeping dark pixels from ruling them.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

import dualcone
import local_addon
from dualcone import dualcone as core

local_addon.load()
from addon.export.cache import ExportCache  # noqa: E402
from addon.export.frame import ExportedFrame, export_frame  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "blend_samples"
REFERENCES = ROOT / "build" / "references"
POLL_SECONDS = 0.2
DARK = 0.01  # added to R^2
REFERENCE_SEED = 1000  # so that no reference shares its noise with what it judges
JPEG_QUALITY = 90

Pictures = NDArray[np.float32]
Resolution = tuple[int, int]
Settings = Mapping[str, bool | int | float | str]


@dataclass(frozen=True)
class Rendering:
    """Pictures, and what one of them took on average."""

    pictures: Pictures
    # By phase: export, build, pass_1, pass_2, resolve.
    seconds: dict[str, float]
    # Of all threads: unlike the seconds by phase it does not grow when others use the machine.
    cpu_seconds: float
    # Frames that were traced for each one that was rendered: windows overlap.
    traced: float
    pixel_memory_bytes: int

    @property
    def frame_seconds(self) -> dict[str, float]:
        """Seconds by phase where windows do not overlap, so that each frame is traced once.

        A long animation, rendered many frames together, comes near that.
        """
        once = {"export", "build", "pass_1"}
        shared = {name: self.seconds[name] / self.traced for name in once}
        return {**self.seconds, **shared}

    @property
    def sampling_cpu_seconds(self) -> float:
        """Processor time of both passes, each frame traced once."""
        rendering = sum(self.seconds.values()) - self.seconds["export"]
        sampling = self.frame_seconds["pass_1"] + self.frame_seconds["pass_2"]
        return self.cpu_seconds * sampling / rendering


class Sample:
    """A .blend of blend_samples/, opened in Blender; only the one opened last can be rendered."""

    def __init__(self, name: str) -> None:
        path = SAMPLES / f"{name}.blend"
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
        self.name = name
        self.triangles: int = tomllib.loads(path.with_suffix(".toml").read_text())["triangles"]
        self.cache = ExportCache()
        self._exported: dict[tuple[int, Resolution], ExportedFrame] = {}

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
        self._exported.clear()

    def export(self, frame: int, resolution: Resolution) -> ExportedFrame:
        """Move the scene to `frame` and export it, even if that was done before."""
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = resolution
        scene.render.resolution_percentage = 100
        scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return export_frame(depsgraph, frame, resolution, self.cache, dualcone, lambda: False)

    def exported(self, frame: int, resolution: Resolution) -> ExportedFrame:
        """Export a frame, or return what its first export returned."""
        key = (frame, resolution)
        if key not in self._exported:
            self._exported[key] = self.export(frame, resolution)
        return self._exported[key]

    def render(
        self, targets: Sequence[int], resolution: Resolution, settings: Settings
    ) -> Rendering:
        """Render the frames `targets` together, on all cores."""
        numbers = dualcone.window_frames(settings, targets, 1)
        exported = [self.exported(number, resolution) for number in numbers]
        frames = [dualcone.SceneFrame(e.frame, e.meshes, e.images, e.arrays) for e in exported]
        width, height = resolution
        region: core.Region = {
            "width": width,
            "height": height,
            "x_min": 0,
            "y_min": 0,
            "x_max": width,
            "y_max": height,
        }
        started = time.process_time()
        job = dualcone.Render(frames, targets, 1, region, settings, os.cpu_count() or 1)
        while not job.wait(POLL_SECONDS):
            pass
        cpu_seconds = time.process_time() - started
        results = [job.result(target) for target in targets]
        export = float(np.median([e.seconds for e in exported])) * len(numbers) / len(targets)
        report = results[0]["report"]
        return Rendering(
            np.stack([result["passes"]["Combined"][..., :3] for result in results]),
            {"export": export, **report["seconds"]},
            cpu_seconds / len(targets),
            len(numbers) / len(targets),
            report["pixel_memory_bytes"],
        )


@dataclass(frozen=True)
class Reference:
    """Two independent path-traced halves: their mean is the reference, their difference its noise.

    What the noise adds to a measure is subtracted from it.
    """

    halves: NDArray[np.float32]  # (2, frames, H, W, 3)

    @property
    def pictures(self) -> NDArray[np.float64]:
        return self.halves.mean(axis=0, dtype=np.float64)

    def relative_mse(self, pictures: Pictures) -> float:
        """Return mean((I - R)^2 / (R^2 + 0.01))."""
        return mean_square(self._errors(pictures)) - mean_square(self._noise())

    def flicker(self, pictures: Pictures) -> float:
        """Return the RMS of e_t - e_(t-1) with e_t = (I_t - R_t) / sqrt(R_t^2 + 0.01)."""
        change = mean_square(np.diff(self._errors(pictures), axis=0))
        noise = mean_square(np.diff(self._noise(), axis=0))
        return float(np.sqrt(max(change - noise, 0.0)))

    def energy_ratio(self, pictures: Pictures) -> float:
        """Return sum I / sum R."""
        return float(pictures.sum(dtype=np.float64) / self.pictures.sum())

    def _errors(self, pictures: Pictures) -> NDArray[np.float64]:
        return (pictures - self.pictures) / self._scale()

    def _noise(self) -> NDArray[np.float64]:
        return (self.halves[0].astype(np.float64) - self.halves[1]) / 2 / self._scale()

    def _scale(self) -> NDArray[np.float64]:
        return np.sqrt(self.pictures**2 + DARK)


def mean_square(values: NDArray[np.float64]) -> float:
    return float(np.mean(values**2))


def reference(
    sample: Sample, frames: Sequence[int], resolution: Resolution, settings: Settings
) -> Reference:
    """Path trace `settings["samples"]` per pixel, or read what an earlier run has left in build/.

    What is kept is found by all that the pictures depend on, the renderer's own code included.
    """
    settings = {**settings, "method": "PATH", "samples": max(1, int(settings["samples"]) // 2)}
    content = hashlib.blake2b(core_digest(), digest_size=16)
    content.update(json.dumps([settings, frames, resolution], sort_keys=True).encode())
    for frame in frames:
        content.update(sample.exported(frame, resolution).content_hash)
    path = REFERENCES / f"{content.hexdigest()}.npy"
    if not path.exists():
        seeds = (REFERENCE_SEED, REFERENCE_SEED + 1)
        halves = [sample.render(frames, resolution, {**settings, "seed": seed}) for seed in seeds]
        REFERENCES.mkdir(parents=True, exist_ok=True)
        np.save(path, np.stack([half.pictures for half in halves]))
    return Reference(np.load(path))


@cache
def core_digest() -> bytes:
    """Hash of the compiled module."""
    return hashlib.blake2b(Path(str(core.__file__)).read_bytes(), digest_size=16).digest()


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


def machine() -> str:
    """Name the processor, the threads in use, and how busy the machine is with other work."""
    name = "unknown processor"
    facts = Path("/proc/cpuinfo")
    if facts.exists():
        models = [line for line in facts.read_text().splitlines() if line.startswith("model name")]
        name = models[0].partition(":")[2].strip() if models else name
    busy = f", load average {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{name}, {os.cpu_count()} threads{busy}"
