"""The engine in Blender, with a stand-in for the compiled renderer.

What is asked when, which frames arrive in which files, and that nothing old is ever delivered.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import bpy
import fake_core
import numpy as np
import pytest
from addon import core, engine, session
from addon.engine import DualConeEngine
from addon.properties import place_of, settings_of
from addon.session import SESSION
from export_oracle import add_material, textured_diffuse
from shots import animate, moving_cube, read, still, write_single_layer

Render = fake_core.Render
EVENTS = ("render_init", "render_pre", "render_post", "render_write", "render_complete")


@pytest.fixture(autouse=True)
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core, "load", lambda: fake_core)
    monkeypatch.setattr(Render, "started", [])


@pytest.fixture
def shot(scene: Any, tmp_path: Path) -> Any:
    return moving_cube(scene, tmp_path)


def jobs() -> list[tuple[list[int], list[int]]]:
    """Return targets and scenes of each render started."""
    return [(job.targets, list(job.frames)) for job in Render.started]


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> dict[int, bytes]:
    """Collect the bits of all passes of every frame that is rendered."""
    seen: dict[int, bytes] = {}
    write = engine.passes.Canvas.write

    def spy(canvas: Any, pixels: Any) -> None:
        frame = bpy.context.scene.frame_current
        seen[frame] = b"".join(pixels[name].tobytes() for name in sorted(pixels))
        write(canvas, pixels)

    monkeypatch.setattr(engine.passes.Canvas, "write", spy)
    return seen


class TestFrames:
    def test_are_rendered_together_and_land_in_their_own_files(
        self, shot: Any, tmp_path: Path
    ) -> None:
        animate()
        assert jobs() == [([1, 2, 3], [0, 1, 2, 3, 4]), ([4, 5], [3, 4, 5, 6])]
        names = [f"{frame:04}.exr" for frame in range(1, 6)]
        assert sorted(path.name for path in tmp_path.iterdir()) == names

    @pytest.mark.parametrize("together", [1, 2, 64])
    def test_do_not_depend_on_how_they_are_grouped(
        self, shot: Any, tmp_path: Path, together: int, seen: dict[int, bytes]
    ) -> None:
        animate()
        grouped = dict(seen)
        shot.dualcone.frames_together = together
        seen.clear()
        animate()
        assert grouped.keys() == seen.keys() == {1, 2, 3, 4, 5}
        assert all(grouped[frame] == seen[frame] for frame in seen)
        assert len(set(seen.values())) == 5

    def test_a_still_equals_the_frame_of_the_animation(
        self, shot: Any, seen: dict[int, bytes]
    ) -> None:
        animate()
        animation = dict(seen)
        still(shot, 4)
        assert seen[4] == animation[4]
        assert jobs()[-1] == ([4], [3, 4, 5])

    def test_a_still_stays_alone_when_told_so(self, shot: Any) -> None:
        shot.dualcone.still_window = False
        still(shot, 4)
        assert jobs() == [([4], [4])]
        animate()
        assert jobs()[1] == ([1, 2, 3], [0, 1, 2, 3, 4])

    def test_step_is_the_spacing_of_shared_frames(self, shot: Any, tmp_path: Path) -> None:
        shot.frame_step = 2
        animate()
        assert jobs() == [([1, 3, 5], [-1, 1, 3, 5, 7])]
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            "0001.exr",
            "0003.exr",
            "0005.exr",
        ]

    def test_existing_files_are_no_targets(self, shot: Any, tmp_path: Path) -> None:
        (tmp_path / "0002.exr").touch()
        shot.render.use_overwrite = False
        animate()
        assert [targets for targets, _ in jobs()] == [[1, 3], [4, 5]]
        assert (tmp_path / "0002.exr").stat().st_size == 0

    def test_placeholders_mean_one_frame_at_a_time(self, shot: Any) -> None:
        shot.render.use_placeholder = True
        shot.render.use_overwrite = False
        animate()
        assert [targets for targets, _ in jobs()] == [[1], [2], [3], [4], [5]]

    def test_memory_bounds_the_group(self, shot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        two_frames = 2 * 8 * 6 * session.BYTES_PER_PIXEL_AND_FRAME / session.MEMORY_SHARE
        monkeypatch.setattr(session, "physical_memory_bytes", lambda: int(two_frames))
        animate()
        assert [targets for targets, _ in jobs()] == [[1, 2], [3, 4], [5]]

    def test_a_window_larger_than_the_animation_is_fine(self, shot: Any) -> None:
        shot.frame_end = 2
        shot.dualcone.window = 15
        animate()
        assert jobs() == [([1, 2], list(range(-6, 10)))]

    def test_each_view_layer_has_frames_of_its_own(self, shot: Any) -> None:
        shot.view_layers.new("Second")
        animate()
        targets = [targets for targets, _ in jobs()]
        assert targets == [[1, 2, 3], [1, 2, 3], [4, 5], [4, 5]]

    def test_persistent_data_changes_nothing(self, shot: Any) -> None:
        shot.render.use_persistent_data = True
        animate()
        assert [targets for targets, _ in jobs()] == [[1, 2, 3], [4, 5]]


class TestTheScene:
    @pytest.mark.parametrize("is_blurred", [False, True])
    def test_is_left_where_it_was(self, shot: Any, is_blurred: bool) -> None:
        shot.render.use_motion_blur = is_blurred
        shot.render.motion_blur_position = "START"
        shot.frame_set(2, subframe=0.25)
        bpy.ops.render.render()
        assert (shot.frame_current, shot.frame_subframe) == (2, 0.25)
        animate()
        assert shot.frame_current == 2

    def test_is_put_back_when_looking_ahead_fails(
        self, shot: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        export = engine.export_frame

        def fail_at_5(depsgraph: Any, frame: int, *rest: Any) -> Any:
            if frame == 5:
                raise engine.ExportError("frame 5 is broken")
            return export(depsgraph, frame, *rest)

        monkeypatch.setattr(engine, "export_frame", fail_at_5)
        shot.frame_set(4)
        with pytest.raises(RuntimeError, match="frame 5 is broken"):
            bpy.ops.render.render()
        assert shot.frame_current == 4

    def test_handlers_are_untouched_and_called_as_by_any_engine(self, shot: Any) -> None:
        calls: list[str] = []
        handlers = bpy.app.handlers
        mine = {name: (lambda *_args, name=name: calls.append(name)) for name in EVENTS}
        for name, call in mine.items():
            getattr(handlers, name).append(call)
        before = {name: list(getattr(handlers, name)) for name in EVENTS}
        try:
            animate()
            after = {name: list(getattr(handlers, name)) for name in EVENTS}
        finally:
            for name, call in mine.items():
                getattr(handlers, name).remove(call)
        assert after == before
        per_frame = ["render_pre", "render_post", "render_write"]
        assert calls == ["render_init", *(per_frame * 5), "render_complete"]


class TestNothingIsStale:
    def test_the_job_leaves_nothing_behind(self, shot: Any) -> None:
        animate()
        assert SESSION._views == {}

    def test_an_edit_between_jobs_is_seen(self, shot: Any, seen: dict[int, bytes]) -> None:
        still(shot, 2)
        before = seen[2]
        bpy.data.objects["Plane"].location.z = -1.0
        still(shot, 2)
        assert seen[2] != before
        bpy.data.objects["Plane"].location.z = 0.0
        still(shot, 2)
        assert seen[2] == before

    def test_an_edit_during_the_animation_drops_the_cache(
        self, shot: Any, seen: dict[int, bytes]
    ) -> None:
        """A script edits the scene after frame 1; frames 2 and 3 are in the cache by then."""

        def edit(scene: Any, *_args: Any) -> None:
            if scene.frame_current == 1:
                bpy.data.objects["Plane"].location.z = -1.0

        bpy.app.handlers.render_post.append(edit)
        try:
            animate()
        finally:
            bpy.app.handlers.render_post.remove(edit)
        assert [targets for targets, _ in jobs()] == [[1, 2, 3], [2, 3, 4], [5]]
        edited = dict(seen)
        animate()
        assert [edited[f] == seen[f] for f in range(1, 6)] == [False, True, True, True, True]

    @pytest.mark.parametrize(
        ("change", "targets"),
        [(1e-7, [[1, 2, 3], [4, 5]]), (1e-3, [[1, 2, 3], [2, 3, 4], [5]])],
        ids=["noise", "edit"],
    )
    def test_noise_in_texture_coordinates_is_no_edit(
        self, shot: Any, change: float, targets: list[list[int]]
    ) -> None:
        """Blender's Bevel gives their last bits anew each time it is evaluated."""
        plane: Any = bpy.data.objects["Plane"]
        plane.data.materials.append(add_material("Textured", textured_diffuse))

        def edit(scene: Any, *_args: Any) -> None:
            if scene.frame_current == 1:
                mesh: Any = bpy.data.objects["Plane"].data
                mesh.uv_layers[0].uv[0].vector.x += change
                mesh.update()

        bpy.app.handlers.render_post.append(edit)
        try:
            animate()
        finally:
            bpy.app.handlers.render_post.remove(edit)
        mesh: Any = bpy.data.objects["Plane"].data
        assert mesh.uv_layers[0].uv[0].vector.x == pytest.approx(change)
        assert [rendered for rendered, _ in jobs()] == targets

    def test_loading_a_file_empties_the_session(self, shot: Any) -> None:
        SESSION.first_time("a warning")
        bpy.ops.wm.read_factory_settings(use_empty=True)
        assert SESSION.first_time("a warning")

    def test_settings_changed_during_the_animation_are_followed(self, shot: Any) -> None:
        def edit(scene: Any, *_args: Any) -> None:
            scene.dualcone.seed = 7

        bpy.app.handlers.render_post.append(edit)
        try:
            animate()
        finally:
            bpy.app.handlers.render_post.remove(edit)
        assert [(job.targets, job.settings["seed"]) for job in Render.started] == [
            ([1, 2, 3], 0),
            ([2, 3, 4], 7),
            ([5], 7),
        ]


class TestPixels:
    @pytest.mark.parametrize("crop", [False, True])
    def test_border_and_percentage(self, shot: Any, crop: bool) -> None:
        render = shot.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = 101, 57, 70
        render.use_border, render.use_crop_to_border = True, crop
        render.border_min_x, render.border_max_x = 0.13, 0.61
        render.border_min_y, render.border_max_y = 0.3, 0.77
        still(shot, 1)
        assert Render.started[0].region == {
            "width": 70,
            "height": 39,
            "x_min": 9,
            "y_min": 11,
            "x_max": 42,
            "y_max": 30,
        }

    def test_any_border_is_as_large_as_blender_makes_it(self, shot: Any) -> None:
        """A mismatch is an error in Canvas.write; truncation in doubles differs by a pixel."""
        random = np.random.default_rng(2015)
        render = shot.render
        render.use_border = True
        for _border in range(20):
            render.resolution_x, render.resolution_y = (int(n) for n in random.integers(40, 400, 2))
            low, high = random.uniform(0.0, 0.4, 2).round(2), random.uniform(0.6, 1.0, 2).round(2)
            render.border_min_x, render.border_min_y = low
            render.border_max_x, render.border_max_y = high
            still(shot, 1)
        assert len(Render.started) == 20

    def test_film_transparent_and_threads_are_blenders(self, shot: Any) -> None:
        shot.render.film_transparent = True
        shot.render.threads_mode, shot.render.threads = "FIXED", 3
        still(shot, 1)
        assert Render.started[0].settings["film_transparent"] is True
        assert Render.started[0].threads == 3

    def test_passes_arrive_when_switched_on(
        self, shot: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        names: set[str] = set()
        write = engine.passes.Canvas.write

        def spy(canvas: Any, pixels: Any) -> None:
            names.update(p.name for p in canvas._opened().layers[0].passes)
            write(canvas, pixels)

        monkeypatch.setattr(engine.passes.Canvas, "write", spy)
        still(shot, 1)
        assert names == {"Combined"}
        layer = shot.view_layers[0]
        layer.use_pass_z = layer.use_pass_normal = True
        layer.dualcone.use_pass_albedo = layer.dualcone.use_pass_effective_samples = True
        still(shot, 1)
        assert names == {"Combined", "Depth", "Normal", "Albedo", "Effective Samples"}

    def test_combined_is_written_as_the_renderer_made_it(self, shot: Any, tmp_path: Path) -> None:
        write_single_layer(shot)
        shot.frame_end = 1
        animate()
        pixels = read(tmp_path / "0001.exr")
        np.testing.assert_array_equal(pixels - pixels[0], np.arange(8 * 6 * 4, dtype=np.float32))


class TestWords:
    def test_each_frame_leaves_one_line_in_the_log(
        self, shot: Any, caplog: pytest.LogCaptureFixture
    ) -> None:
        with caplog.at_level(logging.INFO):
            animate()
        lines = [r.getMessage() for r in caplog.records if r.levelno == logging.INFO]
        assert [line.split(":")[0] for line in lines] == [f"Frame {f}" for f in range(1, 6)]
        for phase in ("export", "build", "pass 1", "pass 2", "write"):
            assert f"{phase} " in lines[0]
        assert "DUAL_CONE, 4 samples, 0.00 million rays" in lines[0]

    def test_metadata_tells_what_the_frame_cost(self, shot: Any, tmp_path: Path) -> None:
        shot.render.use_stamp_render_time = True
        animate()
        header = (tmp_path / "0003.exr").read_bytes()[:4000]
        for name in ("method", "samples", "rays", "seconds_export", "seconds_pass_1"):
            assert f"dualcone.ViewLayer.{name}".encode() in header

    def test_a_warning_is_told_once_a_job(
        self, shot: Any, caplog: pytest.LogCaptureFixture
    ) -> None:
        shot.render.use_multiview = True
        for _job in range(2):
            caplog.clear()
            animate()
            warnings = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
            told = "Stereoscopy is not rendered yet: every view shows the same picture"
            assert warnings.count(told) == 1


def test_registering_twice_and_back_leaves_blender_as_it_was(addon: Any) -> None:
    def state() -> tuple[Any, ...]:
        panels = {
            panel.__name__
            for panel in bpy.types.Panel.__subclasses__()
            if engine.DualConeEngine.bl_idname in getattr(panel, "COMPAT_ENGINES", ())
            and not panel.__name__.startswith("DUALCONE")
        }
        handlers = [getattr(bpy.app.handlers, n).count(engine.forget) for n in engine.HANDLERS]
        return panels, handlers, hasattr(bpy.types.Scene, "dualcone")

    registered = state()
    addon.unregister()
    try:
        assert state() == (set(), [0, 0, 0, 0], False)
    finally:
        addon.register()
    assert state() == registered
    assert registered[1:] == ([1, 1, 1, 1], True)


def test_panels_for_what_is_rendered_are_shown(addon: Any) -> None:
    shown = {
        panel.__name__
        for panel in bpy.types.Panel.__subclasses__()
        if DualConeEngine.bl_idname in getattr(panel, "COMPAT_ENGINES", ())
    }
    assert shown >= {
        "EEVEE_MATERIAL_PT_context_material",
        "EEVEE_MATERIAL_PT_surface",
        "EEVEE_WORLD_PT_surface",
        "WORLD_PT_context_world",
        "DATA_PT_EEVEE_light",
        "DATA_PT_lens",
        "DATA_PT_spot",
        "RENDER_PT_format",
        "RENDER_PT_output",
        "RENDER_PT_color_management",
        "VIEWLAYER_PT_layer",
    }
    unwelcome = {"DATA_PT_camera_dof", "RENDER_PT_freestyle", "DATA_PT_light"}
    assert shown.isdisjoint(unwelcome)
    assert not any(name.startswith(("CYCLES", "RENDER_PT_eevee")) for name in shown)


@pytest.mark.parametrize(("preset", "samples"), [("Preview", 8), ("Animation", 32), ("Final", 256)])
def test_presets_are_found_and_set_the_samples(scene: Any, preset: str, samples: int) -> None:
    path = bpy.utils.preset_find(preset, "dualcone", ext=".py")
    assert path is not None
    bpy.ops.script.execute_preset(filepath=path, menu_idname="DUALCONE_PT_sampling_presets")
    assert scene.dualcone.samples == samples


def test_light_bounces_and_is_filtered_as_in_cycles_until_it_is_said_otherwise(scene: Any) -> None:
    scene.cycles.max_bounces, scene.cycles.pixel_filter_type = 3, "GAUSSIAN"
    scene.cycles.caustics_refractive = False
    scene.cycles.sample_clamp_indirect, scene.cycles.blur_glossy = 4.0, 0.5
    settings = settings_of(scene)
    limits = ("clamp_direct", "clamp_indirect", "blur_glossy")
    assert [settings[name] for name in limits] == [0.0, 4.0, 0.5]
    assert (settings["max_bounces"], settings["filter"]) == (3, "GAUSSIAN")
    assert (settings["caustics_refractive"], settings["caustics_reflective"]) == (False, True)
    assert place_of(scene, "max_bounces") == (scene.cycles, "max_bounces")
    scene.dualcone.max_bounces = 12  # the default, but chosen
    assert settings_of(scene)["max_bounces"] == 12
    assert place_of(scene, "max_bounces") == (scene.dualcone, "max_bounces")
    assert settings_of(scene)["filter"] == "GAUSSIAN"
