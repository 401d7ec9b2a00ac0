"""What outlives one engine object: finished frames, export caches, warnings already shown.

Without Persistent Data Blender makes a new engine for every frame of an animation, while DualCone
renders several frames together. This module keeps what the next engine object needs, decides which
frames are rendered together and drives the compiled renderer. It knows nothing of bpy.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import time
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from types import ModuleType
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

# Esc has to be answered within 100 ms, and the renderer needs a part of that to wind down.
POLL_SECONDS = 0.05
# More often, copying pictures to the screen would cost noticeable time.
PREVIEW_SECONDS = 0.5
# Without windows Blender writes every status line to its log.
LOG_SECONDS = 2.0
# Film, records and finished passes beside the scene: the most that the renderer may take.
BYTES_PER_PIXEL_AND_FRAME = 120
# A mesh of its own in every frame, with its tree.
BYTES_PER_TRIANGLE = 200
# Share of the machine's memory for the pixels of frames rendered together, and for their scenes.
MEMORY_SHARE = 0.25


CacheT = TypeVar("CacheT")


class Stopped(Exception):
    """The user pressed Esc."""


class RenderError(Exception):
    """The renderer refused or failed; the message is for the user."""


class ViewKey(NamedTuple):
    """Whose frames they are. All stereo views show the same picture, so they share a key."""

    scene: str
    view_layer: str


class Region(NamedTuple):
    """The full frame and the rectangle rendered of it, in pixels from the bottom left."""

    width: int
    height: int
    x_min: int
    y_min: int
    x_max: int
    y_max: int

    @classmethod
    def with_border(
        cls, width: int, height: int, border: tuple[float, float, float, float] | None
    ) -> Region:
        """Make a region from Blender's border: x_min, y_min, x_max, y_max as shares of the frame.

        Blender multiplies and truncates in single precision; doubles would be a pixel off at times.
        """
        if border is None:
            return cls(width, height, 0, 0, width, height)
        lengths = (width, height, width, height)
        corners = [
            int(np.float32(share) * np.float32(length))
            for share, length in zip(border, lengths, strict=True)
        ]
        return cls(width, height, *corners)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the rectangle."""
        return self.y_max - self.y_min, self.x_max - self.x_min


@dataclass(frozen=True)
class Recipe:
    """Everything but the scene that a frame's pixels depend on."""

    settings: tuple[tuple[str, Any], ...]
    region: Region
    step: int
    # Passes that are wanted, by their names in the contract.
    passes: tuple[str, ...] = ("Combined",)


@dataclass(frozen=True)
class Order:
    """What Blender asks for: `frame` now, and the targets, which begin with it, are coming."""

    frame: int
    subframe: float
    view: ViewKey
    recipe: Recipe
    targets: list[int]
    threads: int
    # Factor on the finished picture.
    exposure: float = 1.0


@dataclass
class RenderedFrame:
    """One finished frame and the scene it was rendered from."""

    frame: int
    content_hash: Hashable
    passes: dict[str, np.ndarray]
    report: dict[str, Any]


@dataclass
class _View:
    recipe: Recipe | None = None
    frames: dict[int, RenderedFrame] = field(default_factory=dict)
    export_cache: Any = None


class Session:
    """The store that one render job fills and empties."""

    def __init__(self) -> None:
        self._views: dict[ViewKey, _View] = {}
        self._warned: set[str] = set()

    def clear(self) -> None:
        """Forget everything: a job begins or ends, or another file was loaded."""
        self._views.clear()
        self._warned.clear()

    def export_cache(self, key: ViewKey, make: Callable[[], CacheT]) -> CacheT:
        """Return the exporter's own cache of this view, made on first use."""
        view = self._views.setdefault(key, _View())
        if view.export_cache is None:
            view.export_cache = make()
        return view.export_cache

    def take(
        self, key: ViewKey, recipe: Recipe, frame: int, content_hash: Hashable
    ) -> RenderedFrame | None:
        """Hand over a finished frame, once.

        Everything stored for the view is dropped when the recipe or the scene is not the one that
        the frame was rendered from: an edit under way must never meet older pixels.
        """
        view = self._views.setdefault(key, _View())
        found = view.frames.pop(frame, None)
        if found and view.recipe == recipe and found.content_hash == content_hash:
            return found
        view.frames.clear()
        return None

    def store(self, key: ViewKey, recipe: Recipe, frames: Iterable[RenderedFrame]) -> None:
        """Keep finished frames for the engine objects to come."""
        view = self._views.setdefault(key, _View())
        view.recipe = recipe
        view.frames = {rendered.frame: rendered for rendered in frames}

    def first_time(self, warning: str) -> bool:
        """Tell whether a warning is new in this job."""
        if warning in self._warned:
            return False
        self._warned.add(warning)
        return True


SESSION = Session()


def plan_targets(
    frame: int, step: int, end: int, count: int, is_skipped: Callable[[int], bool]
) -> list[int]:
    """Choose the frames of an animation to render together, ascending and beginning with `frame`.

    They are at most `count` frames of the series frame, frame + step, ... up to `end`, without
    those that Blender will not ask for (`is_skipped`).
    """
    last = min(end, frame + (count - 1) * step)
    ahead = range(frame + step, last + 1, step)
    return [frame, *(later for later in ahead if not is_skipped(later))]


def frames_in_memory(pixels: int, memory_bytes: int, pass_bytes: int = 0) -> int:
    """Tell how many frames of that many pixels may be rendered together, at least one.

    `pass_bytes` are those of the wanted passes, for each pixel.
    """
    per_frame = max(1, pixels) * (BYTES_PER_PIXEL_AND_FRAME + pass_bytes)
    return max(1, int(memory_bytes * MEMORY_SHARE) // per_frame)


def scene_bytes(scenes: Iterable[Any]) -> int:
    """Tell how much the meshes of some exported frames take; what frames share counts once."""
    meshes = {id(mesh): mesh for scene in scenes for mesh in scene.meshes}
    return BYTES_PER_TRIANGLE * sum(mesh.triangle_count for mesh in meshes.values())


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = [
        ("length", ctypes.c_ulong),
        ("load", ctypes.c_ulong),
        ("total_bytes", ctypes.c_ulonglong),
        ("others", ctypes.c_ulonglong * 6),
    ]


def physical_memory_bytes() -> int:
    """Return the size of the machine's memory; 8 GiB where the system does not tell."""
    try:
        if sys.platform == "win32":
            status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
            ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
            return int(status.total_bytes)
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 8 << 30


class RunningRender(Protocol):
    """What can be asked of a render in the background."""

    def progress(self) -> dict[str, Any]:
        """Tell how far it is."""
        ...

    def preview(self, frame: int) -> np.ndarray | None:
        """Return the unfinished picture of a frame (H, W, 4), if there is one."""
        ...


@dataclass(frozen=True)
class Watch:
    """The user at the other end of a render."""

    is_stopped: Callable[[], bool]
    show: Callable[[RunningRender], object]


def frames_needed(core: ModuleType, order: Order) -> list[int]:
    """Return every frame whose scene is needed to render the targets, ascending."""
    with _core_errors():
        settings = dict(order.recipe.settings)
        return list(core.window_frames(settings, order.targets, order.recipe.step))


def read_window(
    core: ModuleType,
    order: Order,
    scenes: dict[int, Any],
    read: Callable[[int], Any],
    memory_bytes: int,
) -> tuple[Order, list[Any]]:
    """Read the scenes that an order needs, and give up its last targets where memory is short.

    Args:
        core: the compiled module.
        order: the targets; the first stays in any case.
        scenes: exported frames that are there, by number.
        read: exports the scene of a frame.
        memory_bytes: of the machine; `MEMORY_SHARE` of it is for the scenes.

    Returns:
        The order, and one exported frame for each of `frames_needed`.
    """
    scenes = dict(scenes)
    for frame in frames_needed(core, order):
        if frame not in scenes:
            scenes[frame] = read(frame)
        if scene_bytes(scenes.values()) > memory_bytes * MEMORY_SHARE:
            order = _without_unread(core, order, scenes)
            break
    needed = frames_needed(core, order)
    return order, [scenes[f] if f in scenes else read(f) for f in needed]


def _without_unread(core: ModuleType, order: Order, read: Collection[int]) -> Order:
    """Keep the first target, and those after it whose frames have all been read."""

    def is_read(target: int) -> bool:
        return set(frames_needed(core, replace(order, targets=[target]))) <= set(read)

    first, *later = order.targets
    return replace(order, targets=[first, *takewhile(is_read, later)])


def render(
    core: ModuleType, order: Order, scenes: Sequence[Any], watch: Watch
) -> dict[int, dict[str, Any]]:
    """Render the targets together and wait for them.

    Args:
        core: the compiled module.
        order: the targets and how to render them.
        scenes: one exported frame for each of `frames_needed`.
        watch: asked about Esc and shown the running render every `POLL_SECONDS`.

    Returns:
        For each target a dictionary with `passes` and `report`.

    Raises:
        Stopped: the user pressed Esc; the renderer is winding down.
        RenderError: the renderer refused its input or failed.
    """
    job = _start(core, order, scenes)
    try:
        while not job.wait(POLL_SECONDS):
            if watch.is_stopped():
                raise Stopped
            watch.show(job)
        if watch.is_stopped():
            raise Stopped
        with _core_errors():
            return {frame: job.result(frame) for frame in order.targets}
    finally:
        job.cancel()


def _start(core: ModuleType, order: Order, scenes: Sequence[Any]) -> Any:
    recipe = order.recipe
    region = recipe.region._asdict()
    with _core_errors():
        frames = [core.SceneFrame(s.frame, s.meshes, s.images, s.arrays) for s in scenes]
        return core.Render(
            frames,
            order.targets,
            recipe.step,
            region,
            dict(recipe.settings),
            order.threads,
            list(recipe.passes),
        )


@contextlib.contextmanager
def _core_errors() -> Iterator[None]:
    """Turn what the compiled module raises for bad input or a failed render into `RenderError`."""
    try:
        yield
    except (ValueError, RuntimeError) as error:
        raise RenderError(str(error)) from error


class Pace:
    """Says yes at most once in `seconds`."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._next = 0.0

    def due(self) -> bool:
        """Tell whether it is time again."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + self._seconds
        return True


PHASES = {
    "build": "Building the scene",
    "sample": "Sampling",
    "resolve": "Finishing",
    "done": "Done",
}


def status_line(frame: int, targets: Sequence[int], progress: dict[str, Any]) -> str:
    """Tell a waiting user the frame, the phase, the samples and the time left."""
    line = f"Frame {frame}"
    if len(targets) > 1:
        line += f" (rendering {targets[0]} to {targets[-1]} together)"
    parts: list[str] = [line, PHASES[progress["phase"]]]
    if progress["samples_total"]:
        parts.append(f"Sample {progress['samples_done']}/{progress['samples_total']}")
    if progress["seconds_left"] is not None:
        parts.append(f"{clock(progress['seconds_left'])} left")
    return " | ".join(parts)


def clock(seconds: float) -> str:
    """Write seconds as mm:ss, or h:mm:ss from an hour on."""
    minutes, rest = divmod(int(seconds + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"


def log_line(frame: int, method: str, report: dict[str, Any]) -> str:
    """Tell what a frame cost in one line: seconds by phase, rays and samples."""
    seconds = report["seconds"]
    phases = ", ".join(f"{name.replace('_', ' ')} {value:.2f}" for name, value in seconds.items())
    noise = report.get("noise")
    return (
        f"Frame {frame}: {sum(seconds.values()):.2f} s ({phases}), {method}, "
        f"{report['samples']} samples, {report['rays'] / 1e6:.2f} million rays"
    ) + (f", noise {noise:.4f}" if noise is not None else "")


def metadata(method: str, report: dict[str, Any]) -> dict[str, str]:
    """Write for the file's metadata what a frame cost."""
    fields = {"method": method, "samples": str(report["samples"]), "rays": str(report["rays"])}
    noise = report.get("noise")  # measured where a limit on noise or time asked for it
    if noise is not None:
        fields["noise"] = f"{noise:.5f}"
    return fields | {
        f"seconds_{phase}": f"{seconds:.4f}" for phase, seconds in report["seconds"].items()
    }
