"""Where a frame's time goes: a table of parts, and a flame graph.

PYTHONPATH=build/profile/site python scripts/profile.py [--sample loader]

Linux's perf looks at every thread of this process a thousand times a second while a frame is
exported and rendered; `make profile` builds the renderer so that its stacks can be read.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import bpy  # noqa: F401  # first: it brings its own numpy settings and libraries

import dualcone.dualcone as core
import flame_graph
from measure import Resolution, Sample, machine

ROOT = Path(__file__).resolve().parent.parent
RECORDED = ROOT / "build" / "profile" / "perf.data"
PICTURE = ROOT / "docs" / "images"
FRAME = 31
SIZE: Resolution = (480, 320)
SETTINGS = {"method": "DUAL_CONE", "window": 1, "block": 7, "samples": 16}
SETTINGS |= {"diffuse_bounces": 4, "glossy_bounces": 4}
# The innermost file of the renderer on a stack says which part a sample belongs to.
PARTS = {
    "tracing rays": ("kernel/", "accel.rs"),
    "shading": (
        "surface.rs",
        "shader/",
        "image.rs",
        "sampling/bsdf/",
        "scene/",
        "optics/",
        "math/",
    ),
    "sampling lights": ("sampling/lights/", "sampling/discrete.rs"),
    "following paths": (
        "path.rs",
        "path/",
        "reuse/mod.rs",
        "reuse/plain.rs",
        "reuse/dual_cone/sample.rs",
    ),
    "random numbers": ("sampling/sampler.rs",),
    "borrowing": ("reuse/",),
    "films and passes": ("film.rs", "passes.rs", "render.rs"),
}
EXPORT, OTHER = "export and Python", "other"

Place = tuple[str, str]  # function, file
Stack = tuple[Place, ...]  # from the outermost call


def record(sample: Sample) -> None:
    """Export and render a frame while perf looks on."""
    RECORDED.parent.mkdir(parents=True, exist_ok=True)
    sample.render([FRAME], SIZE, {**SETTINGS, "samples": 1})  # tables that are made once
    sample.forget_exports()
    options = ["--event", "cpu-clock", "--freq", "997", "--call-graph", "fp"]
    command = ["perf", "record", "--quiet", *options, "--pid", str(os.getpid())]
    watcher = subprocess.Popen([*command, "--output", str(RECORDED)])
    time.sleep(1.0)  # until it looks on
    sample.render([FRAME], SIZE, SETTINGS)
    watcher.send_signal(signal.SIGINT)
    watcher.wait()


class Symbols:
    """Names the places of the renderer's code, inlined functions too."""

    def __init__(self, library: str, addresses: Iterable[int]) -> None:
        ordered = "\n".join(f"{address:#x}" for address in sorted(set(addresses)))
        command = ["addr2line", "--functions", "--inlines", "--demangle", "--addresses"]
        output = subprocess.run(
            [*command, "--exe", library], input=ordered, capture_output=True, text=True, check=True
        )
        self.places: dict[int, Stack] = {}
        lines = iter(output.stdout.splitlines())
        address, chain = 0, []
        for line in lines:
            if line.startswith("0x"):
                self.places[address] = tuple(reversed(chain))
                address, chain = int(line, 16), []
            else:
                chain.append((short(line), next(lines).rpartition(":")[0]))
        self.places[address] = tuple(reversed(chain))


def short(function: str) -> str:
    """Leave out hashes, generics and the crate's name."""
    bare = re.sub(r"::h[0-9a-f]{16}$", "", function).replace("dualcone::", "")
    while bare != (bare := re.sub(r"<[^<>]*>", "", bare)):
        pass
    return bare.strip(":")


def segments(library: str) -> list[tuple[int, int]]:
    """Return (offset in the file, address) of what is loaded of a library, in rising order."""
    listing = subprocess.run(
        ["readelf", "--segments", "--wide", library], capture_output=True, text=True, check=True
    )
    loads = [line.split() for line in listing.stdout.splitlines() if line.split()[:1] == ["LOAD"]]
    return sorted((int(offset, 16), int(address, 16)) for _, offset, address, *_ in loads)


def samples(library: str) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Yield the thread's name and the stack of each sample, from the innermost call.

    A place of `library` is its address there, any other one -1 and its symbol.
    """
    output = subprocess.run(
        ["perf", "script", "--input", str(RECORDED), "--fields", "comm,tid,ip,sym,dso"],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = segments(library)
    place = re.compile(r"\s+([0-9a-f]+) (.*) \((.*)\)$")
    thread, stack = "", []
    for line in output.stdout.splitlines():
        if not line.strip():
            if stack:
                yield thread, stack
            stack = []
        elif found := place.match(line):
            if found[3] == library:
                # Of a library perf prints the offset in its file.
                offset = int(found[1], 16)
                start, base = loaded[bisect_right(loaded, (offset, sys.maxsize)) - 1]
                stack.append((offset - start + base, ""))
            else:
                stack.append((-1, found[2].partition("+")[0]))
        else:
            thread = line.strip()


def stacks(library: str) -> Counter[Stack]:
    """Count the stacks, from the outermost call, with what is not the renderer's as one name."""
    seen = list(samples(library))
    symbols = Symbols(library, (a for _, stack in seen for a, _ in stack if a >= 0))
    counted: Counter[Stack] = Counter()
    for thread, stack in seen:
        if not thread.startswith("dualcone") and all(address < 0 for address, _ in stack):
            counted[((EXPORT, ""),)] += 1
            continue
        places: list[Place] = []
        for address, symbol in reversed(stack):
            places += symbols.places[address] if address >= 0 else [(symbol, "")]
        counted[tuple(places)] += 1
    return counted


def part_of(stack: Stack) -> str:
    """Return the part that a stack belongs to."""
    if stack[0][0] == EXPORT:
        return EXPORT
    for _, file in reversed(stack):
        _, is_own, path = file.rpartition(f"{ROOT}/src/")
        for part, beginnings in PARTS.items():
            if is_own and path.startswith(beginnings):
                return part
    return OTHER


def own_frames(stack: Stack) -> tuple[str, ...]:
    """Return the names for the picture: the renderer's functions, each with its module."""
    names: list[str] = []
    for name, file in stack:
        _, is_own, path = file.rpartition(f"{ROOT}/src/")
        if is_own:
            module = path.removesuffix(".rs").removesuffix("/mod").replace("/", "::")
            names.append(f"{module}::{name.rpartition('::')[2]}")
    return tuple(names) or (stack[0][0],)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description="Show where a frame's time goes.")
    parser.add_argument("--sample", default="loader")
    options = parser.parse_args(arguments)
    missing = [tool for tool in ("perf", "addr2line", "readelf") if not shutil.which(tool)]
    if missing:
        print(f"profile: SKIPPED, not installed: {', '.join(missing)} (linux-perf, binutils)")
        return
    record(Sample(options.sample))
    counted = stacks(str(core.__file__))
    total = counted.total()
    parts: Counter[str] = Counter()
    for stack, count in counted.items():
        parts[part_of(stack)] += count
    settings = ", ".join(str(value) for value in SETTINGS.values())
    print(f"{machine()}; {options.sample}, {SIZE[0]} x {SIZE[1]}, {settings}; {total} samples")
    for part, count in parts.most_common():
        print(f"{part:<20}{count / total:>8.1%}")
    folded: Counter[tuple[str, ...]] = Counter()
    for stack, count in counted.items():
        folded[own_frames(stack)] += count
    path = PICTURE / f"profile-{options.sample}.svg"
    path.write_text(flame_graph.drawn(folded, f"{options.sample}: a frame of DUAL_CONE"))
    print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
