"""The render engine that Blender sees: reads the scene in `update`, traces it in `render`.

Facts about Blender that shape this file (measured with 4.2, 5.0 and 5.2):
- `update` runs with the interface locked and may move the scene in time; `render` may not.
- An exception in either leaves a black frame and exit code 0, and so does `error_set` alone.
  `report({'ERROR'})` is what stops an animation before it writes the frame.
- `is_animation` is true for `-a`, Ctrl-F12 and also for `-f`; the frame range is never told.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy

from . import core, denoise, passes, properties, session
from .export import ExportCache, ExportedFrame, ExportError, ExportStopped, export_frame
from .session import SESSION, Order, Recipe, Region, RenderedFrame, ViewKey

log = logging.getLogger(__package__)

UNEXPECTED = "DualCone met an unexpected error, please report it with the lines in the console: "
NOTHING_TO_SEE = "No visible object has a surface: only the world is rendered"
NO_MEMORY = "Not enough memory: lower Frames Together, the resolution or the detail of the scene"


@dataclass
class Work:
    """What `update` hands to `render`: a finished frame, or the scenes to render it from."""

    core: ModuleType
    order: Order
    export_seconds: float
    finished: RenderedFrame | None
    scenes: list[ExportedFrame]
    # Cryptomatte's, of the frame itself.
    manifests: dict[str, dict[str, str]]


class DualConeEngine(bpy.types.RenderEngine):
    """DualCone in the list of render engines.

    There is no `view_draw`: Blender then shows Material Preview, drawn by EEVEE, in its place.
    """

    bl_idname = "DUALCONE"
    bl_label = "DualCone"
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # Blender 4.5 and later call this twice on one object.
        self._work: Work | None = None

    def update_render_passes(
        self, scene: bpy.types.Scene | None = None, renderlayer: bpy.types.ViewLayer | None = None
    ) -> None:
        """Tell Blender which passes a view layer will get."""
        if scene is None or renderlayer is None:
            return
        for p in passes.enabled_passes(renderlayer):
            self.register_pass(scene, renderlayer, p.name, len(p.channels), p.channels, p.kind)

    def update(
        self, data: bpy.types.BlendData | None = None, depsgraph: bpy.types.Depsgraph | None = None
    ) -> None:
        """Read the scene of this frame and of those that lend samples to it."""
        self._work = None
        if depsgraph is not None:
            with self._failures_told():
                self._work = self._prepare(depsgraph)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Trace, show progress and hand the pixels to Blender."""
        work, self._work = self._work, None
        if work is not None:  # Otherwise `update` was stopped, or failed and said why.
            with self._failures_told():
                self._deliver(work, depsgraph.view_layer)

    def is_stopped(self) -> bool:
        """Tell whether the user pressed Esc."""
        return self.test_break()

    @contextmanager
    def _failures_told(self) -> Iterator[None]:
        try:
            yield
        except (session.Stopped, ExportStopped):
            SESSION.clear()
        except (core.CoreError, ExportError, session.RenderError, denoise.DenoiseError) as error:
            self._fail(str(error))
        except MemoryError:
            self._fail(NO_MEMORY)
        except Exception as error:
            log.exception("Unexpected error")
            self._fail(f"{UNEXPECTED}{type(error).__name__}: {error}")

    @contextmanager
    def _scene_put_back(self, scene: bpy.types.Scene) -> Iterator[None]:
        """Leave the scene at the time at which it was, whatever happens.

        `frame_set` moves the user's scene too, and Blender would name the file after where it ends.
        """
        time = scene.frame_current, scene.frame_subframe
        try:
            yield
        finally:
            if time != (scene.frame_current, scene.frame_subframe):
                self.frame_set(*time)

    def _fail(self, message: str) -> None:
        SESSION.clear()
        self.report({"ERROR"}, message)

    def _warn(self, warning: str) -> None:
        if SESSION.first_time(warning):
            log.warning(warning)
            self.report({"WARNING"}, warning)

    def _prepare(self, depsgraph: bpy.types.Depsgraph) -> Work:
        started = time.perf_counter()
        renderer = core.load()
        order = read_order(self, depsgraph)
        method = depsgraph.scene.dualcone.method
        lost = passes.problems(depsgraph.view_layer, method)
        for warning in chain(unsupported(depsgraph.scene), lost):
            self._warn(warning)
        with self._scene_put_back(depsgraph.scene):
            reader = Reader(self, renderer, depsgraph, order)
            current = reader.read(order.frame)
            if not shows_things(current):
                self._warn(NOTHING_TO_SEE)
            # Reading an unchanged scene again is cheap, and proves that no edit came between.
            finished = SESSION.take(order.view, order.recipe, order.frame, current.content_hash)
            order, scenes = (order, []) if finished else reader.look_around(current)
        seconds = time.perf_counter() - started
        return Work(renderer, order, seconds, finished, scenes, current.manifests)

    def _deliver(self, work: Work, view_layer: bpy.types.ViewLayer) -> None:
        order = work.order
        shape = order.recipe.region.shape
        canvas = passes.Canvas(self, view_layer, shape, order.exposure)
        is_done = False
        try:
            frame = work.finished or self._trace(work, canvas)
            seconds = {"export": work.export_seconds, **frame.report["seconds"]}
            pixels = frame.passes
            if dict(order.recipe.settings)["denoise"]:
                started = time.perf_counter()
                clean = denoise.denoise(pixels["Combined"], pixels["Albedo"], pixels["Normal"])
                pixels = {**pixels, "Combined": clean}
                seconds["denoise"] = time.perf_counter() - started
            started = time.perf_counter()
            canvas.write(pixels)
            seconds["write"] = time.perf_counter() - started
            report = {**frame.report, "seconds": seconds}
            method = dict(order.recipe.settings)["method"]
            canvas.stamp(session.metadata(method, report))
            canvas.stamp_manifests(work.manifests)
            is_done = True
        finally:
            canvas.close(cancel=not is_done)
        self.update_progress(1.0)
        log.info(session.log_line(order.frame, method, report))

    def _trace(self, work: Work, canvas: passes.Canvas) -> RenderedFrame:
        order = work.order
        hashes = {scene.frame: scene.content_hash for scene in work.scenes}
        # The scenes go as soon as the renderer has them; the arrays exist once.
        scenes, work.scenes = work.scenes, []
        watch = session.Watch(self.is_stopped, Display(self, order, canvas).show)
        results = session.render(work.core, order, scenes, watch)
        current, *later = (
            RenderedFrame(frame, hashes[frame], result["passes"], result["report"])
            for frame, result in results.items()
        )
        SESSION.store(order.view, order.recipe, later)
        return current


class Reader:
    """Reads scenes from Blender for one order."""

    def __init__(
        self,
        engine: DualConeEngine,
        renderer: ModuleType,
        depsgraph: bpy.types.Depsgraph,
        order: Order,
    ) -> None:
        self._engine = engine
        self._renderer = renderer
        self._depsgraph = depsgraph
        self._order = order

    def read(self, frame: int) -> ExportedFrame:
        """Export the scene as it is evaluated now, which is at `frame`."""
        engine, order = self._engine, self._order
        if engine.is_stopped():
            raise session.Stopped
        region = order.recipe.region
        exported = export_frame(
            self._depsgraph,
            frame,
            (region.width, region.height),
            SESSION.export_cache(order.view, ExportCache),
            self._renderer,
            engine.is_stopped,
            engine.frame_set,
            passes.exported(order.recipe.passes, is_target=frame in order.targets),
        )
        for warning in exported.warnings:
            engine._warn(warning)
        return exported

    def look_around(self, current: ExportedFrame) -> tuple[Order, list[ExportedFrame]]:
        """Export every frame that the targets need; `current` is the one that Blender was at.

        Returns them with the order, which has fewer targets where memory is short.
        """
        memory = session.physical_memory_bytes()
        there = {self._order.frame: current}
        return session.read_window(self._renderer, self._order, there, self._move_and_read, memory)

    def _move_and_read(self, frame: int) -> ExportedFrame:
        engine, order = self._engine, self._order
        engine.update_stats("", f"Frame {order.frame} | Reading frame {frame}")
        engine.frame_set(frame, order.subframe)
        return self.read(frame)


class Display:
    """Progress bar, status line and the picture as it clears up."""

    def __init__(self, engine: DualConeEngine, order: Order, canvas: passes.Canvas) -> None:
        self._engine = engine
        self._order = order
        self._canvas = canvas
        self._memory_peak = 0.0
        self._words = session.Pace(session.LOG_SECONDS if bpy.app.background else 0.0)
        self._picture = session.Pace(session.PREVIEW_SECONDS)

    def show(self, job: session.RunningRender) -> None:
        """Tell the user how far a running render is."""
        progress = job.progress()
        self._engine.update_progress(progress["fraction"])
        if self._words.due():
            line = session.status_line(self._order.frame, self._order.targets, progress)
            self._engine.update_stats("", line)
        used = progress["memory_bytes"] / 2**20
        self._memory_peak = max(self._memory_peak, used)
        self._engine.update_memory_stats(memory_used=used, memory_peak=self._memory_peak)
        if not bpy.app.background and self._picture.due():
            picture = job.preview(self._order.frame)
            if picture is not None:
                self._canvas.preview(picture)


def read_order(engine: DualConeEngine, depsgraph: bpy.types.Depsgraph) -> Order:
    """Read from the scene and the engine what is to be rendered."""
    scene = depsgraph.scene
    region = read_region(engine, scene.render)
    settings = properties.settings_of(scene)
    # Without a denoiser, what is shared must not be what only a denoiser cleans.
    settings["denoise"] = settings["denoise"] and denoise.problem() is None
    if not engine.is_animation and not settings["still_window"]:
        settings["window"] = 1
    frame, step = scene.frame_current, scene.frame_step
    is_series = engine.is_animation and not is_single_frame_job()
    wanted = tuple(passes.wanted(depsgraph.view_layer, settings["denoise"]))
    count = chunk_size(scene, settings["frames_together"], region) if is_series else 1
    return Order(
        frame=frame,
        subframe=scene.frame_subframe,
        view=ViewKey(f"{scene.name_full} {scene.session_uid}", depsgraph.view_layer.name),
        recipe=Recipe(tuple(sorted(settings.items())), region, step, wanted),
        targets=session.plan_targets(
            frame, step, scene.frame_end, count, lambda ahead: is_kept(scene.render, ahead)
        ),
        threads=scene.render.threads,
        exposure=scene.cycles.film_exposure if hasattr(scene, "cycles") else 1.0,
    )


def shows_things(frame: ExportedFrame) -> bool:
    """Tell whether there is more to see than a world: a surface, or a fog that lamps may light."""
    return len(frame.arrays["instance_mesh"]) > 0 or int(frame.arrays["world_material"]) >= 0


def read_region(engine: DualConeEngine, render: bpy.types.RenderSettings) -> Region:
    """Return the frame's size and the render border in pixels."""
    border = None
    if render.use_border:
        border = (
            render.border_min_x,
            render.border_min_y,
            render.border_max_x,
            render.border_max_y,
        )
    return Region.with_border(engine.resolution_x, engine.resolution_y, border)


def chunk_size(scene: bpy.types.Scene, wanted: int, region: Region) -> int:
    """Tell how many frames to render at once: as many as wanted and as fit into memory.

    With placeholders several machines share the range, and a frame ahead is another machine's.
    """
    if scene.render.use_placeholder and not scene.render.is_movie_format:
        return 1
    layers = [layer for layer in scene.view_layers if layer.use]
    rows, columns = region.shape
    pixels = rows * columns * max(1, len(layers))
    pass_bytes = max((passes.bytes_per_pixel(layer) for layer in layers), default=0)
    memory = session.physical_memory_bytes()
    return min(wanted, session.frames_in_memory(pixels, memory, pass_bytes))


def is_kept(render: bpy.types.RenderSettings, frame: int) -> bool:
    """Tell whether Blender will skip a frame because its file exists."""
    if render.use_overwrite or render.is_movie_format:
        return False
    return Path(render.frame_path(frame=frame)).exists()


def is_single_frame_job() -> bool:
    """Tell whether Blender was started to render frames one by one (`-f 7,9`) and no range (`-a`).

    Without a path of its own Blender is a Python module, and the arguments are another program's.
    """
    if not bpy.app.binary_path:
        return False
    arguments = sys.argv[: sys.argv.index("--")] if "--" in sys.argv else sys.argv
    is_single = not {"-f", "--render-frame"}.isdisjoint(arguments)
    return is_single and {"-a", "--render-anim"}.isdisjoint(arguments)


def unsupported(scene: bpy.types.Scene) -> Iterator[str]:
    """Name the render settings that DualCone does not follow."""
    if scene.render.use_multiview:
        yield "Stereoscopy is not rendered yet: every view shows the same picture"
    problem = denoise.problem() if scene.dualcone.denoise else None
    if problem is not None:
        yield f"The picture is not denoised: {problem}"


@bpy.app.handlers.persistent
def forget(*_args: Any) -> None:
    """Drop what a job left: it begins or ends, or another file was loaded."""
    SESSION.clear()


HANDLERS = ("render_init", "render_complete", "render_cancel", "load_post")


def register() -> None:
    """Add the engine to Blender's list."""
    bpy.utils.register_class(DualConeEngine)
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).append(forget)


def unregister() -> None:
    """Take the engine away. Blender 4.2 as a module crashes at exit when this is left out."""
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).remove(forget)
    SESSION.clear()
    bpy.utils.unregister_class(DualConeEngine)
