"""Speed and memory against their targets.

python scripts/bench.py [--quick] [--rounds 5]

Methods take turns, so that a busy moment of the machine hits all alike; numbers are medians.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries

from dualcone.chart.cycles import Cycles
from measure import Rendering, Resolution, Sample, machine

FRAME = 31
SAMPLES = 8  # DUAL_CONE measures distances in the first iterations
LIGHTS = {
    "direct light": {"diffuse_bounces": 0, "glossy_bounces": 0},
    "4 bounces": {"diffuse_bounces": 4, "glossy_bounces": 4},
}
METHODS = {
    "PATH": {"method": "PATH"},
    "DUAL_CONE": {"method": "DUAL_CONE", "window": 1, "block": 7},
}
CORES = 64  # of the machine that the speed-up is foretold for
Row = tuple[str, str, str]


def render_rounds(sample: Sample, size: Resolution, rounds: int) -> dict[str, list[Rendering]]:
    """Render by every method under every light in turns, after a round that only warms up."""
    renderings: dict[str, list[Rendering]] = {}
    for index in range(rounds + 1):
        for light, bounces in LIGHTS.items():
            for name, method in METHODS.items():
                settings = {**bounces, **method, "samples": SAMPLES}
                rendering = sample.render([FRAME], size, settings)
                if index > 0:
                    renderings.setdefault(f"{name}, {light}", []).append(rendering)
    return renderings


def phase(renderings: Sequence[Rendering], *names: str) -> float:
    """Return the median of the seconds in some phases."""
    return median(sum(each.seconds[name] for name in names) for each in renderings)


def speed_rows(sample: Sample, size: Resolution, rounds: int) -> Iterator[Row]:
    """Yield rates, the cost of sharing, and memory."""
    pixels = size[0] * size[1]
    renderings = render_rounds(sample, size, rounds)
    for light in LIGHTS:
        path, dual_cone = (renderings[f"{name}, {light}"] for name in METHODS)
        # Targets are for direct light, as the paper's numbers are.
        targets = (">= 1.00", "<= 25 %") if light == "direct light" else ("", "")
        path_seconds = phase(path, "pass_1")
        cpu = median(each.lighting_cpu_seconds for each in path)
        rate = pixels * SAMPLES / 1e6
        yield f"PATH, {light} [M samples/s]", targets[0], f"{rate / path_seconds:.2f}"
        cpu_rate = rate * (os.cpu_count() or 1) / cpu
        yield f"PATH, {light}, had it all cores alone", targets[0], f"{cpu_rate:.2f}"
        sharing = phase(dual_cone, "pass_2") / path_seconds
        extra = phase(dual_cone, "pass_1", "pass_2") / path_seconds - 1
        yield f"DUAL_CONE 7 x 7, {light}: pass 2 over PATH's pass 1", targets[1], f"{sharing:.0%}"
        yield f"DUAL_CONE 7 x 7, {light}: both passes, extra", targets[1], f"{extra:+.0%}"
        memory = dual_cone[0].pixel_memory_bytes / pixels
        yield f"DUAL_CONE, {light} [bytes/pixel/frame]", "<= 100", f"{memory:.0f}"


def thread_rows(sample: Sample, size: Resolution, rounds: int) -> Iterator[Row]:
    """Yield what more threads gain, and what Amdahl's law makes of it."""
    threads = os.cpu_count() or 1
    if threads < 2:
        return
    settings = {"samples": SAMPLES, **METHODS["PATH"], **LIGHTS["4 bounces"]}
    ratios = []
    for _ in range(rounds):
        one, all_ = (
            sample.render([FRAME], size, settings, threads=n).seconds["pass_1"]
            for n in (1, threads)
        )
        ratios.append(one / all_)
    gain = median(ratios)
    parallel = min(1.0, max(0.0, (1.0 - 1.0 / gain) / (1.0 - 1.0 / threads)))
    target = ">= 1.85" if threads == 2 else ""
    yield f"PATH, 4 bounces: {threads} threads over 1", target, f"{gain:.2f}"
    foretold = 1.0 / (1.0 - parallel + parallel / CORES)
    yield f"... parallel share, and {CORES} cores by it", "", f"{parallel:.0%} {foretold:.0f}x"


def rival_rows(sample: Sample, size: Resolution, rounds: int) -> Iterator[Row]:
    """Yield samples per processor second beside those of Cycles, for the same picture."""
    scene: Any = bpy.context.scene
    for name, value in LIGHTS["4 bounces"].items():
        setattr(scene.cycles, name, value)
    cycles = Cycles(sample, size)
    settings = {"samples": SAMPLES, **METHODS["PATH"], **LIGHTS["4 bounces"]}
    ratios = []
    for index in range(rounds):
        theirs = cycles.render([FRAME], SAMPLES, index).cpu_seconds
        ours = sample.render([FRAME], size, settings).lighting_cpu_seconds
        ratios.append(theirs / ours)
    yield f"{sample.name}, PATH, 4 bounces: samples/s over Cycles", ">= 3", f"{median(ratios):.2f}"


def export_rows(sample: Sample, size: Resolution, rounds: int) -> Iterator[Row]:
    """Yield what an export costs where nothing, some or all has changed since the one before."""
    first = sample.export(FRAME, size).seconds
    read = sample.cache.statistics.meshes_read
    unchanged, changed = [], []
    for index in range(1, rounds + 1):
        changed.append(sample.export(FRAME + index, size).seconds)
        unchanged.append(sample.export(FRAME + index, size).seconds)
    read = sample.cache.statistics.meshes_read - read
    yield f"export, {sample.name}: first frame [ms]", "", f"{first * 1e3:.1f}"
    yield f"export, {sample.name}: next frame [ms]", "", f"{median(changed) * 1e3:.1f}"
    yield f"export, {sample.name}: same frame again [ms]", "", f"{median(unchanged) * 1e3:.1f}"
    yield f"export, {sample.name}: meshes read again", "", str(read)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure speed and memory.")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="tiny pictures: does it run?")
    options = parser.parse_args(arguments)
    size, rounds = ((48, 32), 1) if options.quick else ((720, 480), options.rounds)
    rows: list[Row] = [("", "target", "reached")]
    for name in ("stadium", "figure", "loader"):
        sample = Sample(name)
        rows += export_rows(sample, size, rounds)
        rows += rival_rows(sample, size, rounds)
    rows += speed_rows(sample, size, rounds)
    rows += thread_rows(sample, size, rounds)
    print(f"{machine()}; {sample.name}, {size[0]} x {size[1]}, medians of {rounds}")
    for label, target, reached in rows:
        print(f"{label:<58}{target:>10}{reached:>10}")


if __name__ == "__main__":
    main()
