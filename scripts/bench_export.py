"""What the export of a frame of a million triangles costs, by function.

python scripts/bench_export.py [--triangles 1000000] [--rounds 5]

Scenes: `unchanged` renders the same frame again, `deforming` moves every vertex between frames.
Times are medians and leave out what Blender takes to evaluate the frame.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
from collections.abc import Iterator
from statistics import median
from time import process_time
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries

import dualcone
import scaling
from dualcone.chart.scene import Scene, addon
from measure import machine  # also loads the add-on

SIZE = (320, 240)
TARGETS = {"unchanged": "<= 20", "deforming": "<= 250"}
SHOWN = 8  # functions of the breakdown
EVALUATION = ("go_to", "evaluated_depsgraph_get")


def build(triangles: int, is_deforming: bool) -> Scene:
    """Open a landscape; a deforming one swells with a shape key."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scaling.add_landscape(triangles)
    scaling.add_lamps(1)
    scaling.add_camera()
    if is_deforming:
        hills: Any = next(o for o in bpy.data.objects if o.type == "MESH")
        hills.shape_key_add(name="flat")
        swollen = hills.shape_key_add(name="swollen")
        for index in range(0, len(swollen.data), 97):
            swollen.data[index].co.z += 0.2
        for frame, value in ((1, 0.0), (20, 1.0)):
            swollen.value = value
            swollen.keyframe_insert("value", frame=frame)
    return Scene()


def export(scene: Scene, frame: int) -> tuple[float, float]:
    """Return seconds by the clock and of the processor that the export of a frame takes."""
    scene.go_to(frame, SIZE)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    set_frame = bpy.context.scene.frame_set
    since = process_time()
    exported = addon("export.frame").export_frame(
        depsgraph,
        frame,
        SIZE,
        scene.cache,
        dualcone,
        lambda: False,
        lambda to, subframe: set_frame(to, subframe=subframe),
    )
    return exported.seconds, process_time() - since


def breakdown(scene: Scene, frame: int) -> Iterator[tuple[str, float]]:
    """Yield functions of an export and the seconds in each, without those it calls."""
    profile = cProfile.Profile()
    profile.runcall(export, scene, frame)
    stats: Any = pstats.Stats(profile)
    own = {
        where: numbers[2] for where, numbers in stats.stats.items() if where[2] not in EVALUATION
    }
    for (file, _, name), seconds in sorted(own.items(), key=lambda item: -item[1])[:SHOWN]:
        yield f"{file.rpartition('/')[2]} {name}", seconds


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure the export of large scenes.")
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="few triangles: does it run?")
    options = parser.parse_args()
    triangles = 2000 if options.quick else options.triangles
    print(f"{machine()}; {triangles:,} triangles, medians of {options.rounds}")
    for name, target in TARGETS.items():
        is_deforming = name == "deforming"
        scene = build(triangles, is_deforming)
        frames = [2 + index * is_deforming for index in range(options.rounds + 2)]
        times = [export(scene, frame) for frame in frames[:-1]]
        clock, cpu = zip(*times[1:], strict=True)
        print(f"{name}: {median(clock) * 1e3:.1f} ms, processor {median(cpu) * 1e3:.1f} ms", end="")
        print(f" (target {target} ms)")
        for function, seconds in breakdown(scene, frames[-1]):
            print(f"    {seconds * 1e3:8.1f}  {function}")


if __name__ == "__main__":
    main()
