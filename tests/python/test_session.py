"""The session without Blender: what is rendered together, kept, dropped, and how it stops."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import fake_core
import numpy as np
import pytest
from addon import session
from addon.session import (
    Order,
    Recipe,
    Region,
    RenderedFrame,
    RunningRender,
    Session,
    ViewKey,
    Watch,
)

VIEW = ViewKey("Scene", "ViewLayer")
RECIPE = Recipe((("samples", 4), ("window", 3)), Region(8, 6, 0, 0, 8, 6), 1)


@pytest.fixture(autouse=True)
def fresh_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fake_core.Render, "started", [])


def rendered(frame: int, content_hash: str = "scene") -> RenderedFrame:
    return RenderedFrame(frame, content_hash, {"Combined": np.zeros((6, 8, 4), np.float32)}, {})


def order(*targets: int) -> Order:
    return Order(targets[0], 0.0, VIEW, RECIPE, list(targets), 1)


def run(
    is_stopped: Callable[[], bool] = lambda: False,
    show: Callable[[RunningRender], object] = lambda job: None,
) -> dict[int, dict[str, Any]]:
    frames = session.frames_needed(fake_core, order(1, 2))
    scenes = [fake_core.SceneFrame(frame, [], [], {}) for frame in frames]
    return session.render(fake_core, order(1, 2), scenes, Watch(is_stopped, show))


class TestPlan:
    @pytest.mark.parametrize(
        ("frame", "step", "end", "count", "expected"),
        [
            (1, 1, 10, 4, [1, 2, 3, 4]),
            (9, 1, 10, 4, [9, 10]),
            (10, 1, 10, 4, [10]),
            (1, 3, 12, 4, [1, 4, 7, 10]),
            (1, 3, 9, 4, [1, 4, 7]),
            (5, 1, 4, 4, [5]),  # Blender may be told to render beyond the scene's end.
            (-2, 2, 3, 9, [-2, 0, 2]),
            (1, 1, 10, 1, [1]),
        ],
    )
    def test_is_the_series_up_to_the_end(
        self, frame: int, step: int, end: int, count: int, expected: list[int]
    ) -> None:
        assert session.plan_targets(frame, step, end, count, lambda f: False) == expected

    def test_leaves_out_frames_that_exist_but_never_the_one_asked_for(self) -> None:
        assert session.plan_targets(1, 1, 9, 5, lambda f: f in (1, 3)) == [1, 2, 4, 5]

    def test_memory_bounds_the_number_of_frames(self) -> None:
        assert session.frames_in_memory(1_000_000, 4 << 30) == int((4 << 30) * 0.25) // 120_000_000
        assert session.frames_in_memory(10**9, 1 << 30) == 1
        assert session.physical_memory_bytes() > 1 << 28

    @pytest.mark.parametrize(
        ("changed", "memory_bytes", "targets", "frames"),
        [
            (True, 1 << 30, [1, 2, 3, 4, 5], range(7)),
            (True, 4 * 2000 * 4, [1, 2, 3], range(5)),  # The fifth mesh is too much.
            (True, 1, [1], range(3)),  # Never less than the frame that is asked for.
            (False, 4 * 2000, [1, 2, 3, 4, 5], range(7)),  # A mesh that stays counts once.
        ],
    )
    def test_scenes_that_change_much_are_rendered_a_few_at_a_time(
        self, changed: bool, memory_bytes: int, targets: list[int], frames: range
    ) -> None:
        still = fake_core.Mesh(triangles=np.zeros((10, 3), np.int32))
        reads: list[int] = []

        def read(frame: int) -> fake_core.SceneFrame:
            reads.append(frame)
            mesh = fake_core.Mesh(triangles=np.zeros((10, 3), np.int32)) if changed else still
            return fake_core.SceneFrame(frame, [mesh], [], {})

        planned, scenes = session.read_window(
            fake_core, order(1, 2, 3, 4, 5), {1: read(1)}, read, memory_bytes
        )
        assert planned.targets == targets
        assert [scene.frame for scene in scenes] == list(frames)
        assert len(reads) == len(set(reads))


class TestRegion:
    def test_without_border_is_the_frame(self) -> None:
        assert Region.with_border(70, 39, None) == (70, 39, 0, 0, 70, 39)

    def test_border_is_truncated_in_single_precision_as_in_blender(self) -> None:
        # 0.29 * 100 is 29 in single precision and 28.999999999999996 in double.
        assert Region.with_border(100, 100, (0.29, 0.0, 1.0, 1.0)).x_min == 29
        assert Region.with_border(70, 39, (0.13, 0.3, 0.61, 0.77)).shape == (19, 33)


class TestStore:
    def test_hands_each_frame_over_once(self) -> None:
        store = Session()
        store.store(VIEW, RECIPE, [rendered(2), rendered(3)])
        assert store.take(VIEW, RECIPE, 2, "scene") is not None
        assert store.take(VIEW, RECIPE, 2, "scene") is None

    def test_an_edit_drops_everything(self) -> None:
        store = Session()
        store.store(VIEW, RECIPE, [rendered(2), rendered(3)])
        assert store.take(VIEW, RECIPE, 2, "edited") is None
        assert store.take(VIEW, RECIPE, 3, "scene") is None

    @pytest.mark.parametrize(
        "recipe",
        [
            Recipe((("samples", 5), ("window", 3)), RECIPE.region, 1),
            Recipe(RECIPE.settings, Region(8, 6, 0, 0, 4, 6), 1),
            Recipe(RECIPE.settings, RECIPE.region, 2),
        ],
        ids=["settings", "region", "step"],
    )
    def test_another_recipe_drops_everything(self, recipe: Recipe) -> None:
        store = Session()
        store.store(VIEW, RECIPE, [rendered(2), rendered(3)])
        assert store.take(VIEW, recipe, 2, "scene") is None
        assert store.take(VIEW, RECIPE, 3, "scene") is None

    def test_views_are_apart(self) -> None:
        store = Session()
        store.store(VIEW, RECIPE, [rendered(2)])
        assert store.take(ViewKey("Scene", "Other"), RECIPE, 2, "scene") is None
        assert store.take(VIEW, RECIPE, 2, "scene") is not None

    def test_clear_forgets_frames_caches_and_warnings(self) -> None:
        store = Session()
        store.store(VIEW, RECIPE, [rendered(2)])
        cache = store.export_cache(VIEW, object)
        assert store.export_cache(VIEW, object) is cache
        assert store.first_time("careful")
        assert not store.first_time("careful")
        store.clear()
        assert store.take(VIEW, RECIPE, 2, "scene") is None
        assert store.export_cache(VIEW, object) is not cache
        assert store.first_time("careful")


class TestRender:
    def test_gives_each_target_its_pixels(self) -> None:
        results = run()
        assert list(results) == [1, 2]
        assert all(r["passes"]["Combined"].shape == (6, 8, 4) for r in results.values())
        assert list(fake_core.Render.started[0].frames) == [0, 1, 2, 3]

    def test_shows_progress_while_it_runs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(fake_core.Render, "seconds", 0.3)
        shown = []
        run(show=lambda job: shown.append(job.progress()["fraction"]))
        assert len(shown) >= 3

    def test_stops_within_a_tenth_of_a_second(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(fake_core.Render, "seconds", 30.0)
        started = time.monotonic()
        with pytest.raises(session.Stopped):
            run(is_stopped=lambda: time.monotonic() > started + 0.1)
        assert time.monotonic() < started + 0.2
        assert fake_core.Render.started[0].is_cancelled

    def test_a_stop_at_the_last_moment_delivers_nothing(self) -> None:
        with pytest.raises(session.Stopped):
            run(is_stopped=lambda: True)

    def test_failure_is_told_in_the_renderers_words(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(fake_core.Render, "failure", "vertices[17] is not finite")
        with pytest.raises(session.RenderError, match=r"vertices\[17\] is not finite"):
            run()

    def test_refused_input_is_told_in_the_renderers_words(self) -> None:
        with pytest.raises(session.RenderError, match="frames: there are none"):
            session.render(fake_core, order(1), [], Watch(lambda: False, lambda job: None))

    def test_a_failing_display_does_not_leave_the_renderer_running(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(fake_core.Render, "seconds", 30.0)
        with pytest.raises(ZeroDivisionError):
            run(show=lambda job: 1 / 0)
        assert fake_core.Render.started[0].is_cancelled


class TestWords:
    def test_status_line(self) -> None:
        scene = fake_core.SceneFrame(1, [], [], {})
        progress = fake_core.Render([scene], [1], 1, {}, {"samples": 16}, 1).progress()
        assert (
            session.status_line(1, [1], progress) == "Frame 1 | Sampling | Sample 1/16 | 01:01 left"
        )
        together = session.status_line(1, [1, 2, 3], progress | {"seconds_left": None})
        assert together == "Frame 1 (rendering 1 to 3 together) | Sampling | Sample 1/16"

    def test_clock(self) -> None:
        assert [session.clock(s) for s in (0.0, 59.6, 3600.0, 36061.0)] == [
            "00:00",
            "01:00",
            "1:00:00",
            "10:01:01",
        ]

    def test_log_line(self) -> None:
        report = {"seconds": {"export": 0.5, "pass_1": 1.25}, "samples": 64, "rays": 2_500_000}
        expected = "Frame 7: 1.75 s (export 0.50, pass 1 1.25), PATH, 64 samples, 2.50 million rays"
        assert session.log_line(7, "PATH", report) == expected
        assert "noise" not in session.metadata("PATH", report)
        report["noise"] = 0.0123
        assert session.log_line(7, "PATH", report) == expected + ", noise 0.0123"
        assert session.metadata("PATH", report)["noise"] == "0.01230"

    def test_pace(self) -> None:
        pace = session.Pace(0.1)
        assert pace.due()
        assert not pace.due()
        time.sleep(0.11)
        assert pace.due()
