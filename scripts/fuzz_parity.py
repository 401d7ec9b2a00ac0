"""Compare DualCone with Cycles on scenes that chance makes.

    python scripts/fuzz_parity.py FIRST LAST [--samples 128] [--side 40] [--links 0.1]
                                  [--keep FOLDER] [--whole] [--all]

Each seed from FIRST to LAST makes a scene of some meshes with materials of random nodes, lamps, a
world and settings, and renders it by path tracing and by Cycles. Of what differs beyond noise all
is taken out that can be while it still differs; the rest is printed, and stored as a blend file
with --keep. What it was becomes a row of tests/parity.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries

import local_addon
from dualcone.chart.cycles import silent, without_bias

local_addon.load()  # puts the root on the path
from tests.parity import judge  # noqa: E402
from tests.parity.chance import Maker  # noqa: E402
from tests.parity.reduction import description, reduce  # noqa: E402


def compare(scene: Any, samples: int) -> tuple[str, str]:
    """Verdict and figures."""
    theirs = judge.cycles(scene, samples, 0), judge.cycles(scene, samples, 1)
    expected = judge.Reference.of(theirs)
    with judge.warnings_heard() as heard:
        ours = judge.ours(scene, "PATH", samples, 2), judge.ours(scene, "PATH", samples, 3)
    row = judge.Row("fuzz", "", lambda stage: None, {})
    outcome = judge.Outcome(row, expected, ours, None, tuple(dict.fromkeys(heard)))
    energy = " ".join(f"{share:.3f}" for share in outcome.energy[:3])
    error = float(outcome.energy_error[:3].max())
    figures = f"energy {energy} +-{error:.3f}  relMSE {outcome.relative_mse:.1e}"
    figures += f" +-{outcome.relative_mse_error:.1e}"
    return outcome.verdict, figures + "".join(f"; {line}" for line in outcome.warnings)


def prepared(seed: int, links: float, samples: int, side: int) -> Any:
    """Make the scene of a seed, without limits of light."""
    scene = Maker(seed, links).build()
    without_bias(scene, samples, 0)
    scene.render.resolution_x = scene.render.resolution_y = side
    scene.render.resolution_percentage = 100
    return scene


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--side", type=int, default=40, help="pixels")
    parser.add_argument("--links", type=float, default=0.1, help="share of sockets with nodes")
    parser.add_argument("--keep", type=Path, help="folder for scenes that differ")
    parser.add_argument("--all", action="store_true", help="print those that agree too")
    parser.add_argument("--whole", action="store_true", help="do not reduce what differs")
    return parser.parse_args()


def main() -> None:
    arguments = parse_arguments()
    counts: Counter[str] = Counter()
    with local_addon.registered():
        for seed in range(arguments.first, arguments.last + 1):
            with silent():
                scene = prepared(seed, arguments.links, arguments.samples, arguments.side)
                verdict, figures = compare(scene, arguments.samples)
                counts[verdict] += 1
                if verdict == "differs" and not arguments.whole:
                    reduce(scene, lambda: compare(scene, arguments.samples)[0] == "differs")
                    figures += "\n  " + compare(scene, arguments.samples)[1]
            if verdict == "differs" or arguments.all:
                print(
                    f"{seed}: {verdict}  {figures}\n    {description(scene)}",
                    file=sys.stderr,
                    flush=True,
                )
            if arguments.keep and verdict == "differs":
                arguments.keep.mkdir(parents=True, exist_ok=True)
                with silent():
                    bpy.ops.wm.save_as_mainfile(filepath=str(arguments.keep / f"{seed}.blend"))
    print(dict(counts), file=sys.stderr)


if __name__ == "__main__":
    main()
