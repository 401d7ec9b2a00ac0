"""The compiled renderer: found, and checked to be the one this extension was built with.

Extensions share one folder of Python modules and an imported module stays in memory until Blender
quits, so after an update the module found may be an older one.
"""

from __future__ import annotations

import functools
import importlib
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

MODULE = "dualcone"
REINSTALL = (
    "Restart Blender; if that does not help, remove the DualCone extension and install it again."
)


class CoreError(Exception):
    """The compiled renderer cannot be used; the message tells the user what to do."""


@functools.cache
def extension_version() -> str:
    """Return the version that the extension's manifest states."""
    manifest = Path(__file__).with_name("blender_manifest.toml")
    return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]


def load() -> ModuleType:
    """Return the compiled module.

    Raises:
        CoreError: it is missing, does not load on this machine or has another version.
    """
    try:
        module = importlib.import_module(MODULE)
        found = str(module.__version__)
    except Exception as problem:  # A wheel for another machine fails in more ways than ImportError.
        message = f"The compiled part of DualCone does not load ({problem}). {REINSTALL}"
        raise CoreError(message) from problem
    wanted = extension_version()
    if found != wanted:
        raise CoreError(
            f"The compiled part of DualCone has version {found}, the extension has {wanted}. "
            + REINSTALL
        )
    return module


def problem() -> str | None:
    """Tell why the compiled module cannot be used, or None when it can."""
    try:
        load()
    except CoreError as error:
        return str(error)
    return None


def contract() -> dict[str, Any]:
    """Return the renderer's tables of settings and passes; without the module they are empty."""
    try:
        return _contract_of(load())
    except CoreError:
        return {"settings": [], "passes": []}


@functools.cache
def _contract_of(module: ModuleType) -> dict[str, Any]:
    return module.contract()
