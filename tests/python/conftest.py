"""The add-on in a bpy wheel: registered once for the process, factory settings for each test."""

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import bpy
import pytest

import local_addon


@pytest.fixture(scope="session", autouse=True)
def addon() -> Iterator[ModuleType]:
    """Register the add-on for the whole run."""
    with local_addon.registered() as package:
        yield package


@pytest.fixture(autouse=True)
def empty_file(addon: ModuleType) -> None:
    """Start each test from factory settings and an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def scene(empty_file: None) -> Any:
    """Return the empty scene, set to render with DualCone: tiny, one thread, few samples."""
    scene: Any = bpy.context.scene  # Any: the stubs of bpy do not know scene.dualcone
    scene.render.engine = "DUALCONE"
    scene.render.resolution_x = 32
    scene.render.resolution_y = 24
    scene.render.resolution_percentage = 100
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.dualcone.samples = 4
    return scene
