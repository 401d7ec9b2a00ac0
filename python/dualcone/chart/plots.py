"""The pictures of the chart, by matplotlib."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .analysis import Curve, Curves, Point
from .measures import WORST_SHARE, Pictures
from .methods import BY_NAME

# The linters know no matplotlib; and it must hear of its backend before pyplot is imported.
mpl: Any = importlib.import_module("matplotlib")
mpl.use("Agg")
plt: Any = importlib.import_module("matplotlib.pyplot")
ticker: Any = importlib.import_module("matplotlib.ticker")

# Colour by family; what is denoised is dashed.
COLORS = {
    "path": "#4c78a8",
    "dual_cone": "#e45756",
    "paper": "#f2a154",
    "bilateral": "#9d755d",
    "irradiance_cache": "#b279a2",
    "cycles": "#54a24b",
}
MARKERS = "osD^vP*X"
PANEL_INCHES = (5.0, 4.2)
LEGEND_LINE_INCHES = 0.15
LEGEND_COLUMNS = 2  # a panel has room for two names side by side
CALM = f"all but the worst {100 * WORST_SHARE:.1g} % of the pixels"
CROP = 3  # a crop shows 1/CROP of the picture in each direction


class Kind(NamedTuple):
    """A plot: its file, its axes, and where they come from."""

    file: str
    x_label: str
    y_label: str
    x: str
    y: str


KINDS = (
    Kind("relmse-seconds", "seconds a frame", "relMSE", "seconds", "relative_mse"),
    Kind("trimmed-seconds", "seconds a frame", f"relMSE of {CALM}", "seconds", "trimmed"),
    Kind("flicker-seconds", "seconds a frame", "flicker", "seconds", "flicker"),
    Kind("relmse-rays", "rays per pixel", "relMSE", "rays_per_pixel", "relative_mse"),
)


def save_plots(found: Mapping[str, Curves], folder: Path) -> list[Path]:
    """Write each plot as SVG and PNG, a panel for each scene; return the SVG files."""
    files: list[Path] = []
    for kind in KINDS:
        figure = plot(found, kind)
        for suffix in (".svg", ".png"):
            figure.savefig(folder / f"{kind.file}{suffix}", dpi=110)
        plt.close(figure)
        files.append(folder / f"{kind.file}.svg")
    return files


def plot(found: Mapping[str, Curves], kind: Kind) -> Any:
    """Draw one kind of plot."""
    panels = max(1, len(found))
    figure, axes = plt.subplots(1, panels, squeeze=False)
    handles: dict[str, Any] = {}
    for axis, (scene, curves) in zip(axes[0], found.items(), strict=False):
        for index, curve in enumerate(curves.values()):
            line = draw(axis, curve, kind, MARKERS[index % len(MARKERS)])
            if line is not None:
                handles[BY_NAME[curve.method].label] = line
        axis.set(title=scene, xscale="log", yscale="log", xlabel=kind.x_label)
        for side in (axis.xaxis, axis.yaxis):
            side.set_minor_formatter(ticker.NullFormatter())
        axis.grid(True, which="both", linewidth=0.3, alpha=0.5)
    axes[0][0].set_ylabel(kind.y_label)
    columns = LEGEND_COLUMNS * panels
    legend = LEGEND_LINE_INCHES * (2 - len(handles) // -columns)
    width, height = PANEL_INCHES
    figure.set_size_inches(width * panels, height + legend)
    figure.legend(handles.values(), handles, loc="lower center", ncol=columns, fontsize=7)
    figure.tight_layout(rect=(0, legend / (height + legend), 1, 1))
    return figure


def draw(axis: Any, curve: Curve, kind: Kind, marker: str) -> Any:
    """Draw a curve with the band of its seeds; None where nothing can be drawn."""
    rows = [(getattr(point, kind.x), getattr(point, kind.y)) for point in curve.points]
    rows = [(x, y) for x, y in rows if x > 0 and y.middle > 0]
    if not rows:
        return None
    method = BY_NAME[curve.method]
    family = next((name for name in COLORS if curve.method.startswith(name)), "path")
    x = [x for x, _ in rows]
    low, high = ([max(1e-9, getattr(y, end)) for _, y in rows] for end in ("low", "high"))
    axis.fill_between(x, low, high, color=COLORS[family], alpha=0.12, linewidth=0)
    (line,) = axis.plot(
        x,
        [y.middle for _, y in rows],
        color=COLORS[family],
        marker=marker,
        markersize=3.5,
        linestyle="--" if method.is_denoised else "-",
        linewidth=2.0 if curve.method == "dual_cone" else 1.0,
    )
    return line


class Crop(NamedTuple):
    """A picture of the strip and what is written below it."""

    words: str
    picture: Pictures


def save_strip(crops: Sequence[Crop], path: Path) -> None:
    """Write crops side by side, the reference first."""
    exposure = 1.0 / max(1e-6, float(np.percentile(crops[0].picture, 95)))
    columns = min(6, len(crops))
    rows = -(-len(crops) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(2.2 * columns, 1.9 * rows), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, crop in zip(axes.flat, crops, strict=False):
        axis.imshow(display(crop.picture * exposure), origin="lower", interpolation="nearest")
        axis.set_title(crop.words, fontsize=6)
    figure.tight_layout(pad=0.3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def middle_of(picture: Pictures) -> Pictures:
    """Return the middle of a picture, 1/CROP of it in each direction."""
    height, width, _ = picture.shape
    y, x = height * (CROP - 1) // (2 * CROP), width * (CROP - 1) // (2 * CROP)
    return picture[y : y + height // CROP, x : x + width // CROP]


def display(radiance: Pictures) -> Pictures:
    """Return scene-linear radiance as sRGB (IEC 61966-2-1), clipped."""
    linear = np.clip(radiance, 0.0, 1.0)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def nearest(curve: Curve, seconds: float) -> Point:
    """Return the point of a curve whose time is nearest, by ratio."""
    points = [point for point in curve.points if point.seconds > 0] or list(curve.points)
    return min(points, key=lambda p: abs(np.log(max(p.seconds, 1e-9) / seconds)))
