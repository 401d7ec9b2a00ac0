"""The measures of the chart have closed forms; the chart runs, stops and goes on."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from dualcone.chart import analysis, methods
from dualcone.chart.analysis import Curve, Point, Spread
from dualcone.chart.measures import Reference, pulse_index
from dualcone.chart.store import Row, Store, StoreError, Unit, finished

ROOT = Path(__file__).resolve().parents[2]
SHAPE = (4, 32, 32, 3)


def noise(seed: int, sigma: float, *shape: int) -> Any:
    return np.random.default_rng(seed).normal(0, sigma, (*shape, *SHAPE)).astype(np.float32)


@pytest.fixture
def truth() -> Reference:
    """A reference of radiance 2 whose halves are noisy."""
    return Reference(2 + noise(1, 0.05, 2))


def test_trimming_takes_out_a_firefly_and_nothing_else(truth: Reference) -> None:
    pictures = np.full(SHAPE, 2.2, np.float32)
    expected = 0.04 / 4.01
    assert truth.relative_mse(pictures) == pytest.approx(expected, rel=0.05)
    # The worst 2 of 1024 pixels carry a little more than their share of the reference's noise.
    np.testing.assert_allclose(truth.trimmed_by_frame(pictures), expected, rtol=0.05)
    pictures[:, 5, 5] = 1e3
    assert truth.relative_mse(pictures) > 100
    np.testing.assert_allclose(truth.trimmed_by_frame(pictures), expected, rtol=0.05)


def test_squared_bias_knows_neither_noise_nor_seeds(truth: Reference) -> None:
    """Standard error of the means below: 1.6e-5, from 12288 values of variance 0.04 / 4.01 / 8."""
    unbiased = 2 + noise(2, 0.2, 8)
    assert abs(truth.squared_bias(unbiased)) < 8e-5
    assert truth.squared_bias(unbiased + 0.1) == pytest.approx(0.01 / 4.01, rel=0.15)


def test_two_engines_that_agree_differ_by_nothing(truth: Reference) -> None:
    """Within 4.5 standard errors: right once in 150,000 times by chance; the seed is fixed."""
    difference, error = truth.squared_difference(2 + noise(3, 0.2), 2 + noise(4, 0.2))
    assert abs(difference) < 4.5 * error < 1e-3
    difference, _ = truth.squared_difference(2.1 + noise(3, 0.2), 2.1 + noise(4, 0.2))
    assert difference == pytest.approx(0.01 / 4.01, rel=0.25)


def test_energy_and_changes_by_frame() -> None:
    frames = np.ones(SHAPE, np.float32)
    exact = Reference(np.stack([frames, frames]))
    steps = frames * np.array([1, 2, 2, 1], np.float32).reshape(4, 1, 1, 1)
    np.testing.assert_allclose(exact.energy_ratio_by_frame(steps), [1, 2, 2, 1])
    np.testing.assert_allclose(exact.changes(steps), np.array([1, 0, 1]) / 1.01, rtol=1e-6)


def test_pulse_index_folds() -> None:
    assert pulse_index(np.array([1.0, 1, 1, 1]), 2) == 1
    assert pulse_index(np.array([1.0, 3, 1, 3, 9]), 2) == 1.5
    assert math.isnan(pulse_index(np.array([1.0, 3, 1]), 2))


def point(budget: int, seconds: float, error: float) -> Point:
    spread = Spread(error, error, error)
    return Point(budget, seconds, 1.0, spread, spread, spread, 1.0, ())


def curve(method: str, pairs: Sequence[tuple[int, float, float]]) -> Curve:
    return Curve("scene", method, tuple(point(*pair) for pair in pairs))


def test_time_to_quality_against_the_best_plain_baseline() -> None:
    found = {
        "path": curve("path", [(4, 1.0, 0.4), (8, 2.0, 0.2), (16, 4.0, 0.1)]),
        "path-split-2": curve("path-split-2", [(4, 1.0, 0.2), (8, 2.0, 0.1)]),
        "dual_cone": curve("dual_cone", [(4, 2.0, 0.02), (16, 8.0, 0.01)]),
    }
    assert analysis.time_to(found["path"], 0.2) == pytest.approx(2.0)
    assert analysis.time_to(found["path"], 0.01) == pytest.approx(40.0)  # Its error is 1/t.
    assert analysis.time_to(found["path"], 0.8) == pytest.approx(0.5)
    assert analysis.time_to(found["path"], 80.0) == pytest.approx(0.25)  # One sample at least.
    assert analysis.best_plain(found, 0.01) == pytest.approx(20.0)
    assert analysis.speedup(found, "dual_cone", 0.01) == pytest.approx(2.5)
    # Below its cheapest point nothing is known of a method that shares: that point counts.
    assert analysis.speedup(found, "dual_cone", 0.1) == pytest.approx(1.0)
    assert analysis.time_to(found["dual_cone"], 0.001) is None
    assert analysis.worst_loss(found, "dual_cone") == pytest.approx(8 / 20)
    ratio = analysis.at_equal_time(found["dual_cone"], [found["path"]], analysis.relative_mse)
    assert ratio == pytest.approx(0.1)


def row(unit: Unit, frame: int, seconds: float = 1.0) -> Row:
    size = {"samples": unit.budget, "width": 4, "height": 2}
    times = {"seconds": seconds, "wall_seconds": 1.0, "total_seconds": 1.0}
    errors = {"relative_mse": 0.1, "trimmed": 0.1, "energy_ratio": 1.0, "change": math.nan}
    rays = {"rays_per_pixel": 1.0, "flip": math.nan}
    return Row(*unit, frame=frame, **size, **times, **rays, **errors)


def test_the_time_of_cycles_is_a_line() -> None:
    """One short render whose fixed part was subtracted wrongly does not bend the curve."""
    times = {4: 0.9, 64: 6.4, 128: 12.8}
    rows = [row(Unit("s", "cycles", budget, 1), 1, times[budget]) for budget in times]
    points = analysis.curves(rows)["s"]["cycles"].points
    assert points[0].seconds < 0.8
    assert points[2].seconds == pytest.approx(12.8, rel=0.02)


def test_an_interrupted_run_goes_on_where_it_ended(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open({"frames": 2})
    unit, torn = Unit("scene", "path", 4, 1), Unit("scene", "path", 8, 1)
    store.append([row(unit, 1), row(unit, 2)], np.ones(SHAPE))
    with store.csv.open("a") as file:
        file.write("scene,path,8,1,1,8,4")
    again = Store(tmp_path)
    again.open({"frames": 2})
    assert finished(again.rows(), 2) == {unit}
    assert [p.shape for p in again.pictures([unit, torn])] == [SHAPE]
    with pytest.raises(StoreError, match="remove it"):
        again.open({"frames": 3})


def test_every_method_has_a_name_of_its_own_and_an_unknown_one_is_refused() -> None:
    assert len(methods.BY_NAME) == len(methods.METHODS)
    assert methods.chosen(["all"]) == list(methods.METHODS)
    with pytest.raises(ValueError, match="no method 'magic'"):
        methods.chosen(["magic"])
    contract = {"settings": [{"name": "method", "items": [("PATH", "", "")]}]}
    assert methods.missing_setting(methods.BY_NAME["path"], contract) is None
    assert methods.missing_setting(methods.BY_NAME["bilateral"], contract) == "BILATERAL"


def chart(out: Path) -> str:
    """Run the chart on one scene, tiny, in a Blender of its own."""
    command = [sys.executable, "-m", "dualcone.chart", "blend_samples/figure.blend"]
    command += ["--frames", "30-31", "--size", "48x32", "--budgets", "4-16", "--seeds", "1"]
    command += ["--methods", "path", "dual_cone", "cycles", "--reference-samples", "128"]
    command += ["--out", str(out), "--references", str(out / "references")]
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="`make chart` runs in the newest bpy")
def test_the_chart_runs(tmp_path: Path) -> None:
    printed = chart(tmp_path)
    assert "times faster than Cycles" in printed
    with (tmp_path / "chart.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["method"] for row in rows} == {"path", "dual_cone", "cycles"}
    assert {row["frame"] for row in rows} == {"30", "31"}
    assert len(rows) == 3 * 3 * 2  # methods, budgets, frames
    errors: dict[str, list[float]] = {key: [] for key in ("4", "8", "16")}
    for row in rows:
        if row["method"] == "path":
            errors[row["budget"]].append(float(row["relative_mse"]))
    assert np.mean(errors["16"]) < 0.5 * np.mean(errors["4"])
    page = (tmp_path / "index.html").read_text()
    assert "Reference against Cycles" in page
    assert "Dual Cone" in page
    before = (tmp_path / "chart.csv").read_bytes()
    chart(tmp_path)
    assert (tmp_path / "chart.csv").read_bytes() == before
