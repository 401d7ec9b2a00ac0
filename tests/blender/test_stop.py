"""Esc, which is Ctrl-C without a window: Blender stops soon, and writes no unfinished frame."""

import re
from pathlib import Path

import pytest
from conftest import ROOT, Blender

SAMPLE = ROOT / "blend_samples" / "loader.blend"

# Far more samples than there is time for. Blender itself turns SIGINT into what Esc does.
STOP = """
import os, signal, threading, time
import bpy
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = 320, 240
scene.render.resolution_percentage = 100
scene.dualcone.samples = 65535
pressed = []
def press():
    if not pressed:
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)
def when_looking_ahead(scene, *_):
    if scene.frame_current == 3:
        press()
def when_tracing(*_):
    threading.Timer(8.0, press).start()
def tell(*_):
    print("ANSWERED AFTER", time.monotonic() - pressed[0], "AT", bpy.context.scene.frame_current)
handlers = bpy.app.handlers
handlers.render_cancel.append(tell)
"""
PHASES = {
    "reading": "handlers.frame_change_post.append(when_looking_ahead)",
    "tracing": "handlers.render_pre.append(when_tracing)",
}


@pytest.mark.parametrize("phase", PHASES)
def test_ctrl_c_is_answered_and_no_frame_is_written(
    blender: Blender, shared_folder: Path, phase: str
) -> None:
    folder = shared_folder / f"stopped-{phase}"
    folder.mkdir()
    sample = shared_folder / "stop.blend"
    sample.write_bytes(SAMPLE.read_bytes())
    script = STOP + PHASES[phase]
    arguments = ("-E", "DUALCONE", "--python-expr", script, "-o", folder / "####")
    done = blender("-b", sample, *arguments, "-s", 1, "-e", 9, "-a", timeout=120)
    answer = re.search(r"ANSWERED AFTER ([\d.]+) AT (\d+)", done.stdout)
    assert answer, done.stdout
    # The renderer has 100 ms; a busy machine and Blender itself get the rest.
    assert float(answer[1]) < 1.0
    assert int(answer[2]) == 1
    assert list(folder.iterdir()) == []
    assert "Traceback" not in done.stdout, done.stdout
