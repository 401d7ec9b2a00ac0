"""How wrong pictures are, and how much they flicker (docs/method.md, "Measures").

A sequence of pictures is an array (frames, H, W, 3) of scene-linear radiance. Errors are relative:
e = (I - R) / sqrt(R^2 + DARK), so that neither dark nor bright pixels
rule a mean.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

DARK = 0.01  # added to R^2
WORST_SHARE = 0.001  # of the pixels, left out of the trimmed mean

Pictures = NDArray[Any]
Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """Two independent, unbiased halves: their mean is the reference, their difference its noise.

    What that noise adds to a measure is subtracted from it.
    """

    halves: NDArray[np.float32]  # (2, frames, H, W, 3)

    @property
    def pictures(self) -> Doubles:
        return self.halves.mean(axis=0, dtype=np.float64)

    def relative_mse(self, pictures: Pictures) -> float:
        """Return mean((I - R)^2 / (R^2 + DARK))."""
        return float(self.relative_mse_by_frame(pictures).mean())

    def relative_mse_by_frame(self, pictures: Pictures) -> Doubles:
        """Return the same for each frame (frames,)."""
        return by_frame(self._errors(pictures)) - by_frame(self._noise())

    def trimmed_by_frame(self, pictures: Pictures) -> Doubles:
        """Return the relative MSE of each frame without its worst pixels, WORST_SHARE of all."""
        squares = (self._errors(pictures) ** 2 - self._noise() ** 2).mean(axis=-1)
        squares = np.sort(squares.reshape(len(squares), -1), axis=1)
        kept = squares.shape[1] - int(np.ceil(WORST_SHARE * squares.shape[1]))
        return squares[:, :kept].mean(axis=1)

    def changes(self, pictures: Pictures) -> Doubles:
        """Return mean((e_t - e_(t-1))^2) for each frame but the first (frames - 1,)."""
        noise = by_frame(np.diff(self._noise(), axis=0))
        return by_frame(np.diff(self._errors(pictures), axis=0)) - noise

    def flicker(self, pictures: Pictures) -> float:
        """Return the RMS over all frames of e_t - e_(t-1)."""
        return root(float(self.changes(pictures).mean()))

    def energy_ratio(self, pictures: Pictures) -> float:
        """Return sum I / sum R."""
        return float(pictures.sum(dtype=np.float64) / self.pictures.sum())

    def energy_ratio_by_frame(self, pictures: Pictures) -> Doubles:
        """Return the same for each frame (frames,)."""
        axes = (1, 2, 3)
        return pictures.sum(axis=axes, dtype=np.float64) / self.pictures.sum(axis=axes)

    def squared_bias(self, seeds: Pictures) -> float:
        """Return mean(mean image - R)^2 - Var/S - Var_R, relative; `seeds` is (S, frames, H, W, 3).

        It has no bias of its own and may come out negative. S must be 2 or more.
        """
        count = len(seeds)
        errors = self._errors(seeds.mean(axis=0, dtype=np.float64))
        variance = seeds.var(axis=0, dtype=np.float64, ddof=1) / self._scale() ** 2
        own = float(variance.mean()) / count
        return mean_square(errors) - own - mean_square(self._noise())

    def squared_difference(self, first: Pictures, second: Pictures) -> tuple[float, float]:
        """Return the squared difference of two expectations, relative, and its standard error.

        `first` and `second` are independent pictures by the other renderer. Products of four
        independent noises average to zero, unlike the square of one difference.
        """
        scale = self._scale()
        products = ((first - self.halves[0]) / scale) * ((second - self.halves[1]) / scale)
        pixels = products.mean(axis=-1)
        return float(pixels.mean()), float(pixels.std() / np.sqrt(pixels.size))

    def _errors(self, pictures: Pictures) -> Doubles:
        return (pictures - self.pictures) / self._scale()

    def _noise(self) -> Doubles:
        return (self.halves[0].astype(np.float64) - self.halves[1]) / 2 / self._scale()

    def _scale(self) -> Doubles:
        return np.sqrt(self.pictures**2 + DARK)


def pulse_index(changes: Doubles, period: int) -> float:
    """Return the largest over the mean of squared changes, folded modulo `period`.

    1 means that no frame of a block changes more than another. NaN with fewer than two periods.
    """
    periods = len(changes) // period
    if period < 2 or periods < 2:
        return float("nan")
    folded = changes[: periods * period].reshape(periods, period).mean(axis=0)
    return float(folded.max() / folded.mean()) if folded.mean() > 0 else float("nan")


def flip(reference: Pictures, picture: Pictures) -> float:
    """Return the mean HDR-FLIP of one frame (H, W, 3); NaN where flip-evaluator is missing."""
    try:
        evaluator: Any = importlib.import_module("flip_evaluator")
    except ImportError:
        return float("nan")
    pair = [np.ascontiguousarray(np.maximum(p, 0.0), np.float32) for p in (reference, picture)]
    _, mean, _ = evaluator.evaluate(*pair, "HDR", applyMagma=False)
    return float(mean)


def mean_square(values: Doubles) -> float:
    """Return the mean of the squares."""
    return float(np.mean(values**2))


def by_frame(values: Doubles) -> Doubles:
    """Return the mean square of each frame."""
    return (values**2).reshape(len(values), -1).mean(axis=1)


def root(square: float) -> float:
    """Return the square root of a measured square: noise may have left it below zero."""
    return float(np.sqrt(max(square, 0.0)))
