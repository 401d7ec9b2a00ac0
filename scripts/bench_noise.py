"""Noise and time beside Cycles: python scripts/bench_noise.py WORD... [--samples 128].

The scenes are the rows of tests/parity whose names hold all of the words. Noise is the variance of
a pixel over that of Cycles at as many samples, from two renders each; seconds are those of whole
renders, in turns, export included.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from local_addon import load, registered

load()

from tests.parity import judge  # noqa: E402
from tests.parity.catalogue import ROWS  # noqa: E402
from tests.parity.rows import Row  # noqa: E402

from dualcone.chart.cycles import silent  # noqa: E402 (bpy sets the path up)


def timed(shoot: Callable[[int], judge.Picture]) -> tuple[float, float, float]:
    """Mean of two renders, variance of a pixel of one, and the faster one's seconds."""
    pictures, seconds = [], []
    for seed in (1, 2):
        since = time.perf_counter()
        pictures.append(shoot(seed))
        seconds.append(time.perf_counter() - since)
    a, b = (picture[..., :3] for picture in pictures)
    return float(0.5 * (a + b).mean()), float(0.5 * ((a - b) ** 2).mean()), min(seconds)


def line(row: Row, samples: int) -> str:
    """One row of the table."""
    scene = judge.prepared(row)
    with silent():
        theirs = timed(lambda seed: judge.cycles(scene, samples, seed))
        ours = timed(lambda seed: judge.ours(scene, "PATH", samples, seed))
    energy, variance, seconds = np.divide(ours, theirs)
    return f"| {row.group}: {row.name} | {energy:.3f} | {variance:.2f} | {seconds:.2f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--samples", type=int, default=128)
    given = parser.parse_args()
    print("| Scene | Energy | Variance | Seconds |")
    print("|---|---|---|---|")
    for row in ROWS:
        if all(word in f"{row.group}: {row.name}" for word in given.words):
            print(line(row, given.samples), flush=True)


if __name__ == "__main__":
    with registered():
        main()
