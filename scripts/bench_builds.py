"""Processor time of two builds of the renderer, in turns, and whether they render the same bits.

PYTHONPATH=build/site python scripts/bench_builds.py BEFORE AFTER [--rounds 16] [--samples 12]

BEFORE and AFTER are unpacked wheels, such as build/site of two checkouts with one contract.
Others on the machine disturb both alike: what counts is the median of the ratios of neighbouring
renders, on one thread, and its quartiles.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np

from measure import Resolution, Sample, machine

FRAME = 31
SIZE: Resolution = (96, 64)
SETTINGS = {"method": "PATH", "diffuse_bounces": 4, "glossy_bounces": 4}


def loaded(site: Path) -> Any:
    """Import the compiled module of an unpacked wheel, beside others of its name."""
    library = next((site / "dualcone").glob("dualcone*.so"))
    spec = importlib.util.spec_from_file_location(f"{site.resolve()}.dualcone", library)
    if spec is None or spec.loader is None:
        raise ImportError(f"{library}: not a module")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@dataclass
class Build:
    """A build, and a frame that it holds."""

    core: Any
    frame: Any
    seconds: list[float] = field(default_factory=list)
    picture: Any = None

    def render(self, samples: int) -> None:
        """Render the frame; remember what it took and what came out."""
        width, height = SIZE
        region = {"width": width, "height": height, "x_min": 0, "y_min": 0}
        region |= {"x_max": width, "y_max": height}
        since = time.process_time()
        settings = {**SETTINGS, "samples": samples}
        job = self.core.Render([self.frame], [FRAME], 1, region, settings, 1)
        while not job.wait(10.0):
            pass
        self.seconds.append(time.process_time() - since)
        self.picture = job.result(FRAME)["passes"]["Combined"]


def build_of(core: Any, sample: Sample) -> Build:
    """Export the frame for a build."""
    sample.go_to(FRAME, SIZE)
    from addon.export.cache import ExportCache
    from addon.export.frame import export_frame

    depsgraph = bpy.context.evaluated_depsgraph_get()
    e = export_frame(depsgraph, FRAME, SIZE, ExportCache(), core, lambda: False)
    return Build(core, core.SceneFrame(e.frame, e.meshes, e.images, e.arrays))


def compare(name: str, cores: Sequence[Any], rounds: int, samples: int) -> None:
    """Print a row for a scene."""
    sample = Sample(name)
    before, after = (build_of(core, sample) for core in cores)
    for index in range(rounds + 1):
        for build in (before, after)[:: 1 if index % 2 else -1]:
            build.render(samples)
    # The first round fills tables that are made once.
    ratios = np.divide(before.seconds[1:], after.seconds[1:])
    low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
    difference = float(np.abs(before.picture - after.picture).max())
    bits = "same bits" if difference == 0.0 else f"pixels differ by {difference:.2g}"
    print(f"{name:<12}{middle:>8.3f}   {low:.3f} to {high:.3f}   {bits}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Compare two builds of the renderer.")
    parser.add_argument("sites", nargs=2, type=Path, metavar="SITE")
    parser.add_argument("--scenes", nargs="+", default=["loader", "indoor", "stadium", "excavator"])
    parser.add_argument("--rounds", type=int, default=16)
    parser.add_argument("--samples", type=int, default=12)
    options = parser.parse_args(arguments)
    cores = [loaded(site) for site in options.sites]
    print(f"{machine()}; {SIZE[0]} x {SIZE[1]}, {options.samples} samples, {options.rounds} rounds")
    print(f"{'':<12}{'speed-up':>8}   quartiles")
    for name in options.scenes:
        compare(name, cores, options.rounds, options.samples)


if __name__ == "__main__":
    main()
