"""Renders what is missing from the chart, cheapest first, methods in turns."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import dualcone

from . import methods
from .cycles import Cycles, can_denoise
from .measures import Pictures, Reference, flip
from .methods import Method
from .scene import Resolution, Scene, SceneError, Settings, addon, core_digest, reference
from .store import Row, Store, Unit, finished

CHECK_SAMPLES = 128  # of Cycles, twice, on one frame


@dataclass(frozen=True)
class Options:
    """What is charted. Rows of other options never mix with these."""

    frames: tuple[int, ...]
    resolution: Resolution
    reference_samples: int


@dataclass(frozen=True)
class Plan:
    """How far to go; a later run may go further."""

    methods: tuple[str, ...]
    budgets: tuple[int, ...]
    seeds: int
    # For the whole run, references included; those that fit are rendered, cheapest first.
    minutes: float
    # The longest that one unit may take.
    unit_seconds: float


class Shot(NamedTuple):
    """A rendered unit: pictures (frames, H, W, 3), and per frame seconds and rays."""

    pictures: Pictures
    seconds: float
    wall_seconds: float
    total_seconds: float
    rays: float


class Subject:
    """One scene under the methods."""

    def __init__(self, path: Path, options: Options, references: Path) -> None:
        self.scene = Scene(path)
        self.options = options
        self.settings = self.scene.settings
        samples = {**self.settings, "samples": options.reference_samples}
        frames, size = options.frames, options.resolution
        self.truth: Reference = reference(self.scene, frames, size, samples, references)
        self.cycles = Cycles(self.scene, size)

    def shoot(self, unit: Unit) -> Shot:
        """Render a unit."""
        method = methods.BY_NAME[unit.method]
        samples = method.samples(unit.budget)
        # Neighbouring seeds share no numbers, but the reference has seeds of its own.
        if method.engine == "CYCLES":
            return self._cycles(method, samples, unit.seed)
        settings: Settings = {**self.settings, **method.settings}
        settings = {**settings, "samples": samples, "seed": unit.seed}
        frames, size = self.options.frames, self.options.resolution
        made = self.scene.render(frames, size, settings, is_denoised=method.is_denoised)
        cpu = made.lighting_cpu_seconds / (os.cpu_count() or 1)
        total = sum(made.seconds.values())
        return Shot(made.pictures, cpu, made.lighting_seconds, total, made.rays)

    def _cycles(self, method: Method, samples: int, seed: int) -> Shot:
        made = self.cycles.render(
            self.options.frames, samples, seed, is_denoised=method.is_denoised
        )
        cpu = made.cpu_seconds / (os.cpu_count() or 1)
        return Shot(made.pictures, cpu, made.seconds, made.total_seconds, 0.0)

    def judge(self, unit: Unit, shot: Shot) -> list[Row]:
        """Measure the frames of a unit."""
        truth, pictures = self.truth, shot.pictures
        width, height = self.options.resolution
        relative_mse = truth.relative_mse_by_frame(pictures)
        trimmed = truth.trimmed_by_frame(pictures)
        energy = truth.energy_ratio_by_frame(pictures)
        changes = [float("nan"), *truth.changes(pictures)]
        flips = (flip(*pair) for pair in zip(truth.pictures, pictures, strict=True))
        samples = methods.BY_NAME[unit.method].samples(unit.budget)
        measured = (relative_mse, trimmed, energy, changes, flips)
        columns = zip(self.options.frames, *measured, strict=True)
        common: dict[str, Any] = {
            **unit._asdict(),
            "samples": samples,
            "width": width,
            "height": height,
            "seconds": shot.seconds,
            "wall_seconds": shot.wall_seconds,
            "total_seconds": shot.total_seconds,
            "rays_per_pixel": shot.rays / (width * height),
        }
        names = ("relative_mse", "trimmed", "energy_ratio", "change", "flip")
        return [
            Row(**common, frame=frame, **dict(zip(names, map(float, values), strict=True)))
            for frame, *values in columns
        ]

    def check(self) -> dict[str, float]:
        """Compare the reference's middle frame with Cycles: a second engine, other code."""
        middle = len(self.options.frames) // 2
        frame = self.options.frames[middle : middle + 1]
        truth = Reference(self.truth.halves[:, middle : middle + 1])
        pair = [self.cycles.render(frame, CHECK_SAMPLES, seed).pictures for seed in (1, 2)]
        difference, error = truth.squared_difference(*pair)
        ratio = truth.energy_ratio(np.mean(pair, axis=0))
        return {"difference": difference, "error": error, "energy_ratio": ratio}


def usable(chosen: Iterable[Method]) -> Iterator[Method]:
    """Yield the methods that this machine can render; name the others."""
    contract: Any = dualcone.contract()
    for method in chosen:
        reason = methods.missing_setting(method, contract)
        if reason:
            reason = f"this build has no setting {reason}"
        elif method.is_denoised:
            reason = _denoiser_problem(method)
        if reason:
            say(f"{method.name}: left out, {reason}")
        else:
            yield method


def _denoiser_problem(method: Method) -> str | None:
    if method.engine == "CYCLES":
        return None if can_denoise() else "this Cycles has no OpenImageDenoise"
    return addon("denoise").problem()


def say(words: str) -> None:
    """Tell the user something that stays on the screen."""
    sys.stderr.write(f"\r{words:<78}\n")


class Bar:
    """A progress bar with the time left, drawn again in place; on a file, a line at times."""

    WIDTH = 24
    SECONDS_BETWEEN_LINES = 20.0

    def __init__(self) -> None:
        self._next = 0.0

    def show(self, done: float, left: float, words: str) -> None:
        """Show the share that is done, the seconds left, and what is being done."""
        filled = round(self.WIDTH * min(1.0, done))
        minutes, seconds = divmod(round(left), 60)
        bar = "#" * filled + "." * (self.WIDTH - filled)
        line = f"[{bar}] {minutes:3}:{seconds:02} left  {words}"
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{line:<79.79}")
        elif time.monotonic() >= self._next:
            self._next = time.monotonic() + self.SECONDS_BETWEEN_LINES
            sys.stderr.write(line + "\n")
        sys.stderr.flush()


class Costs:
    """Predicts what a unit will take from what those before it took."""

    def __init__(self) -> None:
        self._per_budget: dict[str, float] = {}

    def learn(self, unit: Unit, seconds: float) -> None:
        """Remember what a unit took."""
        self._per_budget[unit.method] = seconds / unit.budget

    def predict(self, unit: Unit) -> float:
        """Return seconds, too many rather than too few; 0 for a method never seen."""
        return self._per_budget.get(unit.method, 0.0) * unit.budget


def order(scene: str, names: Sequence[str], budgets: Sequence[int], seeds: int) -> list[Unit]:
    """List a scene's units: small budgets first; seeds and methods take turns."""
    return [
        Unit(scene, name, budget, seed)
        for budget in sorted(budgets)
        for seed in range(1, seeds + 1)
        for name in names
    ]


def chart_scene(
    subject: Subject, units: Sequence[Unit], store: Store, until: float, unit_seconds: float
) -> None:
    """Render the units that are missing and fit into the time."""
    costs, bar, began = Costs(), Bar(), time.monotonic()
    done = finished(store.rows(), len(subject.options.frames))
    left = [unit for unit in units if unit not in done]
    while left:
        unit = left.pop(0)
        now = time.monotonic()
        predicted = costs.predict(unit)
        if now + predicted > until or predicted > unit_seconds:
            continue
        affordable = (costs.predict(u) for u in (unit, *left) if costs.predict(u) <= unit_seconds)
        remaining = min(until - now, sum(affordable))
        share = (now - began) / max(1e-9, now - began + remaining)
        bar.show(share, remaining, f"{unit.scene} {unit.method} {unit.budget} #{unit.seed}")
        shot = subject.shoot(unit)
        store.append(subject.judge(unit, shot), shot.pictures)
        costs.learn(unit, time.monotonic() - now)
    bar.show(1.0, 0.0, subject.scene.name)


def run(
    scenes: Sequence[Path],
    options: Options,
    plan: Plan,
    store: Store,
    references: Path,
    after_scene: Callable[[], object],
) -> None:
    """Chart scene after scene; `after_scene` is called when one is done."""
    deadline = time.monotonic() + 60 * plan.minutes
    names = [method.name for method in usable(methods.chosen(plan.methods))]
    store.open({**asdict(options), "build": core_digest(), "frames": list(options.frames)})
    for index, path in enumerate(scenes):
        try:
            began = time.monotonic()
            until = began + (deadline - began) / (len(scenes) - index)
            say(f"{path.stem}: reference of {options.reference_samples} samples")
            subject = Subject(path, options, references)
        except SceneError as error:
            say(f"{path}: {error}")
            continue
        if "cycles" in names:
            store.keep_check(subject.scene.name, subject.check)
        store.keep_reference(subject.scene.name, subject.truth.halves)
        # References take long only once; a scene is never left without any point.
        until = max(until, time.monotonic() + 60 * plan.minutes / len(scenes) / 4)
        units = order(subject.scene.name, names, plan.budgets, plan.seeds)
        chart_scene(subject, units, store, until, plan.unit_seconds)
        after_scene()
