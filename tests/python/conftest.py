"""The add-on in a bpy wheel: registered once for the process, factory settings for each test."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def load_addon() -> ModuleType:
    """Import addon/ as the package `dualcone_addon`, the way Blender imports an extension."""
    folder = ROOT / "addon"
    spec = importlib.util.spec_from_file_location(
        "dualcone_addon", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = package
    spec.loader.exec_module(package)
    return package


@pytest.fixture(scope="session", autouse=True)
def addon() -> Iterator[ModuleType]:
    """Register the add-on for the whole run.

    It must be gone before the interpreter ends: with an engine class still registered, Blender 4.2
    crashes at exit and 4.5 hangs.
    """
    package = load_addon()
    package.register()
    yield package
    package.unregister()


@pytest.fixture(autouse=True)
def empty_file(addon: ModuleType) -> None:
    """Start each test from factory settings and an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def scene(empty_file: None) -> Any:
    """Return the empty scene, set to render with DualCone: tiny, one thread, few samples."""
    scene: Any = bpy.context.scene
    scene.render.engine = "DUALCONE"
    scene.render.resolution_x = 32
    scene.render.resolution_y = 24
    scene.render.resolution_percentage = 100
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.dualcone.samples = 4
    return scene
