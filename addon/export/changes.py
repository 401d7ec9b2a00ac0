"""Which geometry and owners of nodes Blender has evaluated anew since they were last exported."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

_watchers: weakref.WeakSet[Changes] = weakref.WeakSet()


class Changes:
    """Collects the changes of a depsgraph between two exports.

    `depsgraph.updates` holds those of the latest evaluation only, and Blender may evaluate several
    times in between, so they are gathered after each one, while an instance of this class lives.
    """

    def __init__(self) -> None:
        # `session_uid` of what changed, by address of the depsgraph.
        self._changed: dict[int, set[int]] = {}
        _watchers.add(self)
        _install()
        weakref.finalize(self, _remove_if_idle)

    def take(self, depsgraph: bpy.types.Depsgraph) -> set[int] | None:
        """Return the `session_uid` of what changed since the last call, and forget it.

        Of objects that is their geometry; of materials, lights and worlds anything that they read:
        groups of nodes, drivers and the animation of a value reach the one that uses them.

        None if this depsgraph was not watched until now: then everything may have changed.
        """
        self.collect(depsgraph)
        changed = self._changed.get(depsgraph.as_pointer())
        # A render has one depsgraph; those of earlier frames may be gone.
        self._changed = {depsgraph.as_pointer(): set()}
        return changed

    def so_far(self, depsgraph: bpy.types.Depsgraph) -> set[int]:
        """Return what the next `take` will, without forgetting it."""
        self.collect(depsgraph)
        return self._changed.get(depsgraph.as_pointer(), set())

    def collect(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Note what the latest evaluation changed."""
        changed = self._changed.get(depsgraph.as_pointer())
        if changed is not None:
            changed |= {u.id.original.session_uid for u in depsgraph.updates if _counts(u)}


def _counts(update: bpy.types.DepsgraphUpdate) -> bool:
    has_nodes = isinstance(update.id, (bpy.types.Material, bpy.types.Light, bpy.types.World))
    return update.is_updated_geometry or has_nodes


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
