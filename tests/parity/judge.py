"""Renders a row with Cycles and with DualCone, and compares the pictures.

Pictures are arrays (H, W, 4) of scene-linear radiance, premultiplied, and alpha; lowest row first.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from dualcone.chart.cycles import without_bias

from .rows import Row
from .stage import Stage

Picture = NDArray[np.float64]
Pair = tuple[Picture, Picture]  # the same picture with other noise

REFERENCES = Path(__file__).with_name("references")
SIDE = 64  # pixels
REFERENCE_SAMPLES = 4  # of a stored picture, for each one of a picture that is judged by it
DARK = 0.01  # added to the square of the reference, so that dark pixels do not rule
ENERGY_TOLERANCE = 0.01
RELATIVE_MSE_MAX = 1e-3
BIAS_MAX = 0.003
# Alpha and channels that are nearly black have no ratio worth the name.
DARK_CHANNEL = 1e-3


class Refused(Exception):
    """An engine rendered nothing; the message is its own."""


@dataclass(frozen=True)
class Reference:
    """The mean of two Cycles renders, and what their noise adds to a squared error."""

    picture: Picture
    noise: float
    energy_error: NDArray[np.float64]  # standard error of each channel's mean

    @staticmethod
    def of(pair: Pair) -> Reference:
        picture = 0.5 * (pair[0] + pair[1])
        half = 0.5 * (pair[0] - pair[1])
        return Reference(
            picture, float((half**2 * weight_of(picture)).mean()), standard_error(pair)
        )

    @staticmethod
    def load(row: Row) -> Reference | None:
        """Read what is stored, if it shows what the row's script makes today."""
        path = REFERENCES / f"{row.key}.npz"
        if not path.exists():
            return None
        with np.load(path) as stored:
            if str(stored["digest"]) != row.digest():
                return None
            picture = stored["picture"].astype(np.float64)
            return Reference(picture, float(stored["noise"]), stored["energy_error"])

    def save(self, row: Row, command: str) -> None:
        """Store as half floats, with the command that made it."""
        REFERENCES.mkdir(exist_ok=True)
        np.savez_compressed(
            REFERENCES / f"{row.key}.npz",
            picture=np.clip(self.picture, -65504.0, 65504.0).astype(np.float16),
            noise=self.noise,
            energy_error=self.energy_error,
            digest=row.digest(),
            command=command,
        )


def weight_of(picture: Picture) -> Picture:
    return 1.0 / (picture**2 + DARK)


def standard_error(pair: Pair) -> NDArray[np.float64]:
    """Of each channel's mean over both pictures, from their difference."""
    half = 0.5 * (pair[0] - pair[1])
    return np.sqrt((half**2).mean(axis=(0, 1)) / (half.shape[0] * half.shape[1]))


@dataclass(frozen=True)
class Outcome:
    """One row, rendered: what DualCone made of it, and how it compares."""

    row: Row
    reference: Reference
    path: Pair | None
    dual_cone: Picture | None
    warnings: tuple[str, ...]

    @cached_property
    def energy(self) -> NDArray[np.float64]:
        """Mean of each channel, PATH over Cycles; one where both are black."""
        return ratio(mean(np.mean(self._path, axis=0)), mean(self.reference.picture))

    @cached_property
    def energy_error(self) -> NDArray[np.float64]:
        """Standard error of `energy`."""
        both = np.hypot(standard_error(self._path), self.reference.energy_error)
        return both / np.maximum(mean(self.reference.picture), DARK_CHANNEL)

    @cached_property
    def relative_mse(self) -> float:
        """Mean of (I - R)^2 / (R^2 + 0.01), the noise of both taken out.

        Of two renders of one expectation the product of errors has no noise of its own left.
        """
        return float(self._squared_errors.mean()) - self.reference.noise

    @cached_property
    def relative_mse_error(self) -> float:
        """Standard error of `relative_mse`."""
        return float(self._squared_errors.std() / np.sqrt(self._squared_errors.size))

    @cached_property
    def bias(self) -> float:
        """Energy of DUAL_CONE over that of PATH, minus one; NaN where there is none to compare."""
        plain = 0.0 if self.path is None else np.mean(self.path, axis=0)[..., :3].mean()
        if self.dual_cone is None or plain <= 0.0:
            return float("nan")
        return float(self.dual_cone[..., :3].mean() / plain - 1.0)

    @cached_property
    def verdict(self) -> str:
        """Say in one word how the row fares."""
        if self.path is None:
            return "refused"
        if not self.reference.picture[..., :3].any():
            return "black"
        off = float(np.abs(self.energy - 1.0).max())
        is_same = self.row.is_strewn or self.relative_mse <= RELATIVE_MSE_MAX
        if off <= ENERGY_TOLERANCE and is_same:
            return "agrees, but warns" if self.warnings else "agrees"
        if self.warnings:
            return "named"
        near = np.abs(self.energy - 1.0) - 3.0 * self.energy_error
        is_near = self.relative_mse - 3.0 * self.relative_mse_error <= RELATIVE_MSE_MAX
        is_near = is_near or self.row.is_strewn
        return "noisy" if is_near and float(near.max()) <= ENERGY_TOLERANCE else "differs"

    @property
    def _path(self) -> Pair:
        if self.path is None:
            raise Refused("; ".join(self.warnings))
        return self.path

    @cached_property
    def _squared_errors(self) -> NDArray[np.float64]:
        (x, y), r = self._path, self.reference.picture
        return ((x - r) * (y - r) * weight_of(r)).mean(axis=2)


def mean(picture: Picture) -> NDArray[np.float64]:
    return picture.mean(axis=(0, 1))


def ratio(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> NDArray[np.float64]:
    dark = (ours < DARK_CHANNEL) & (theirs < DARK_CHANNEL)
    return np.where(dark, 1.0, ours / np.where(theirs > 0.0, theirs, DARK_CHANNEL))


def reference(row: Row) -> Reference:
    """Render a row with Cycles. The same computer gives the same bits again."""
    scene = prepared(row)
    pictures = [cycles(scene, REFERENCE_SAMPLES * row.samples, seed) for seed in (0, 1)]
    return Reference.of((pictures[0], pictures[1]))


def outcome(row: Row, expected: Reference, with_dual_cone: bool = True) -> Outcome:
    """Render a row with DualCone and compare."""
    scene = prepared(row)
    with warnings_heard() as heard:
        try:
            pair = ours(scene, "PATH", row.samples, 2), ours(scene, "PATH", row.samples, 3)
            shared = ours(scene, "DUAL_CONE", row.samples, 4) if with_dual_cone else None
        except Refused as refusal:
            return Outcome(row, expected, None, None, (str(refusal),))
    return Outcome(row, expected, pair, shared, tuple(dict.fromkeys(heard)))


def prepared(row: Row) -> Any:
    """Build the row's scene, without the limits of light that both engines take from Cycles' settings."""
    stage = Stage()
    row.build(stage, **row.values)
    without_bias(stage.scene, row.samples, 0)
    render = stage.scene.render
    render.resolution_x = render.resolution_y = SIDE
    render.resolution_percentage = 100
    return stage.scene


def cycles(scene: Any, samples: int, seed: int) -> Picture:
    """Render with Cycles."""
    without_bias(scene, samples, seed)
    return render(scene)


def ours(scene: Any, method: str, samples: int, seed: int) -> Picture:
    """Render with DualCone."""
    scene.render.engine = "DUALCONE"
    scene.dualcone.method = method
    scene.dualcone.samples, scene.dualcone.seed = samples, seed
    return render(scene)


def render(scene: Any) -> Picture:
    """Render the current frame to a file and read it back, as users do."""
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        scene.render.filepath = str(path)
        try:
            bpy.ops.render.render(write_still=True)
        except RuntimeError as error:
            raise Refused(str(error).strip().removeprefix("Error: ")) from error
        return read(path)


def read(path: Path) -> Picture:
    image: Any = bpy.data.images.load(str(path))
    try:
        width, height = image.size
        pixels = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, -1).astype(np.float64)
    finally:
        bpy.data.images.remove(image)


@contextmanager
def warnings_heard() -> Iterator[list[str]]:
    """Collect what the add-on warns of."""
    heard: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.levelno >= logging.WARNING:
                heard.append(record.getMessage())

    logger, listener = logging.getLogger("addon"), Listener()
    logger.addHandler(listener)
    try:
        yield heard
    finally:
        logger.removeHandler(listener)
