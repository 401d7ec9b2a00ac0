"""From rows to curves, and from curves to what is asked of them: time to quality, and the bars."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

import numpy as np

from .measures import root
from .methods import BY_NAME, PLAIN
from .store import Row

TARGETS = (0.1, 0.03, 0.01, 0.003, 0.001)  # relMSE


@dataclass(frozen=True)
class Spread:
    """Median and extremes over the seeds."""

    middle: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Iterable[float]) -> Spread:
        """Spread of a few numbers."""
        found = list(values)
        return cls(median(found), min(found), max(found))


@dataclass(frozen=True)
class Point:
    """A method at one budget."""

    budget: int
    seconds: float
    rays_per_pixel: float
    relative_mse: Spread
    trimmed: Spread
    flicker: Spread
    energy_ratio: float
    # Squared changes of the error, frame after frame, mean over the seeds.
    changes: tuple[float, ...]


@dataclass(frozen=True)
class Curve:
    """A method on a scene, by rising budget."""

    scene: str
    method: str
    points: tuple[Point, ...]

    def samples(self, measure: Callable[[Point], float]) -> list[tuple[float, float]]:
        """Return (seconds, measure) of the points where both have a logarithm."""
        pairs = ((point.seconds, measure(point)) for point in self.points)
        return [(s, m) for s, m in pairs if s > 0 and m > 0]


Curves = dict[str, Curve]  # by method, of one scene


def relative_mse(point: Point) -> float:
    """Median over the seeds."""
    return point.relative_mse.middle


def flicker(point: Point) -> float:
    """Median over the seeds."""
    return point.flicker.middle


def curves(rows: Iterable[Row]) -> dict[str, Curves]:
    """Return by scene and method what was measured."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.scene, row.method), []).append(row)
    found: dict[str, Curves] = {}
    for (scene, method), members in groups.items():
        points = _points(members)
        if BY_NAME[method].engine == "CYCLES":
            points = with_linear_time(points, BY_NAME[method].is_denoised)
        found.setdefault(scene, {})[method] = Curve(scene, method, points)
    return found


def _points(rows: Iterable[Row]) -> tuple[Point, ...]:
    by_budget: dict[int, list[Row]] = {}
    for row in rows:
        by_budget.setdefault(row.budget, []).append(row)
    return tuple(_point(budget, by_budget[budget]) for budget in sorted(by_budget))


def _point(budget: int, rows: Sequence[Row]) -> Point:
    seeds = sorted({row.seed for row in rows})
    frames = sorted({row.frame for row in rows})

    def means(measure: str) -> list[float]:
        return [
            float(np.nanmean([getattr(row, measure) for row in rows if row.seed == seed]))
            for seed in seeds
        ]

    changes = [np.mean([row.change for row in rows if row.frame == f]) for f in frames[1:]]
    flickers = (root(value) for value in means("change")) if frames[1:] else [float("nan")]
    return Point(
        budget,
        median(means("seconds")),
        median(means("rays_per_pixel")),
        Spread.of(means("relative_mse")),
        Spread.of(means("trimmed")),
        Spread.of(flickers),
        float(np.mean(means("energy_ratio"))),
        tuple(float(change) for change in changes),
    )


def with_linear_time(points: Sequence[Point], has_start: bool) -> tuple[Point, ...]:
    """Replace seconds by a line through them, from the origin unless it `has_start`.

    Cycles' fixed part is subtracted from each time, and its noise drowns short ones: a line through
    all of them knows better. Errors are taken as equal, so long renders rule the slope.
    """
    budgets = np.array([point.budget for point in points], float)
    seconds = np.array([point.seconds for point in points])
    slope, start = float(budgets @ seconds / (budgets @ budgets)), 0.0
    if has_start and len(points) > 1:
        slope, start = (float(value) for value in np.polyfit(budgets, seconds, 1))
    return tuple(
        replace(point, seconds=max(1e-6, slope * point.budget + start)) for point in points
    )


def time_to(curve: Curve, target: float) -> float | None:
    """Return the seconds a frame until relMSE falls to `target`; None where it never did.

    Between points it is interpolated in logarithms. A curve that begins below the target counts
    from its first point, unless it is a plain one: their error is 1/t, down to one sample.
    """
    samples = curve.samples(relative_mse)
    if not samples:
        return None
    is_plain = curve.method in PLAIN
    first_seconds, first = samples[0]
    if first <= target:
        longest = max(1, BY_NAME[curve.method].samples(curve.points[0].budget))
        return first_seconds * max(first / target, 1 / longest) if is_plain else first_seconds
    for (s0, m0), (s1, m1) in pairwise(samples):
        if m1 <= target < m0:
            share = np.log(m0 / target) / np.log(m0 / m1)
            return float(s0 * (s1 / s0) ** share)
    last_seconds, last = samples[-1]
    return last_seconds * last / target if is_plain else None


def best_plain(scene: Curves, target: float) -> float | None:
    """Return the least time to `target` among plain path tracing at any split."""
    times = [time_to(scene[name], target) for name in PLAIN if name in scene]
    return min((time for time in times if time is not None), default=None)


def speedup(scene: Curves, method: str, target: float) -> float | None:
    """Return how many times faster than the best plain baseline a method reaches `target`."""
    ours, theirs = time_to(scene[method], target), best_plain(scene, target)
    return None if ours is None or theirs is None else theirs / ours


def at_time(curve: Curve, seconds: float, measure: Callable[[Point], float]) -> float | None:
    """Return a measure after some time, interpolated in logarithms; None outside the curve."""
    samples = sorted(curve.samples(measure))
    if not samples or not samples[0][0] <= seconds <= samples[-1][0]:
        return None
    logs = np.log(samples)
    return float(np.exp(np.interp(np.log(seconds), logs[:, 0], logs[:, 1])))


def at_equal_time(
    ours: Curve, theirs: Sequence[Curve], measure: Callable[[Point], float]
) -> float | None:
    """Return our measure over the best of theirs: median over our points within their times."""
    ratios: list[float] = []
    for seconds, value in ours.samples(measure):
        others = [at_time(curve, seconds, measure) for curve in theirs]
        known = [other for other in others if other is not None]
        if known:
            ratios.append(value / min(known))
    return median(ratios) if ratios else None


def worst_loss(scene: Curves, method: str) -> float | None:
    """Return the largest time over the best plain baseline's at the error of any point."""
    losses: list[float] = []
    for seconds, value in scene[method].samples(relative_mse):
        plain = best_plain(scene, value)
        if plain is not None:
            losses.append(seconds / plain)
    return max(losses, default=None)


@dataclass(frozen=True)
class Bar:
    """One thing asked of the method, and what was reached."""

    scene: str
    words: str
    # Whether more is better.
    at_least: bool
    bound: float
    reached: float | None

    @property
    def verdict(self) -> str:
        """`met`, `missed`, or `not measured`."""
        if self.reached is None or np.isnan(self.reached):
            return "not measured"
        is_met = self.reached >= self.bound if self.at_least else self.reached <= self.bound
        return "met" if is_met else "missed"


def bars(scene: str, light: str | None, found: Curves, pulse: float | None) -> list[Bar]:
    """Return what is asked on a scene lit by `light`: interior, sun, overcast or unknown."""
    if "dual_cone" not in found:
        return []
    own = found["dual_cone"]
    is_inside = light == "interior"
    asked = [
        *_speed_bars(light, found),
        ("time over best plain, worst budget", False, 1.05, worst_loss(found, "dual_cone")),
        *_rival_bars(is_inside, found),
        ("mean bias", False, 0.003, _bias(own)),
        ("pulse index", False, 1.05, pulse),
    ]
    return [
        Bar(scene, words, at_least, bound, reached) for words, at_least, bound, reached in asked
    ]


Asked = tuple[str, bool, float, float | None]


def _speed_bars(light: str | None, found: Curves) -> list[Asked]:
    plain = [found[name] for name in PLAIN if name in found]
    if light == "interior":
        return [
            ("times faster at relMSE .1", True, 20.0, speedup(found, "dual_cone", 0.1)),
            ("times faster at relMSE .01", True, 12.0, speedup(found, "dual_cone", 0.01)),
            (
                "flicker over plain, equal time",
                False,
                0.25,
                at_equal_time(found["dual_cone"], plain, flicker),
            ),
        ]
    wanted = {"sun": 1.4, "overcast": 2.0}.get(light or "")
    if wanted is None:
        return []
    return [("times faster, median over errors", True, wanted, _median_speedup(found))]


def _median_speedup(found: Curves) -> float | None:
    gains = [speedup(found, "dual_cone", target) for target in TARGETS]
    known = [gain for gain in gains if gain is not None]
    return median(known) if known else None


def _rival_bars(is_inside: bool, found: Curves) -> list[Asked]:
    asked: list[Asked] = []

    def compare(name: str, rival: str, bound: float, measure: Callable[[Point], float]) -> None:
        if name in found and rival in found:
            words = f"{measure.__name__.replace('_', ' ')} over {rival}, equal time"
            ratio = at_equal_time(found[name], [found[rival]], measure)
            asked.append((words, False, bound, ratio))

    compare("dual_cone-oidn", "path-oidn", 0.5 if is_inside else 1.05, relative_mse)
    compare("dual_cone-oidn", "path-oidn", 0.5 if is_inside else 1.05, flicker)
    compare("dual_cone-oidn", "cycles-oidn", 1 / 3 if is_inside else 0.5, relative_mse)
    compare("dual_cone-oidn", "cycles-oidn", 1 / 3, flicker)
    if "cycles" in found:
        wanted = 30.0 if is_inside else 4.0
        asked.append(("times faster than Cycles", True, wanted, _gain_over(found, "cycles")))
    return asked


def _gain_over(found: Curves, rival: str) -> float | None:
    pairs = [(time_to(found["dual_cone"], t), time_to(found[rival], t)) for t in TARGETS]
    gains = [theirs / ours for ours, theirs in pairs if ours is not None and theirs is not None]
    return median(gains) if gains else None


def _bias(curve: Curve) -> float:
    """Relative difference of energy at the largest budget, where noise is least."""
    return abs(curve.points[-1].energy_ratio - 1.0)


def subtract_model_difference(found: Mapping[str, Curves], checks: Mapping[str, float]) -> None:
    """Take from Cycles' error by what the two engines' converged pictures differ, in place.

    Otherwise a rival would be punished for rendering a scene in its own way.
    """
    for scene, difference in checks.items():
        for name, curve in found.get(scene, {}).items():
            if BY_NAME[name].engine == "CYCLES":
                points = [_less(point, max(0.0, difference)) for point in curve.points]
                found[scene][name] = Curve(scene, name, tuple(points))


def _less(point: Point, difference: float) -> Point:
    spread = point.relative_mse
    values = (max(1e-6, v - difference) for v in (spread.middle, spread.low, spread.high))
    return replace(point, relative_mse=Spread(*values))
