"""The add-on, registered once for the process; a stage for each scene."""

from collections.abc import Iterator
from types import ModuleType

import bpy
import pytest
from stage import Build, Stage

import local_addon


@pytest.fixture(scope="session", autouse=True)
def addon() -> Iterator[ModuleType]:
    """Register the add-on for the whole run."""
    with local_addon.registered() as package:
        yield package


@pytest.fixture
def stage(request: pytest.FixtureRequest) -> Stage:
    """Build the scene that the test names as its parameter: (scene, frames to judge)."""
    build: Build
    frames: tuple[int, ...]
    build, frames = request.param
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    return Stage(frames)
