"""Measure again what the paper measured: its Table 1, its Figure 3 and its claims.

python scripts/bench_paper.py [--quick] [--scenes indoor loader stadium] [--out docs]

Writes bench-paper.md and images/ below --out. As in the paper (section 5) light is direct and all
methods take equal samples; `--bounces` adds indirect light.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy  # noqa: F401  first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

import paper_report
from dualcone.chart.measures import Reference
from measure import (
    ROOT,
    Rendering,
    Resolution,
    Sample,
    enlarged,
    machine,
    reference,
    save_picture,
)
from paper_report import Energy, Panel, Run, Timing

# A block of PAPER at the default window: PAPER and PATH trace these alone, DUAL_CONE two more.
TIMED_FRAMES = (31, 32, 33)
# Across the border between two blocks, where PAPER would pulse.
FIGURE_FRAMES = (30, 31, 32)
CROP = 4  # the close-up shows 1/CROP of the picture, as large as the picture
# Left and lower edge of the close-up as shares of the picture: where shadows meet fine parts.
CROP_CORNERS = {"indoor": (0.45, 0.2), "loader": (0.4, 0.3), "stadium": (0.35, 0.35)}

TIMED_METHODS = {
    "PATH": {"method": "PATH"},
    "PAPER, NONE": {"method": "PAPER", "recheck": "NONE"},
    "PAPER, LIT": {"method": "PAPER", "recheck": "LIT"},
    "DUAL_CONE": {"method": "DUAL_CONE"},
}
FIGURE_METHODS = {
    "path tracing": {"method": "PATH"},
    "PAPER, intra-frame": {"method": "PAPER", "window": 1},
    "PAPER, inter-frame": {"method": "PAPER", "window": 3},
    "DUAL_CONE": {"method": "DUAL_CONE"},
}
ENERGY_BLOCKS = (3, 7, 15)
RECHECKS = ("NONE", "LIT", "ALL")


@dataclass(frozen=True)
class Sizes:
    """How large and how good the pictures are."""

    table: Resolution = (720, 480)
    large: Resolution = (1024, 576)
    figure: Resolution = (180, 120)
    energy: Resolution = (120, 80)
    samples: int = 32
    timed_samples: int = 32
    energy_samples: int = 8
    reference_samples: int = 1024


QUICK = Sizes((48, 32), (64, 36), (48, 32), (24, 16), 2, 2, 2, 8)


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Measure the paper's experiment again.")
    parser.add_argument("--scenes", nargs="+", default=list(CROP_CORNERS), choices=CROP_CORNERS)
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    parser.add_argument("--quick", action="store_true", help="tiny pictures: does it run?")
    parser.add_argument("--samples", type=int, default=Sizes.samples, help="per pixel and frame")
    parser.add_argument(
        "--timed-samples", type=int, help="traced for Table 1 and scaled to --samples"
    )
    parser.add_argument("--reference-samples", type=int, default=Sizes.reference_samples)
    parser.add_argument("--bounces", type=int, default=0, help="of indirect light")
    return parser.parse_args(arguments)


class Experiment:
    """One run: its sizes, and the settings that all its pictures share."""

    def __init__(self, sizes: Sizes, bounces: int, out: Path) -> None:
        self.sizes = sizes
        self.out = out
        self.bounces = bounces

    def settings(self, method: Mapping[str, Any], samples: int | None = None) -> dict[str, Any]:
        bounces = {"diffuse_bounces": self.bounces, "glossy_bounces": self.bounces}
        return {"samples": samples or self.sizes.samples, **bounces, **method}

    def reference(self, sample: Sample, frames: Sequence[int], size: Resolution) -> Reference:
        return reference(sample, frames, size, self.settings({}, self.sizes.reference_samples))

    def timings(self, sample: Sample) -> Iterator[Timing]:
        """Yield the rows of Table 1 for one scene."""
        sizes = [self.sizes.table] + ([self.sizes.large] if sample.name == "stadium" else [])
        for size in sizes:
            for name, method in TIMED_METHODS.items():
                settings = self.settings(method, self.sizes.timed_samples)
                rendering = sample.render(TIMED_FRAMES, size, settings)
                scale = self.sizes.samples / self.sizes.timed_samples
                yield Timing(sample.name, sample.triangles, size, name, rendering, scale)

    def panels(self, sample: Sample) -> Iterator[Panel]:
        """Yield the pictures of Figure 3 for one scene, measured over FIGURE_FRAMES."""
        size = self.sizes.figure
        truth = self.reference(sample, FIGURE_FRAMES, size)
        for name, method in FIGURE_METHODS.items():
            rendering = sample.render(FIGURE_FRAMES, size, self.settings(method))
            yield self.panel(sample, name, truth, rendering)
        picture = self.save(sample, "reference", truth.pictures[1])
        yield Panel(sample.name, "reference", picture)

    def panel(self, sample: Sample, name: str, truth: Reference, rendering: Rendering) -> Panel:
        pictures = rendering.pictures
        return Panel(
            sample.name,
            name,
            self.save(sample, name, pictures[1]),
            truth.relative_mse(pictures),
            truth.flicker(pictures),
            truth.energy_ratio(pictures),
            rendering,
        )

    def save(self, sample: Sample, name: str, picture: NDArray[Any]) -> str:
        """Write the whole picture above a close-up; return the file's name in --out."""
        height, width, _ = picture.shape
        x, y = CROP_CORNERS[sample.name.partition(",")[0]]
        left, bottom = round(x * width), round(y * height)
        crop = picture[bottom : bottom + height // CROP, left : left + width // CROP]
        above_each_other = np.concatenate([enlarged(crop, CROP), picture])
        words = f"bench {sample.name} {name}".lower().replace(",", "")
        file = f"images/{words.replace(' ', '-')}.jpg"
        save_picture(enlarged(above_each_other, 2), self.out / file)
        return file

    def energies(self, sample: Sample) -> Iterator[Energy]:
        """Yield the energies of PAPER within one frame, by block and recheck, and of PATH."""
        size, frames = self.sizes.energy, FIGURE_FRAMES[:1]
        truth = self.reference(sample, frames, size)
        for block in ENERGY_BLOCKS:
            common = {"window": 1, "block": block}
            # The block means nothing to PATH: each column is another seed.
            methods = {"PATH": {"method": "PATH", "seed": block}}
            for recheck in RECHECKS:
                methods[f"PAPER, {recheck}"] = {"method": "PAPER", "recheck": recheck}
            for name, method in methods.items():
                settings = self.settings({**common, **method}, self.sizes.energy_samples)
                rendering = sample.render(frames, size, settings)
                yield Energy(sample.name, name, block, truth.energy_ratio(rendering.pictures))

    def judge(self, sample: Sample, run: Run) -> None:
        """Add a scene's pictures and energies."""
        print(f"{sample.name}: Figure 3", flush=True)
        run.panels += self.panels(sample)
        print(f"{sample.name}: energy", flush=True)
        run.energies += self.energies(sample)

    def run(self, scenes: Sequence[str]) -> Run:
        """Measure everything, scene by scene."""
        sizes = self.sizes
        run = Run(
            machine(), self.bounces, sizes.samples, sizes.timed_samples, sizes.reference_samples
        )
        for name in scenes:
            sample = Sample(name)
            print(f"{sample.name}: Table 1", flush=True)
            run.timings += self.timings(sample)
            self.judge(sample, run)
            if name == "loader":
                sample.make_overcast()
                self.judge(sample, run)
        return run


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, write the report."""
    options = parse_arguments(arguments)
    sizes = Sizes(
        samples=options.samples,
        timed_samples=options.timed_samples or options.samples,
        reference_samples=options.reference_samples,
    )
    experiment = Experiment(QUICK if options.quick else sizes, options.bounces, options.out)
    run = experiment.run(options.scenes)
    print(paper_report.table(run))
    report = options.out / "bench-paper.md"
    report.write_text(paper_report.text(run))
    print(f"\nall of it: {report}")


if __name__ == "__main__":
    main()
