"""Time and memory against the size of what is rendered: triangles, pixels, window, lights.

python scripts/scaling.py [--full] [--write-docs]

Each point is measured in a process of its own, so that its peak memory is its own. Seconds are
processor time of all threads, which other work on the machine hardly changes.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from time import process_time
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "scaling"
DOCS = ROOT / "docs" / "scaling.md"
FIGURE = Path("images") / "scaling.svg"
FRAME = 10

Measured = dict[str, float]


@dataclass(frozen=True)
class Axis:
    """What grows, at which sizes it is measured, and which of what is measured it moves."""

    name: str
    label: str
    values: tuple[float, ...]
    # Of a run with --full.
    more: tuple[float, ...]
    shown: tuple[str, ...]


AXES = (
    Axis("triangles", "triangles", (1e4, 1e5, 1e6), (4e6, 1e7), ("export", "build", "pass 1")),
    Axis("pixels", "pixels", (3e4, 1e5, 3e5, 1e6), (3e6, 8e6), ("pass 1", "pass 2")),
    Axis("window", "frames in the window", (1, 3, 7, 15), (), ("pass 1", "pass 2")),
    Axis("lights", "lamps", (1, 10, 100, 1000, 10000), (), ("build", "pass 1")),
)
SIZE = (200, 150)
QUANTITIES = ("export", "build", "pass 1", "pass 2", "memory")
UNITS = {"memory": "MB"}


def measure(axis: str, value: float) -> Measured:
    """Render one point of an axis in this process."""
    import bpy  # first: it brings its own numpy settings and libraries

    import measure as tools  # also loads the add-on

    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_landscape(int(value) if axis == "triangles" else 20_000)
    add_lamps(int(value) if axis == "lights" else 4)
    add_camera()
    size = SIZE
    if axis == "pixels":
        height = math.sqrt(value * 3 / 4)
        size = (round(height * 4 / 3), round(height))
    scene = tools.Scene()
    is_shared = axis in ("pixels", "window")
    settings: dict[str, Any] = {"samples": 4, "diffuse_bounces": 1, "glossy_bounces": 1}
    settings |= {"method": "DUAL_CONE" if is_shared else "PATH"}
    settings |= {"window": int(value) if axis == "window" else 1, "block": 7}
    since = process_time()
    scene.exported(FRAME, size)
    export = process_time() - since
    rendering = scene.render([FRAME], size, settings)
    whole = sum(rendering.seconds.values()) - rendering.seconds["export"]
    share = rendering.cpu_seconds / whole
    return {
        "export": export,
        "build": rendering.seconds["build"] * share,
        "pass 1": rendering.seconds["pass_1"] * share,
        "pass 2": rendering.seconds["pass_2"] * share,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def add_landscape(triangles: int) -> None:
    """Add hills 20 m wide."""
    import bpy
    import numpy as np

    cells = max(1, round(math.sqrt(triangles / 2)))
    steps = np.linspace(-10.0, 10.0, cells + 1, dtype=np.float32)
    x, y = np.meshgrid(steps, steps)
    height = 0.6 * np.sin(0.9 * x) * np.cos(1.3 * y) + 0.05 * np.sin(5.0 * x * y)
    corner = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    quads = np.stack([corner, corner + 1, corner + cells + 2, corner + cells + 1], axis=1)
    mesh: Any = bpy.data.meshes.new("hills")
    mesh.vertices.add(x.size)
    mesh.vertices.foreach_set("co", np.stack([x, y, height], axis=-1).astype(np.float32).ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.astype(np.int32).ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    add_object(mesh)


def add_lamps(count: int) -> None:
    """Add lamps 1 m above the hills, of equal light in total."""
    import bpy
    import numpy as np

    for index, (x, y) in enumerate(np.random.default_rng(1).uniform(-10.0, 10.0, (count, 2))):
        lamp: Any = bpy.data.lights.new(f"lamp {index}", "POINT")
        lamp.energy, lamp.shadow_soft_size = 1000.0 / count, 0.02
        add_object(lamp).location = (x, y, 1.6)


def add_camera() -> None:
    """Add a camera that moves."""
    import bpy

    scene: Any = bpy.context.scene
    scene.camera = add_object(bpy.data.cameras.new("camera"))
    scene.camera.rotation_euler = (1.0, 0.0, 0.0)
    for frame, x in ((1, -1.0), (20, 1.0)):
        scene.camera.location = (x, -14.0, 9.0)
        scene.camera.keyframe_insert("location", frame=frame)


def add_object(data: Any) -> Any:
    import bpy

    scene: Any = bpy.context.scene
    owner = bpy.data.objects.new(data.name, data)
    scene.collection.objects.link(owner)
    return owner


def measured_apart(axis: str, value: float) -> Measured:
    """Measure a point in another process."""
    command = [sys.executable, __file__, "--point", axis, str(value)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(output.splitlines()[-1])


def exponent(values: Sequence[float], numbers: Sequence[float]) -> float:
    """Return the slope of the straight line through logarithms that fits best."""
    if min(numbers) <= 0.0:
        return math.nan
    x, y = [math.log(v) for v in values], [math.log(n) for n in numbers]
    middle = sum(x) / len(x)
    spread = sum((a - middle) ** 2 for a in x)
    return sum((a - middle) * b for a, b in zip(x, y, strict=True)) / spread


def last_exponent(values: Sequence[float], numbers: Sequence[float]) -> float:
    """Return the slope between the two largest sizes, where what is fixed counts least."""
    return exponent(values[-2:], numbers[-2:])


Found = dict[str, dict[float, Measured]]


def rows(found: Found) -> list[list[str]]:
    """Tabulate everything, and the exponents."""
    table = []
    for axis in AXES:
        points = found[axis.name]
        for value, measured in points.items():
            numbers = [f"{measured[name]:.3g}" for name in QUANTITIES]
            table.append([f"{value:,.0f} {axis.label}", *numbers])
        for title, slope in (("exponent, all", exponent), ("exponent, last two", last_exponent)):
            slopes = []
            for name in QUANTITIES:
                is_moved = name in (*axis.shown, "memory")
                numbers = [measured[name] for measured in points.values()]
                slopes.append(f"{slope(list(points), numbers):.2f}" if is_moved else "")
            table.append([f"{axis.label}: {title}", *slopes])
    return table


HEADER = ["", *(f"{name} [{UNITS.get(name, 's')}]" for name in QUANTITIES)]
COLORS = {
    "export": "#54a24b",
    "build": "#f2a154",
    "pass 1": "#4c78a8",
    "pass 2": "#e45756",
    "memory": "#9d755d",
}
PANEL, MARGIN = (230, 180), 46


def drawn(found: Found) -> str:
    """Draw a panel for each axis, both of its scales logarithmic, as SVG."""
    panels = [panel(axis, found[axis.name], index) for index, axis in enumerate(AXES)]
    width, height = len(AXES) * (PANEL[0] + MARGIN) + 20, PANEL[1] + 90
    names = [
        f'<text x="{MARGIN + 110 * i}" y="16" fill="{COLORS[name]}">{name} '
        f"[{UNITS.get(name, 's')}]</text>"
        for i, name in enumerate(QUANTITIES)
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="white"/>'
        + "".join(names + panels)
        + "</svg>\n"
    )


def panel(axis: Axis, points: dict[float, Measured], index: int) -> str:
    """Draw the curves of one axis."""
    shown = (*axis.shown, "memory")
    numbers = [measured[name] for measured in points.values() for name in shown]
    across = scale([*points], PANEL[0])
    up = scale(numbers, PANEL[1])
    left, bottom = MARGIN + index * (PANEL[0] + MARGIN), PANEL[1] + 34
    parts = [
        f'<rect x="{left}" y="{bottom - PANEL[1]}" width="{PANEL[0]}" height="{PANEL[1]}" '
        'fill="none" stroke="#bbb"/>',
        f'<text x="{left + PANEL[0] / 2}" y="{bottom + 34}" text-anchor="middle">'
        f"{escape(axis.label)}</text>",
    ]
    for value in points:
        x = left + across(value)
        parts.append(f'<text x="{x:.0f}" y="{bottom + 16}" text-anchor="middle">{short(value)}')
        parts.append("</text>")
    for power in range(math.floor(math.log10(min(numbers))), math.ceil(math.log10(max(numbers)))):
        y = bottom - up(10.0**power)
        if bottom - PANEL[1] <= y <= bottom:
            parts.append(f'<text x="{left - 4}" y="{y:.0f}" text-anchor="end">1e{power}</text>')
            parts.append(f'<path d="M{left} {y:.0f}h{PANEL[0]}" stroke="#eee"/>')
    for name in shown:
        line = [(left + across(v), bottom - up(m[name])) for v, m in points.items()]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in line)
        color = COLORS[name]
        parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{color}"/>' for x, y in line]
    return "".join(parts)


def scale(numbers: Sequence[float], length: float) -> Callable[[float], float]:
    """Return where a number stands along an axis that holds all of them."""
    logs = [math.log(number) for number in numbers if number > 0.0]
    low, high = min(logs), max(logs)
    return lambda n: (0.05 + 0.9 * (math.log(max(n, 1e-6)) - low) / (high - low)) * length


def short(value: float) -> str:
    """Write a number in few characters."""
    for limit, unit in ((1e6, "M"), (1e3, "k")):
        if value >= limit:
            return f"{value / limit:g}{unit}"
    return f"{value:g}"


def document(table: list[list[str]], about: str) -> str:
    """Write the page of the documentation."""
    lines = ["| " + " | ".join(row) + " |" for row in [HEADER, ["---"] * len(HEADER), *table]]
    return f"""# Scaling

Written by `make scaling SCALING_FLAGS=--write-docs`; `--full` adds 10 million triangles and
8 million pixels. {about}

![Time and memory against triangles, pixels, window and lamps]({FIGURE.as_posix()})

A landscape of 20,000 triangles under four lamps at {SIZE[0]} x {SIZE[1]} pixels, 4 samples,
1 bounce; one of these grows. Seconds are processor time of all threads; export includes what
Blender takes to evaluate the frame, and the first one of a process reads everything. Memory is
the peak of the whole process, Blender included. Triangles and lamps: Path Tracing; pixels and
window: Dual Cone, which traces every frame it borrows from. An exponent of 1 means that twice the
size takes twice as much.

""" + "\n".join([*lines, ""])


def main() -> None:
    """Measure every point, print the table, draw the chart."""
    parser = argparse.ArgumentParser(description="Measure how time and memory grow.")
    parser.add_argument("--full", action="store_true", help="the largest sizes too: 10 GB, an hour")
    parser.add_argument("--quick", action="store_true", help="two sizes of each: does it run?")
    parser.add_argument("--write-docs", action="store_true", help="write docs/scaling.md")
    parser.add_argument("--point", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.point:
        axis, value = options.point
        print(json.dumps(measure(axis, float(value))))
        return
    found: Found = {}
    for axis in AXES:
        values = axis.values + (axis.more if options.full else ())
        values = axis.values[:2] if options.quick else values
        found[axis.name] = {value: measured_apart(axis.name, value) for value in values}
    table = rows(found)
    for row in [HEADER, *table]:
        print(f"{row[0]:<34}" + "".join(f"{cell:>13}" for cell in row[1:]))
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "scaling.svg").write_text(drawn(found))
    print(f"chart: {OUT / 'scaling.svg'}")
    if options.write_docs:
        from dualcone.chart.scene import machine

        (DOCS.parent / FIGURE).write_text(drawn(found))
        DOCS.write_text(document(table, f"Measured on: {machine()}."))


if __name__ == "__main__":
    main()
