"""A stand-in for the compiled renderer, for tests of what surrounds it.

It traces nothing. The colour of a frame tells from which scenes and settings it was made, so that a
stale frame, or one that depends on how frames were grouped, is seen.
"""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

import dualcone

__version__ = dualcone.__version__
contract = dualcone.contract
operations = dualcone.operations


@dataclass(init=False)
class Mesh:
    """Holds arrays."""

    arrays: dict[str, np.ndarray]

    def __init__(self, **arrays: np.ndarray) -> None:
        self.arrays = arrays

    @property
    def vertices(self) -> np.ndarray:
        return self.arrays["vertices"]

    @property
    def triangle_count(self) -> int:
        return len(self.arrays["triangles"])

    def moving(self, motion_vertices: np.ndarray) -> Mesh:
        return Mesh(**self.arrays, motion_vertices=motion_vertices)

    def filled(
        self, grids: list[tuple[int, Grid]], texture_space: np.ndarray, is_scaled: bool
    ) -> Mesh:
        voxels = {f"grid_{key}": grid.arrays["voxels"] for key, grid in grids}
        return Mesh(**self.arrays, **voxels, texture_space=texture_space)


@dataclass(init=False)
class Grid:
    """Holds arrays."""

    arrays: dict[str, np.ndarray]

    def __init__(self, **arrays: np.ndarray) -> None:
        self.arrays = arrays


@dataclass(init=False)
class Image:
    """Holds pixels and how they are read."""

    content: tuple[object, ...]
    replaced_texels: ClassVar[int] = 0

    def __init__(self, *content: object) -> None:
        self.content = content


@dataclass
class SceneFrame:
    """Holds a frame."""

    frame: int
    meshes: list[Mesh]
    images: list[Image]
    arrays: dict[str, np.ndarray]

    def digest(self) -> bytes:
        """Hash all that was exported."""
        content = hashlib.blake2b(digest_size=16)
        for arrays in [self.arrays, *(mesh.arrays for mesh in self.meshes)]:
            for name in sorted(arrays):
                content.update(np.ascontiguousarray(arrays[name]).tobytes())
        return content.digest()


def window_frames(settings: dict[str, Any], targets: list[int], step: int) -> list[int]:
    """Return the targets and half a window around each."""
    return sorted({frame for target in targets for frame in window(settings, target, step)})


def window(settings: dict[str, Any], target: int, step: int) -> list[int]:
    """Return the frames that lend to a target."""
    half = settings["window"] // 2
    return [target + i * step for i in range(-half, half + 1)]


class Render:
    """Takes `seconds` and then has its frames, or fails with `failure`."""

    seconds: ClassVar[float] = 0.0
    failure: ClassVar[str | None] = None
    started: ClassVar[list[Render]] = []

    def __init__(
        self,
        frames: list[SceneFrame],
        targets: list[int],
        step: int,
        region: dict[str, int],
        settings: dict[str, Any],
        threads: int,
        passes: list[str] | None = None,
    ) -> None:
        if not frames:
            raise ValueError("frames: there are none")
        self.frames = {frame.frame: frame for frame in frames}
        self.targets, self.step, self.threads = targets, step, threads
        self.region, self.settings = region, settings
        self.passes = passes or ["Combined"]
        self.is_cancelled = False
        self._end = time.monotonic() + self.seconds
        Render.started.append(self)

    def progress(self) -> dict[str, Any]:
        return {
            "phase": "sample",
            "samples_done": 1,
            "samples_total": self.settings["samples"],
            "fraction": 0.5,
            "seconds_elapsed": 1.0,
            "seconds_left": 61.0,
            "rays": 10,
            "memory_bytes": 1 << 20,
        }

    def cancel(self) -> None:
        self.is_cancelled = True

    def wait(self, seconds: float) -> bool:
        left = self._end - time.monotonic()
        time.sleep(max(0.0, min(seconds, left)))
        return left <= seconds

    def preview(self, frame: int) -> np.ndarray | None:
        return self._pixels(4)

    def result(self, frame: int) -> dict[str, Any]:
        if self.failure:
            raise RuntimeError(self.failure)
        seed = self._digest(frame)
        passes = {
            spec["name"]: self._pixels(len(spec["channels"])) + seed[i]
            for i, spec in enumerate(contract()["passes"])
            if spec["name"] in self.passes
        }
        report = {
            "seconds": {"build": 0.1, "pass_1": 0.2, "pass_2": 0.3, "resolve": 0.4},
            "rays": 5,
            "samples": self.settings["samples"],
        }
        return {"passes": passes, "report": report}

    def _digest(self, frame: int) -> bytes:
        settings = {k: v for k, v in self.settings.items() if k != "frames_together"}
        content = hashlib.blake2b(repr((frame, self.region, sorted(settings.items()))).encode())
        for neighbour in window(self.settings, frame, self.step):
            content.update(self.frames[neighbour].digest())
        return content.digest()

    def _pixels(self, channels: int) -> np.ndarray:
        """Count up, so that a transposed or shifted image is seen."""
        rows = self.region["y_max"] - self.region["y_min"]
        columns = self.region["x_max"] - self.region["x_min"]
        count = np.arange(rows * columns * channels, dtype=np.float32)
        return count.reshape(rows, columns, channels)
