"""What cannot be rendered, and Esc: a message, no black frame, no crash, the scene put back."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import fake_core
import pytest
from addon import core, engine, ui
from addon.engine import DualConeEngine
from addon.session import SESSION
from shots import animate, moving_cube, still

Render = fake_core.Render
Stop = Callable[[DualConeEngine], bool]


@pytest.fixture(autouse=True)
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core, "load", lambda: fake_core)
    monkeypatch.setattr(Render, "started", [])


@pytest.fixture
def shot(scene: Any, tmp_path: Path) -> Any:
    return moving_cube(scene, tmp_path)


def refused(message: str, folder: Path) -> None:
    """Animate and expect an error with this text, no file, and nothing left in the session."""
    with pytest.raises(RuntimeError, match=message):
        animate()
    assert list(folder.iterdir()) == []
    assert SESSION._views == {}


class TestScene:
    def test_no_camera(self, shot: Any, tmp_path: Path) -> None:
        shot.camera = None
        refused("camera", tmp_path)

    def test_border_of_zero_area(self, shot: Any, tmp_path: Path) -> None:
        shot.render.use_border = True
        shot.render.border_min_x = shot.render.border_max_x = 0.5
        refused("Image too small|No border area", tmp_path)

    def test_resolution_of_zero_pixels(self, shot: Any, tmp_path: Path) -> None:
        shot.render.resolution_percentage = 1
        refused("Image too small", tmp_path)

    def test_no_samples_cannot_be_asked_for(self, shot: Any) -> None:
        shot.dualcone.samples = 0
        assert shot.dualcone.samples == 1

    def test_no_geometry_is_rendered_with_a_warning(
        self, shot: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        for name in ("Cube", "Plane"):
            bpy.data.objects.remove(bpy.data.objects[name])
        animate()
        assert len(list(tmp_path.iterdir())) == 5
        assert [r.getMessage() for r in caplog.records].count(engine.NOTHING_TO_SEE) == 1

    def test_folder_that_cannot_be_written(self, shot: Any) -> None:
        shot.render.filepath = "/proc/no/such/folder/"
        with pytest.raises(RuntimeError, match="cannot save"):
            animate()
        assert SESSION._views == {}


class TestRenderer:
    def test_its_refusal_is_told_in_its_own_words(
        self, shot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(Render, "failure", "vertices[17] is not finite")
        refused(r"^Error: vertices\[17\] is not finite\n$", tmp_path)

    def test_it_recovers_after_a_failure(
        self, shot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(Render, "failure", "broken")
        refused("broken", tmp_path)
        monkeypatch.setattr(Render, "failure", None)
        animate()
        assert len(list(tmp_path.iterdir())) == 5

    @pytest.mark.parametrize("where", ["export_frame", "read_order"])
    def test_a_mistake_of_ours_is_told_and_asks_for_a_report(
        self, shot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
    ) -> None:
        def fail(*_args: object) -> None:
            raise KeyError("oops")

        monkeypatch.setattr(engine, where, fail)
        refused("please report it.*KeyError: 'oops'", tmp_path)

    def test_no_memory(self, shot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(*_args: object) -> None:
            raise MemoryError

        monkeypatch.setattr(engine.session, "render", fail)
        refused("Not enough memory: lower Frames Together", tmp_path)


@pytest.fixture
def real_load(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()


class TestWheel:
    def test_of_another_version(
        self, shot: Any, tmp_path: Path, real_load: None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(core, "extension_version", lambda: "9.8.7")
        refused(r"has version .*, the extension has 9\.8\.7\. Restart Blender", tmp_path)

    def test_missing_still_registers_and_says_what_to_do(
        self,
        addon: Any,
        shot: Any,
        tmp_path: Path,
        real_load: None,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        addon.unregister()
        monkeypatch.setitem(sys.modules, core.MODULE, None)
        addon.register()
        try:
            shot.render.engine = "DUALCONE"
            refused("does not load .* Restart Blender", tmp_path)
            context: Any = SimpleNamespace(engine="DUALCONE")
            assert ui.DUALCONE_PT_problem.poll(context)
            assert not ui.DUALCONE_PT_sampling.poll(context)
        finally:
            addon.unregister()
            monkeypatch.undo()
            addon.register()


def stop_while_reading_this_frame(_engine: DualConeEngine) -> bool:
    return True


def stop_while_looking_ahead(_engine: DualConeEngine) -> bool:
    return bpy.context.scene.frame_current == 3


def stop_while_tracing(_engine: DualConeEngine) -> bool:
    return bool(Render.started)


class TestEsc:
    """Only the engine's side: without a real Esc, Blender goes on and writes a black frame.

    Esc as a user presses it is tested in the real Blender.
    """

    @pytest.mark.parametrize(
        ("stop", "renders"),
        [
            (stop_while_reading_this_frame, 0),
            (stop_while_looking_ahead, 0),
            (stop_while_tracing, 1),
        ],
    )
    def test_stops_at_once_and_leaves_nothing(
        self, shot: Any, monkeypatch: pytest.MonkeyPatch, stop: Stop, renders: int
    ) -> None:
        monkeypatch.setattr(Render, "seconds", 30.0)
        monkeypatch.setattr(DualConeEngine, "is_stopped", stop)
        written: list[int] = []
        monkeypatch.setattr(engine.passes.Canvas, "write", lambda *_args: written.append(1))
        started = time.monotonic()
        still(shot, 2)
        assert time.monotonic() < started + 1.0
        assert written == []
        assert len(Render.started) == renders
        assert all(job.is_cancelled for job in Render.started)
        assert shot.frame_current == 2
        assert SESSION._views == {}

    def test_inside_the_exporter(self, shot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        asked: list[int] = []

        def stop(_engine: DualConeEngine) -> bool:
            asked.append(1)
            return len(asked) > 1  # the first question is asked before the export

        monkeypatch.setattr(DualConeEngine, "is_stopped", stop)
        still(shot, 2)
        assert Render.started == []
        assert len(asked) == 2
