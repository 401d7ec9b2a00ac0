"""Compare DualCone with Cycles, feature by feature: `make parity`.

    python scripts/parity.py [--only WORDS] [--references] [--no-dual-cone] [--write-docs]

Renders the scenes of `tests/parity` by path tracing and by DUAL_CONE, and compares them with stored
pictures of Cycles, which are rendered where they are missing or older than their script. Writes
out/parity/index.html; with --write-docs the table of docs/parity.md.
"""

from __future__ import annotations

import argparse
import html
import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np

import local_addon
from dualcone.chart.cycles import silent
from pictures import save_png

local_addon.load()  # puts the root on the path
from tests.parity import judge  # noqa: E402
from tests.parity.catalogue import ROWS  # noqa: E402
from tests.parity.judge import Outcome, Picture, Reference  # noqa: E402
from tests.parity.rows import Row  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "parity"
DOCS = ROOT / "docs" / "parity.md"
# How much differences are enlarged on the page.
DIFFERENCE_GAIN = 4.0


def main() -> None:
    """Render what the arguments select."""
    arguments = parse_arguments()
    words = [word.lower() for word in arguments.only]
    rows = [r for r in ROWS if all(word in f"{r.group} {r.name}".lower() for word in words)]
    outcomes: list[Outcome] = []
    with local_addon.registered(), silent():
        for row in rows:
            started = time.perf_counter()
            expected = reference(row, arguments.references)
            if not arguments.references:
                outcomes.append(judge.outcome(row, expected, not arguments.no_dual_cone))
                tell(f"{line_of(outcomes[-1])}  {time.perf_counter() - started:.1f} s")
    if outcomes:
        write_page(outcomes)
        tell(summary(outcomes))
    if arguments.write_docs:
        write_docs(outcomes)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="WORD", help="rows with these words"
    )
    parser.add_argument("--references", action="store_true", help="render the Cycles pictures anew")
    parser.add_argument("--no-dual-cone", action="store_true", help="leave DUAL_CONE out")
    parser.add_argument("--write-docs", action="store_true", help="write docs/parity.md")
    return parser.parse_args()


def reference(row: Row, anew: bool) -> Reference:
    """Return the stored reference, or render and store it."""
    stored = None if anew else Reference.load(row)
    if stored is None:
        made = judge.reference(row)
        made.save(row, f"Blender {bpy.app.version_string}: make parity-references")
        tell(f"Cycles: {row.group}: {row.name}")
        return Reference.load(row) or made
    return stored


def tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def cells(outcome: Outcome) -> list[str]:
    """Return the columns of a row as text."""
    name = f"{outcome.row.group}: {outcome.row.name}"
    if outcome.path is None:
        return [name, "", "", "", outcome.verdict]
    energy = " ".join(f"{channel:.3f}" for channel in outcome.energy[:3])
    if abs(outcome.energy[3] - 1.0) > 1e-3:
        energy += f" ({outcome.energy[3]:.3f})"
    bias = f"{100.0 * outcome.bias:+.2f} %" if math.isfinite(outcome.bias) else "-"
    error = f"{outcome.relative_mse:.1e}"
    if outcome.row.is_strewn:
        error = f"({error})"
    return [name, energy, error, bias, outcome.verdict]


def line_of(outcome: Outcome) -> str:
    name, energy, error, bias, verdict = cells(outcome)
    return f"{name:50} {energy:28} {error:9} {bias:9} {verdict:18} {'; '.join(outcome.warnings)}"


def summary(outcomes: Sequence[Outcome]) -> str:
    counts = Counter(outcome.verdict for outcome in outcomes)
    line = f"{len(outcomes)} rows: "
    line += ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
    judged = [outcome for outcome in outcomes if outcome.dual_cone is not None]
    biased = sum(abs(outcome.bias) > judge.BIAS_MAX for outcome in judged)
    return f"{line}; DUAL_CONE off by more than 0.3 %: {biased} of {len(judged)}"


def write_docs(outcomes: Sequence[Outcome]) -> None:
    """Write the table below the text of docs/parity.md."""
    marker = "<!-- table -->\n"
    text = DOCS.read_text(encoding="utf-8").partition(marker)[0]
    header = "| Feature | Energy of R, G, B (alpha) | relMSE | DUAL_CONE | Verdict |"
    lines = [summary(outcomes) + ".", "", header, "|---|---|---|---|---|"]
    lines += ["| " + " | ".join(cells(outcome)) + " |" for outcome in outcomes]
    said = sorted({f"- {o.row.group}: {o.row.name}: {w}" for o in outcomes for w in o.warnings})
    lines += ["", "## What the program says", "", *said, ""]
    DOCS.write_text(text + marker + "\n" + "\n".join(lines), encoding="utf-8")


def write_page(outcomes: Sequence[Outcome]) -> None:
    """Write the table with its pictures."""
    OUT.mkdir(parents=True, exist_ok=True)
    body = "\n".join(html_row(outcome) for outcome in outcomes)
    page = f"""<!doctype html><meta charset="utf-8"><title>DualCone and Cycles</title>
<style>body{{font:14px sans-serif}} td{{padding:4px 12px;vertical-align:top}}
img{{image-rendering:pixelated;height:128px}} .differs,.refused{{background:#fdd}}
.black{{background:#fdd}} .agrees{{background:#dfd}} .named,.noisy{{background:#ffd}}</style>
<h1>DualCone and Cycles</h1><p>{html.escape(summary(outcomes))}</p>
<p>Cycles, PATH, DUAL_CONE, and PATH minus Cycles times {DIFFERENCE_GAIN:g} on grey.</p>
<table>{body}</table>"""
    (OUT / "index.html").write_text(page, encoding="utf-8")


def html_row(outcome: Outcome) -> str:
    row = outcome.row
    save_png(panels(outcome), OUT / f"{row.key}.png")
    texts = "<br>".join(html.escape(text) for text in [*cells(outcome), *outcome.warnings])
    kind = outcome.verdict.partition(",")[0]
    return f'<tr class="{kind}"><td>{texts}</td><td><img src="{row.key}.png"></td></tr>'


def panels(outcome: Outcome) -> Picture:
    """Set the pictures side by side, display-referred."""
    expected = outcome.reference.picture
    path = expected * 0.0 if outcome.path is None else np.mean(outcome.path, axis=0)
    shared = path if outcome.dual_cone is None else outcome.dual_cone
    difference = 0.5 + DIFFERENCE_GAIN * (display(path) - display(expected))
    shown = [display(expected), display(path), display(shared), difference]
    return np.hstack(shown)


def display(picture: Picture) -> Picture:
    """Return the colour channels as sRGB, without tone mapping."""
    linear = np.clip(picture[..., :3], 0.0, 1.0)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


if __name__ == "__main__":
    main()
