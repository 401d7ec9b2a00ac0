"""IES files: how strongly a lamp shines in which direction.

After "ANSI/IESNA LM-63-02, Standard File Format for the Electronic Transfer of Photometric Data".
What real files do beyond it (angles that start elsewhere, no last angle) is taken as in Cycles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

# Watt of a lamp that shines evenly with one candela: 4 pi over the 177.83 lumen per watt of D65.
WATT_PER_CANDELA = 0.0706650768394
# What Cycles takes for the file that it cannot read.
EVEN = 100.0
# Rows from pole to pole and columns around of the grid: every half degree.
ROWS, COLUMNS = 361, 720
# Grids kept, four megabytes each.
KEPT = 16

# Photometric types of the file.
TYPE_C, TYPE_B, TYPE_A = 1, 2, 3


@dataclass
class Distribution:
    """Intensities (A, P) [W] at angles around (A,) and from where it points (P,) [degree]."""

    around: np.ndarray
    polar: np.ndarray
    intensity: np.ndarray


def file_text(node: Any) -> str:
    """Read the file of an IES Texture node. Raises OSError."""
    if node.mode == "INTERNAL":
        return node.ies.as_string() if node.ies else ""
    return Path(bpy.path.abspath(node.filepath)).read_text(encoding="latin-1")


@lru_cache(KEPT)
def intensity_grid(text: str) -> np.ndarray:
    """Intensities as an image (ROWS, COLUMNS, 4): rows by the polar angle, columns around.

    Raises:
        ValueError: it is no IES file.
    """
    given = parse(text)
    polar = np.linspace(0.0, 180.0, ROWS)
    around = (np.arange(COLUMNS) + 0.5) * (360.0 / COLUMNS)
    is_full = given.around[0] < 1e-4 and given.around[-1] > 360.0 - 1e-4
    rows = interpolated(given.intensity, given.polar, polar, axis=1, ends="MIRROR")
    grid = interpolated(rows, given.around, around, axis=0, ends="WRAP" if is_full else "STAY")
    grid = np.maximum(grid.T, 0.0).astype(np.float32)
    return np.ascontiguousarray(np.repeat(grid[..., None], 4, axis=-1))


def interpolated(
    values: np.ndarray, angles: np.ndarray, wanted: np.ndarray, axis: int, ends: str
) -> np.ndarray:
    """Interpolate along an axis by cubic curves through four neighbours; zero beyond the angles."""
    values = np.moveaxis(values, axis, 0)
    last = len(angles) - 1
    cell = np.clip(np.searchsorted(angles, wanted, side="left") - 1, 0, last - 1)
    share = ((wanted - angles[cell]) / np.maximum(angles[cell + 1] - angles[cell], 1e-9))[:, None]
    before, after = cell - 1, cell + 2
    if ends == "WRAP":
        before, after = np.where(before < 0, last - 1, before), np.where(after > last, 1, after)
    if ends == "MIRROR":
        if angles[0] < 1e-4:
            before = np.abs(before)
        if angles[-1] > 180.0 - 1e-4:
            after = np.where(after > last, last - 1, after)
    a, d = values[np.maximum(before, 0)], values[np.minimum(after, last)]
    b, c = values[cell], values[cell + 1]
    curve = (d + 3.0 * (b - c) - a) * share + (2.0 * a - 5.0 * b + 4.0 * c - d)
    found = 0.5 * (curve * share + (c - a)) * share + b
    inside = (wanted >= angles[0] - 1e-6) & (wanted <= angles[-1] + 1e-6)
    return np.moveaxis(np.where(inside[:, None], found, 0.0), 0, axis)


def parse(text: str) -> Distribution:
    """Read an IES file.

    Raises:
        ValueError: it is none.
    """
    _, is_found, body = text.replace(",", " ").partition("\nTILT=")
    if not is_found:
        raise ValueError("no TILT line")
    tilt, _, rest = body.partition("\n")
    numbers = leading_numbers(rest)
    if tilt.strip() == "INCLUDE":
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    if len(numbers) < 13:
        raise ValueError("it ends too early")
    _, _, scale, polar_count, around_count, kind, *_ = numbers[:10]
    ballast, photometric = numbers[10:12]
    polar_count, around_count, kind = int(polar_count), int(around_count), int(kind)
    values = np.array(numbers[13:])
    if polar_count < 2 or around_count < 1 or kind not in TYPES:
        raise ValueError("too few angles or an unknown type")
    sizes = np.cumsum([polar_count, around_count, polar_count * around_count])
    if len(values) < sizes[-1]:
        raise ValueError("it ends too early")
    polar, around, intensity, _ = np.split(values, sizes)
    factor = WATT_PER_CANDELA * scale * ballast * photometric
    grid = factor * intensity.reshape(around_count, polar_count)
    return TYPES[kind](Distribution(around, polar, grid))


def leading_numbers(text: str) -> list[float]:
    """The numbers before anything else."""
    numbers: list[float] = []
    for word in text.split():
        try:
            numbers.append(float(word))
        except ValueError:
            break
    return numbers


def type_c(given: Distribution) -> Distribution:
    """Angles from straight down; around, what is symmetric may be left out."""
    around, intensity = given.around, given.intensity
    if is_close(around[0], 90.0):
        around = around - 90.0
    if len(around) == 1:
        return Distribution(np.array([0.0, 360.0]), given.polar, np.repeat(intensity, 2, axis=0))
    for half in (90.0, 180.0):
        if is_close(around[-1], half):
            around = np.concatenate([around, 2.0 * half - around[-2::-1]])
            intensity = np.concatenate([intensity, intensity[-2::-1]])
    gap = 360.0 - around[-1]
    steps = np.diff(around)[[0, -1]]
    if is_close(around[0], 0.0) and gap > 1e-4 and any(is_close(step, gap) for step in steps):
        around = np.append(around, 360.0)
        intensity = np.concatenate([intensity, intensity[:1]])
    return Distribution(around, given.polar, intensity)


def type_b(given: Distribution) -> Distribution:
    """The polar axis lies: angles change places, and the user turns the lamp."""
    around, intensity = from_middle(given.polar, given.intensity.T)
    polar, intensity = from_middle(given.around, intensity.T)
    return Distribution(around, polar, intensity.T)


def from_middle(angles: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shift angles about 0 to angles about 90, and mirror those of one side alone."""
    if not is_close(angles[0], 0.0):
        return angles + 90.0, values
    mirrored = np.concatenate([90.0 - angles[:0:-1], 90.0 + angles])
    return mirrored, np.concatenate([values[:0:-1], values])


def type_a(given: Distribution) -> Distribution:
    """Polar angles about the horizon; around, -90 to 90 degrees become 270 to 90."""
    around, intensity = 180.0 - given.around[::-1], given.intensity[::-1]
    if is_close(given.around[0], 0.0):
        around = np.concatenate([around, 180.0 + given.around[1:]])
        intensity = np.concatenate([intensity, given.intensity[1:]])
    return Distribution(around, given.polar + 90.0, intensity)


def is_close(one: float, other: float) -> bool:
    return abs(one - other) < 1e-4


TYPES = {TYPE_C: type_c, TYPE_B: type_b, TYPE_A: type_a}
