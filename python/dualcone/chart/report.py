"""What a run leaves: plots, tables, strips of crops, and one HTML page that holds them all."""

from __future__ import annotations

import base64
import csv
import html
import importlib
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from .analysis import (
    TARGETS,
    Bar,
    Curves,
    bars,
    curves,
    relative_mse,
    speedup,
    subtract_model_difference,
    time_to,
)
from .measures import pulse_index
from .methods import BY_NAME
from .store import Row, Store, Unit

try:
    plots: Any = importlib.import_module(".plots", __package__)
except ImportError:  # No matplotlib: rows and tables are written all the same.
    plots = None

PULSE_PERIOD = 3  # frames in a block of PAPER at the default window
STRIP_BUDGET = 16  # of path tracing: all crops of a strip took about as long
Table = list[list[str]]

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 90rem; padding: 0 1rem }
table { border-collapse: collapse; margin: 1rem 0 }
td, th { padding: .2rem .7rem; text-align: right }
td:first-child, th:first-child { text-align: left } tr:nth-child(even) { background: #f4f4f4 }
img, svg { max-width: 100%; height: auto } .met { color: #2a7a2a } .missed { color: #b02020 }
"""


def light_of(blend: str) -> str | None:
    """Return how a scene is lit (interior, sun, overcast), from the card beside the file."""
    card = Path(blend).with_suffix(".toml")
    return tomllib.loads(card.read_text()).get("light") if card.exists() else None


def quality_table(found: Curves) -> Table:
    """Return by method the time to each error, and how many times faster than plain that is."""
    head = ["", *(f"relMSE {target:g}" for target in TARGETS)]
    rows = [[BY_NAME[name].label, *_cells(found, name)] for name in found]
    return [head, *rows]


def _cells(found: Curves, name: str) -> Iterable[str]:
    for target in TARGETS:
        seconds, gain = time_to(found[name], target), speedup(found, name, target)
        if seconds is None:
            yield "not reached"
        else:
            yield f"{seconds:.3g} s" + (f" ({gain:.2f} x)" if gain is not None else "")


def truth_table(scene: str, found: Curves, rows: Sequence[Row], store: Store) -> Table:
    """Return by method what stays when noise is gone: energy, squared bias, pulses, FLIP."""
    head = ["", "budget", "energy", "bias^2", "pulse index", "relMSE trimmed", "FLIP"]
    truth = store.reference(scene)
    table = [head]
    for name, curve in found.items():
        last = curve.points[-1]
        mine = [r for r in rows if (r.scene, r.method, r.budget) == (scene, name, last.budget)]
        seeds = {row.unit for row in mine}
        pictures = list(store.pictures(sorted(seeds)))
        bias = f"{truth.squared_bias(np.stack(pictures)):.1e}" if len(pictures) > 1 else ""
        pulse = pulse_index(np.array(last.changes), PULSE_PERIOD)
        trimmed = median(row.trimmed for row in mine)
        flip = float(np.mean([row.flip for row in mine]))
        cells = [str(last.budget), f"{last.energy_ratio:.4f}", bias, _number(pulse, ".2f")]
        cells += [f"{trimmed:.2e}", _number(flip, ".4f")]
        table.append([BY_NAME[name].label, *cells])
    return table


def _number(value: float, form: str) -> str:
    return "" if np.isnan(value) else f"{value:{form}}"


def bars_table(asked: Sequence[Bar]) -> Table:
    """Return what is asked and reached."""
    rows = [["asked", "scene", "bound", "reached", "verdict"]]
    for bar in asked:
        bound = f"{'>=' if bar.at_least else '<='} {bar.bound:.3g}"
        reached = "" if bar.reached is None else f"{bar.reached:.3g}"
        rows.append([bar.words, bar.scene, bound, reached, bar.verdict])
    return rows


def strip(scene: str, found: Curves, store: Store) -> Path | None:
    """Write the crops of a scene at about equal time; return the file."""
    if plots is None or "path" not in found:
        return None
    wanted = plots.nearest(found["path"], _budget_seconds(found))
    truth = store.reference(scene).pictures
    frame = len(truth) // 2
    crops = [plots.Crop("reference", plots.middle_of(truth[frame]))]
    for name, curve in found.items():
        point = plots.nearest(curve, wanted.seconds)
        for pictures in store.pictures([Unit(scene, name, point.budget, 1)]):
            words = f"{BY_NAME[name].label}\n{point.seconds:.3f} s, {relative_mse(point):.1e}"
            crops.append(plots.Crop(words, plots.middle_of(pictures[frame])))
    path = store.folder / f"crops-{scene}.png"
    plots.save_strip(crops, path)
    return path


def _budget_seconds(found: Curves) -> float:
    points = found["path"].points
    return min(points, key=lambda p: abs(np.log2(p.budget / STRIP_BUDGET))).seconds


def write(store: Store, scenes: Sequence[str]) -> list[Bar]:
    """Write the report of all rows so far; return the bars."""
    rows = store.rows()
    found = curves(rows)
    checks = store.checks()
    differences = {scene: check["difference"] for scene, check in checks.items()}
    subtract_model_difference(found, differences)
    lights = {Path(scene).stem: light_of(scene) for scene in scenes}
    asked: list[Bar] = []
    parts: list[str] = []
    for file in plots.save_plots(found, store.folder) if plots else []:
        drawing = "<svg" + file.read_text().partition("<svg")[2]
        parts += [heading(file.stem.replace("-", " against ")), drawing]
    for scene, curves_of in found.items():
        pulse = None
        if "dual_cone" in curves_of:
            changes = np.array(curves_of["dual_cone"].points[-1].changes)
            pulse = pulse_index(changes, PULSE_PERIOD)
        asked += bars(scene, lights.get(scene), curves_of, pulse)
        parts += scene_parts(scene, curves_of, rows, store, checks.get(scene))
    save_csv(bars_table(asked), store.folder / "bars.csv")
    parts.insert(0, heading("Bars") + table_html(bars_table(asked)))
    told = ", ".join(f"{name}: {value}" for name, value in store.experiment().items())
    body = f"<h1>Speed against accuracy</h1><p>{html.escape(told)}</p>" + "\n".join(parts)
    page = f"<!doctype html><meta charset=utf-8><title>DualCone</title><style>{STYLE}</style>{body}"
    (store.folder / "index.html").write_text(page)
    return asked


def scene_parts(
    scene: str,
    found: Curves,
    rows: Sequence[Row],
    store: Store,
    check: Mapping[str, float] | None,
) -> list[str]:
    """Return the page's part about one scene; its table goes into a file too."""
    quality = quality_table(found)
    save_csv(quality, store.folder / f"time-to-quality-{scene}.csv")
    parts = [heading(scene), sentence(check), table_html(quality)]
    parts += [table_html(truth_table(scene, found, rows, store))]
    picture = strip(scene, found, store)
    if picture is not None:
        data = base64.b64encode(picture.read_bytes()).decode()
        parts.append(f'<img alt="crops" src="data:image/png;base64,{data}">')
    return parts


def sentence(check: Mapping[str, float] | None) -> str:
    """Say what the comparison with the second engine gave."""
    if check is None:
        return "<p>The reference was not compared with a second engine.</p>"
    return (
        f"<p>Reference against Cycles: squared difference {check['difference']:.1e} "
        f"(standard error {check['error']:.1e}), energy ratio {check['energy_ratio']:.4f}. "
        "The difference is subtracted from Cycles' errors.</p>"
    )


def heading(words: str) -> str:
    """Return a heading."""
    return f"<h2>{html.escape(words)}</h2>"


def table_html(rows: Table) -> str:
    """Return a table whose first row is its head; verdicts are coloured."""

    def line(row: Sequence[str], tag: str) -> str:
        cells = (f'<{tag} class="{html.escape(c)}">{html.escape(c)}</{tag}>' for c in row)
        return f"<tr>{''.join(cells)}</tr>"

    return f"<table>{line(rows[0], 'th')}{''.join(line(row, 'td') for row in rows[1:])}</table>"


def save_csv(rows: Table, path: Path) -> None:
    """Write a table."""
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
