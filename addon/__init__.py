"""DualCone: a render engine that shares gather samples between pixels and frames."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

import bpy

from . import core, denoise_node, engine, properties, ui

log = logging.getLogger(__package__)


class _Console(logging.StreamHandler):
    """Writes to whatever standard output is now, so that lines stay in order with Blender's own."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("DualCone: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        self.stream = sys.stdout
        super().emit(record)


_console = _Console()


def register() -> None:
    """Add engine, settings, panels and presets to Blender."""
    log.setLevel(logging.INFO)
    log.addHandler(_console)
    if problem := core.problem():
        log.error(problem)
    properties.register()
    engine.register()
    denoise_node.register()
    ui.register()
    bpy.utils.register_preset_path(str(Path(__file__).parent))


def unregister() -> None:
    """Take all of it away again."""
    bpy.utils.unregister_preset_path(str(Path(__file__).parent))
    ui.unregister()
    denoise_node.unregister()
    engine.unregister()
    properties.unregister()
    log.removeHandler(_console)
