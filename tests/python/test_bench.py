"""The benches run, and their measures are what they say they are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dualcone.chart.measures import Reference
from measure import ROOT

PANELS = (
    "path-tracing",
    "paper-intra-frame",
    "paper-inter-frame",
    "dual_cone",
    "reference",
)


def run(script: str, *arguments: str) -> str:
    """Run a script in a Blender of its own and return what it printed."""
    command = [sys.executable, str(ROOT / "scripts" / script), "--quick", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_paper_bench_writes_table_and_figure(tmp_path: Path) -> None:
    printed = run("bench_paper.py", "--scenes", "stadium", "--out", str(tmp_path))
    report = (tmp_path / "bench-paper.md").read_text()
    for text in (printed, report):
        assert "| stadium | 114,548 | 48 x 32 | 2 | DUAL_CONE |" in text
        assert "| stadium | 114,548 | 64 x 36 | 2 | PAPER, LIT |" in text
    assert "nan" not in report
    for panel in PANELS:
        file = f"images/bench-stadium-{panel}.jpg"
        assert f"({file})" in report
        assert (tmp_path / file).stat().st_size > 1000


def test_bench_prints_targets_and_what_was_reached() -> None:
    lines = run("bench.py").splitlines()
    assert any(line.startswith("PATH, direct light") and ">= 1.00" in line for line in lines)
    assert any("bytes/pixel/frame" in line and "<= 100" in line for line in lines)


@pytest.fixture
def reference() -> Reference:
    """Return two noisy halves of a reference that is 1 everywhere."""
    random = np.random.default_rng(1)
    return Reference(1 + random.normal(0, 0.02, (2, 3, 64, 64, 3)).astype(np.float32))


def test_noise_of_the_reference_is_subtracted(reference: Reference) -> None:
    truth = np.ones((3, 64, 64, 3), np.float32)
    # Without the subtraction relMSE would be 2e-4 and flicker 0.02. The standard deviation of
    # what is left is below 3e-6 for relMSE and below 1e-5 for the square of flicker.
    assert abs(reference.relative_mse(truth)) < 2e-5
    assert reference.flicker(truth) < 0.01
    assert reference.relative_mse(truth + 0.2) == pytest.approx(0.04 / 1.01, rel=0.02)
    assert reference.energy_ratio(truth * 1.1) == pytest.approx(1.1, rel=0.01)


def test_flicker_is_change_of_the_error_not_error() -> None:
    frames = np.ones((3, 4, 4, 3), np.float32)
    exact = Reference(np.stack([frames, frames]))
    assert exact.flicker(frames * 2) == pytest.approx(0)
    blinking = frames * np.array([1, 2, 1], np.float32).reshape(3, 1, 1, 1)
    assert exact.flicker(blinking) == pytest.approx(1 / np.sqrt(1.01))
