"""A scene with its reference, and pictures of it by the method under test."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualcone.chart.measures import DARK, Reference
from dualcone.chart.scene import Scene

Build = Callable[[], None]
Pictures = NDArray[np.float32]
Mask = NDArray[np.bool_]

IS_LONG = os.environ.get("DUALCONE_STABILITY") == "long"
SIZE = (128, 72) if IS_LONG else (64, 36)
REFERENCE_SAMPLES = 1024 if IS_LONG else 96  # of each half
SAMPLES = 16
PILOT = 2  # samples that Dual Cone shares everywhere
SEEDS = (1, 2, 3, 4) if IS_LONG else (1, 2)
BOUNCES = {"max_bounces": 4, "diffuse_bounces": 2, "glossy_bounces": 2}
# The method under test. Another one shows that these tests can fail: see docs/stability.md.
METHOD = {"method": os.environ.get("DUALCONE_STABILITY_METHOD", "DUAL_CONE"), "recheck": "NONE"}
PATH = {"method": "PATH"}


class Stage:
    """The scene that is open in Blender."""

    def __init__(self, frames: Sequence[int]) -> None:
        self.frames = frames
        self.scene = Scene()
        halves = [self.picture(PATH, REFERENCE_SAMPLES, seed) for seed in (100, 101)]
        self.truth = Reference(np.stack(halves))

    def picture(
        self, method: dict[str, Any], samples: int = SAMPLES, seed: int = 1, **more: Any
    ) -> Pictures:
        """Render all frames (frames, H, W, 3)."""
        settings = {**BOUNCES, **method, "samples": samples, "seed": seed, **more}
        return self.scene.render(self.frames, SIZE, settings).pictures

    def pictures(self, method: dict[str, Any], samples: int = SAMPLES, **more: Any) -> Pictures:
        """Render all frames with every seed (seeds, frames, H, W, 3)."""
        return np.stack([self.picture(method, samples, seed, **more) for seed in SEEDS])

    def shared(self, samples: int = SAMPLES) -> Pictures:
        """The same by the method under test where every pixel borrows, whatever that gains.

        Once it has rendered `PILOT` samples it may turn to path tracing, which hides what sharing
        does wrong. So each picture is the mean of many of so few samples.
        """
        parts = samples // PILOT
        return np.stack(
            [
                np.mean([self.picture(METHOD, PILOT, parts * s + k) for k in range(parts)], axis=0)
                for s in SEEDS
            ]
        )

    def error(self, method: dict[str, Any], **more: Any) -> float:
        """Mean relMSE over the seeds."""
        return float(np.mean([self.truth.relative_mse(p) for p in self.pictures(method, **more)]))

    def errors(self, pictures: Pictures) -> NDArray[np.float64]:
        """Relative errors of pictures (..., frames, H, W, 3), the reference's noise included."""
        truth = self.truth.pictures
        return (pictures - truth) / np.sqrt(truth**2 + DARK)

    def signed_error(self, pictures: Pictures, mask: Mask | None = None) -> float:
        """Sum of the errors over a mask (frames, H, W) as a share of the light there."""
        return float(self.tint(pictures, mask).mean())

    def tint(self, pictures: Pictures, mask: Mask | None = None) -> NDArray[np.float64]:
        """The same for each channel, over the light of all channels (3,)."""
        truth = self.truth.pictures
        where = np.ones(truth.shape[:-1], bool) if mask is None else mask
        errors = pictures.mean(axis=0)[where] - truth[where]
        return errors.sum(axis=0) / truth[where].sum(axis=0).mean()

    def edges(self, share: float) -> Mask:
        """The pixels where the reference changes most, `share` of all (frames, H, W)."""
        truth = self.truth.pictures.mean(axis=-1)
        steepness = np.zeros_like(truth)
        for axis in (1, 2):
            steepness += np.abs(np.gradient(np.log(truth + 0.05), axis=axis))
        return steepness > np.quantile(steepness, 1.0 - share)

    def uncovered(self) -> Mask:
        """The pixels that show another thing than a frame before, where colours tell that."""
        truth = self.truth.pictures
        change = np.abs(np.diff(truth, axis=0, prepend=truth[:1])).mean(axis=-1)
        return change > 0.15 * truth.mean()
