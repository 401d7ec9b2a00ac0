"""Use addon/ in a bpy wheel without installing it."""

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

ADDON = Path(__file__).resolve().parent.parent / "addon"


def load() -> ModuleType:
    """Import addon/ as the package `dualcone_addon`, the way Blender imports an extension."""
    spec = importlib.util.spec_from_file_location(
        "dualcone_addon", ADDON / "__init__.py", submodule_search_locations=[str(ADDON)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{ADDON} is not a package")
    package = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = package
    spec.loader.exec_module(package)
    return package


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
