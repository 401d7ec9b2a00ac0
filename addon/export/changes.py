"""Which objects' geometry Blender has evaluated anew since it was last exported."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

_watchers: weakref.WeakSet[GeometryChanges] = weakref.WeakSet()


class GeometryChanges:
    """Collects the changes of a depsgraph between two exports.

    `depsgraph.updates` holds those of the latest evaluation only, and Blender may evaluate several
    times in between, so they are gathered after each one, while an instance of this class lives.
    """

    def __init__(self) -> None:
        # `session_uid` of the changed objects, by address of the depsgraph.
        self._changed: dict[int, set[int]] = {}
        _watchers.add(self)
        _install()
        weakref.finalize(self, _remove_if_idle)

    def take(self, depsgraph: bpy.types.Depsgraph) -> set[int] | None:
        """Return the `session_uid` of each object changed since the last call, and forget them.

        None if this depsgraph was not watched until now: then everything may have changed.
        """
        self.collect(depsgraph)
        changed = self._changed.get(depsgraph.as_pointer())
        # A render has one depsgraph; those of earlier frames may be gone.
        self._changed = {depsgraph.as_pointer(): set()}
        return changed

    def collect(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Note what the latest evaluation changed."""
        changed = self._changed.get(depsgraph.as_pointer())
        if changed is not None:
            updates = (u.id.original for u in depsgraph.updates if u.is_updated_geometry)
            changed |= {original.session_uid for original in updates}


@persistent
def _collect(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    for watcher in tuple(_watchers):
        if depsgraph is not None:
            watcher.collect(depsgraph)


def _handler_lists() -> tuple[list[Callable], ...]:
    handlers = bpy.app.handlers
    return (handlers.frame_change_post, handlers.depsgraph_update_post)


def _install() -> None:
    for handlers in _handler_lists():
        if _collect not in handlers:
            handlers.append(_collect)


def _remove_if_idle() -> None:
    if any(True for _ in _watchers):
        return
    for handlers in _handler_lists():
        if _collect in handlers:
            handlers.remove(_collect)
