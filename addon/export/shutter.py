"""When the shutter is open, and at which times what moves is looked at: as in Cycles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import bpy
import numpy as np

from .report import Warnings

# Parts of the shutter's time in which `shutter_curve` gives the light it lets in.
CURVE_PARTS = 256
# Moves the scene to a frame and a share of the way to the next.
SetTime = Callable[[int, float], Any]
# Shares of the way from the middle to the end of the shutter's time, from -1 to 1.
Times = tuple[Fraction, ...]


@dataclass(frozen=True)
class Shutter:
    """When the shutter is open, in frames."""

    # From the frame to the middle of the shutter's time.
    middle: float
    length: float
    # Light that it lets in, in equal parts of its time; empty where it is the same throughout.
    curve: np.ndarray


def read_shutter(scene: bpy.types.Scene, warnings: Warnings) -> Shutter | None:
    """The shutter of a scene with motion blur."""
    render = scene.render
    if not render.use_motion_blur or render.motion_blur_shutter <= 0.0:
        return None
    cycles: Any = getattr(scene, "cycles", None)
    if getattr(cycles, "rolling_shutter_type", "NONE") != "NONE":
        warnings.not_rendered(scene.name, "Rolling shutter")
    length = render.motion_blur_shutter
    shift = {"START": 0.5, "CENTER": 0.0, "END": -0.5}[render.motion_blur_position]
    mapping = render.motion_blur_shutter_curve
    mapping.initialize()
    middles = (np.arange(CURVE_PARTS) + 0.5) / CURVE_PARTS
    curve = np.array([mapping.evaluate(mapping.curves[0], x) for x in middles], np.float32)
    if np.ptp(curve) < 1e-6:
        curve = curve[:0]
    return Shutter(shift * length, length, curve)


def set_time(move: SetTime, time: float) -> None:
    """Move the scene to a time in frames."""
    frame = math.floor(time)
    move(frame, time - frame)


@cache
def motion_times(steps: int) -> Times:
    """The times that Cycles looks at for an object with this number of steps; none for 0."""
    if steps == 0:
        return ()
    count = 2**steps
    return tuple(Fraction(2 * i, count) - 1 for i in range(count + 1))


def motion_steps(owner: Any, parent: Any) -> tuple[int, bool]:
    """Steps of an object that `parent` instances, 0 for no blur, and whether its form is blurred.

    Both must want it, and the larger number of steps counts, as in Cycles.
    """
    both = [getattr(thing, "cycles", None) for thing in (owner, parent)]
    if not all(getattr(settings, "use_motion_blur", True) for settings in both):
        return 0, False
    steps = max(max(1, getattr(settings, "motion_steps", 1)) for settings in both)
    return steps, all(getattr(settings, "use_deform_motion", True) for settings in both)
