"""Chart the speed and the accuracy of every method on some scenes.

python -m dualcone.chart SCENE.blend ... --frames 24-31 --methods path dual_cone cycles --out DIR

Run it again to go on where it ended; Ctrl-C loses one render at most.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy  # noqa: F401  first: it brings its own numpy settings and libraries

from . import methods, report
from .run import Options, Plan, run, say
from .scene import SceneError, machine
from .store import Store, StoreError

QUICK_METHODS = ("path", "path-split-4", "dual_cone", "cycles", "path-oidn", "dual_cone-oidn")
QUICK_FLAGS = (
    *("--frames", "30-33", "--size", "72x48", "--budgets", "4-64"),
    *("--reference-samples", "512", "--minutes", "3", "--methods", *QUICK_METHODS),
)


def frames(text: str) -> tuple[int, ...]:
    """Read A-B."""
    first, _, last = text.partition("-")
    return tuple(range(int(first), int(last or first) + 1))


def size(text: str) -> tuple[int, int]:
    """Read WxH."""
    width, _, height = text.partition("x")
    return int(width), int(height)


def budgets(text: str) -> tuple[int, ...]:
    """Read A-B: powers of two from A to B."""
    first, _, last = text.partition("-")
    ladder = [int(first)]
    while ladder[-1] * 2 <= int(last or first):
        ladder.append(ladder[-1] * 2)
    return tuple(ladder)


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    made = argparse.ArgumentParser(
        prog="python -m dualcone.chart",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=f"methods: all, {', '.join(methods.BY_NAME)}",
    )
    add = made.add_argument
    add("scenes", nargs="+", type=Path, metavar="SCENE.blend")
    add("--out", type=Path, required=True, help="folder for the rows and the report")
    add("--methods", nargs="+", default=["all"], metavar="METHOD")
    add("--frames", type=frames, default=frames("24-31"), metavar="A-B")
    add("--size", type=size, default=(96, 64), metavar="WxH")
    add("--budgets", type=budgets, default=budgets("4-1024"), metavar="A-B", help="samples")
    add("--seeds", type=int, default=2)
    add("--reference-samples", type=int, default=4096)
    add("--references", type=Path, default=Path("build/references"), help="folder that keeps them")
    add("--minutes", type=float, default=60, help="for the whole run; what fits is rendered")
    add("--unit-seconds", type=float, default=60, help="the longest that one point may take")
    add("--quick", action="store_true", help="small pictures, six methods, three minutes")
    add("--report-only", action="store_true", help="draw again what was measured")
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Render what is missing, then report."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = parser().parse_args(words)
    if given.quick:
        given = parser().parse_args([*words, *QUICK_FLAGS])
    store = Store(given.out)
    names = [str(path) for path in given.scenes]
    options = Options(given.frames, given.size, given.reference_samples)
    plan = Plan(tuple(given.methods), given.budgets, given.seeds, given.minutes, given.unit_seconds)
    try:
        if not given.report_only:
            say(machine())
            run(
                given.scenes,
                options,
                plan,
                store,
                given.references,
                lambda: report.write(store, names),
            )
        asked = report.write(store, names)
    except (SceneError, StoreError, ValueError, FileNotFoundError) as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("\ninterrupted: run it again to go on")
    for bar in report.bars_table(asked):
        print(f"{bar[0]:<44}{bar[1]:<14}{bar[2]:>10}{bar[3]:>10}  {bar[4]}")
    print(given.out / "index.html")


if __name__ == "__main__":
    main()
