"""Use addon/ in a bpy wheel without installing it."""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

ROOT = str(Path(__file__).resolve().parent.parent)


def load() -> ModuleType:
    """Import addon/ as a package."""
    if ROOT not in sys.path:
        sys.path.insert(0, ROOT)
    return importlib.import_module("addon")


@contextmanager
def registered() -> Iterator[ModuleType]:
    """Register the add-on for the duration of the block.

    It must be gone before the interpreter ends: with an engine class still registered, Blender 4.2
    crashes at exit and 4.5 hangs.
    """
    package = load()
    package.register()
    try:
        yield package
    finally:
        package.unregister()
