"""The edge to Blender: open a scene, export its frames, render them with DualCone."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

import dualcone

from .measures import Pictures, Reference

POLL_SECONDS = 0.2
REFERENCE_SEED = 1000  # so that no reference shares its noise with what it judges
# The add-on: of a checkout, where Python was started in one, or as Blender installs extensions.
ADDONS = ("addon", "bl_ext.user_default.dualcone")
# What a fresh render may differ from a stored reference before that is made again.
CHECK_SAMPLES = 16
CHECK_SCORE = 4.0
CHECK_FLOOR = 1e-4

Resolution = tuple[int, int]
Settings = Mapping[str, bool | int | float | str]


class SceneError(Exception):
    """The scene cannot be charted; the message is for the user."""


@cache
def addon(module: str) -> Any:
    """Return a module of the DualCone add-on.

    Raises:
        SceneError: the add-on is not to be found.
    """
    for package in ADDONS:
        try:
            return importlib.import_module(f"{package}.{module}")
        except ModuleNotFoundError as error:
            if not package.startswith(error.name or "?"):
                raise
    raise SceneError(
        "The DualCone add-on is not to be found: start Python in a checkout, or install it"
    )


@dataclass(frozen=True)
class Rendering:
    """Pictures, and what one of them took on average."""

    pictures: Pictures
    # By phase: export, build, pass_1, pass_2, resolve, denoise.
    seconds: dict[str, float]
    # Of all threads: unlike the seconds by phase it does not grow when others use the machine.
    cpu_seconds: float
    rays: float
    pixel_memory_bytes: int

    @property
    def lighting_seconds(self) -> float:
        """Seconds of both passes and of the denoiser, as spent."""
        return sum(self.seconds.get(name, 0.0) for name in ("pass_1", "pass_2", "denoise"))

    @property
    def lighting_cpu_seconds(self) -> float:
        """Processor time of the same, with what frames around cost that only lend."""
        rendering = sum(self.seconds.values()) - self.seconds["export"]
        return self.cpu_seconds * self.lighting_seconds / rendering


class Scene:
    """A .blend, opened in Blender, or what is open there; only the last one can be rendered."""

    def __init__(self, path: Path | None = None) -> None:
        if path is not None:
            if not path.exists():
                raise SceneError(f"{path}: no such file")
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
        self.name = path.stem if path else "open scene"
        self.cache = addon("export.cache").ExportCache()
        self._exported: dict[tuple[int, Resolution], Any] = {}

    @property
    def settings(self) -> Settings:
        """The light paths and the film that the scene asks Cycles for, as settings of DualCone."""
        scene: Any = bpy.context.scene
        names = (str(spec["name"]) for spec in dualcone.contract()["settings"])
        names = (n for n in names if n.endswith("_bounces") or n.startswith("film_transparent_"))
        shared = [name for name in names if hasattr(scene.cycles, name)]
        return {
            **{name: getattr(scene.cycles, name) for name in shared},
            "film_transparent": bool(scene.render.film_transparent),
        }

    def forget_exports(self) -> None:
        """Export every frame again: the scene was changed."""
        self._exported.clear()

    def go_to(self, frame: int, resolution: Resolution) -> None:
        """Move the scene to `frame` and set the size of its picture."""
        scene: Any = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = resolution
        scene.render.resolution_percentage = 100
        scene.frame_set(frame)

    def export(self, frame: int, resolution: Resolution) -> Any:
        """Move the scene to `frame` and export it, even if that was done before."""
        self.go_to(frame, resolution)
        scene: Any = bpy.context.scene
        depsgraph = bpy.context.evaluated_depsgraph_get()
        export_frame = addon("export.frame").export_frame
        return export_frame(
            depsgraph,
            frame,
            resolution,
            self.cache,
            dualcone,
            lambda: False,
            lambda to, subframe: scene.frame_set(to, subframe=subframe),
        )

    def exported(self, frame: int, resolution: Resolution) -> Any:
        """Export a frame, or return what its first export returned."""
        key = (frame, resolution)
        if key not in self._exported:
            self._exported[key] = self.export(frame, resolution)
        return self._exported[key]

    def digest(self, frames: Sequence[int], resolution: Resolution) -> str:
        """Name what these frames show."""
        content = hashlib.blake2b(json.dumps([*frames, *resolution]).encode(), digest_size=16)
        for frame in frames:
            content.update(self.exported(frame, resolution).content_hash)
        return content.hexdigest()

    def render(
        self,
        targets: Sequence[int],
        resolution: Resolution,
        settings: Settings,
        *,
        is_denoised: bool = False,
        threads: int = 0,
    ) -> Rendering:
        """Render the frames `targets` together, on all cores or on this many threads."""
        numbers = dualcone.window_frames(settings, targets, 1)
        exported = [self.exported(number, resolution) for number in numbers]
        frames = [dualcone.SceneFrame(e.frame, e.meshes, e.images, e.arrays) for e in exported]
        width, height = resolution
        region: Any = {"width": width, "height": height, "x_min": 0, "y_min": 0}
        region |= {"x_max": width, "y_max": height}
        started = time.process_time()
        job = dualcone.Render(frames, targets, 1, region, settings, threads or os.cpu_count() or 1)
        while not job.wait(POLL_SECONDS):
            pass
        results: list[Any] = [job.result(target) for target in targets]
        export = float(np.median([e.seconds for e in exported])) * len(numbers) / len(targets)
        report = results[0]["report"]
        seconds = {"export": export, **report["seconds"]}
        pictures = np.stack([result["passes"]["Combined"][..., :3] for result in results])
        if is_denoised:
            since = time.perf_counter()
            pictures = np.stack([denoised(result["passes"]) for result in results])
            seconds["denoise"] = (time.perf_counter() - since) / len(targets)
        return Rendering(
            pictures,
            seconds,
            (time.process_time() - started) / len(targets),
            report["rays"],
            report["pixel_memory_bytes"],
        )


def denoised(passes: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return a frame (H, W, 3) after OpenImageDenoise."""
    picture = addon("denoise").denoise(*(passes[n] for n in ("Combined", "Albedo", "Normal")))
    return picture[..., :3]


def reference(
    scene: Scene,
    frames: Sequence[int],
    resolution: Resolution,
    settings: Settings,
    folder: Path,
) -> Reference:
    """Path trace `settings["samples"]` per pixel, or read what an earlier run left in `folder`.

    What is kept is found by the scene's content and the settings. One that another build of the
    renderer has left is used if a few samples of this build agree with it.
    """
    settings = {**settings, "method": "PATH", "samples": max(1, int(settings["samples"]) // 2)}
    words = json.dumps([settings, scene.digest(frames, resolution)], sort_keys=True)
    path = folder / f"{hashlib.blake2b(words.encode(), digest_size=16).hexdigest()}.npz"
    if path.exists():
        with np.load(path) as stored:
            kept, build = Reference(stored["halves"]), str(stored["build"])
        if build == core_digest() or _agrees(scene, frames, resolution, settings, kept):
            return kept
    seeds = (REFERENCE_SEED, REFERENCE_SEED + 1)
    halves = [scene.render(frames, resolution, {**settings, "seed": seed}) for seed in seeds]
    made = np.stack([half.pictures for half in halves])
    folder.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".part.npz")
    np.savez(partial, halves=made, build=core_digest())
    partial.replace(path)
    return Reference(made)


def _agrees(
    scene: Scene,
    frames: Sequence[int],
    resolution: Resolution,
    settings: Settings,
    kept: Reference,
) -> bool:
    seeds = (REFERENCE_SEED + 2, REFERENCE_SEED + 3)
    quick = {**settings, "samples": CHECK_SAMPLES}
    first, second = (scene.render(frames, resolution, {**quick, "seed": seed}) for seed in seeds)
    difference, error = kept.squared_difference(first.pictures, second.pictures)
    return difference < CHECK_SCORE * error + CHECK_FLOOR


@cache
def core_digest() -> str:
    """Hash of the compiled module."""
    content = hashlib.blake2b(digest_size=16)
    for path in sorted(Path(str(dualcone.__file__)).parent.iterdir()):
        if path.suffix in (".so", ".pyd"):
            content.update(path.read_bytes())
    return content.hexdigest()


def machine() -> str:
    """Name the processor, the threads in use, and how busy the machine is with other work."""
    name = "unknown processor"
    facts = Path("/proc/cpuinfo")
    if facts.exists():
        models = [line for line in facts.read_text().splitlines() if line.startswith("model name")]
        name = models[0].partition(":")[2].strip() if models else name
    busy = f", load average {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{name}, {os.cpu_count()} threads{busy}"
