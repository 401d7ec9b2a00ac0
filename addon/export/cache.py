"""What one exported frame leaves for the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy

from .changes import GeometryChanges

# Exports after which a mesh that no frame used is let go. A window looks ahead by its length, and
# a mesh comes back when the next chunk starts with the frames the last one ended with.
KEPT_EXPORTS = 32


@dataclass(frozen=True)
class CachedMesh:
    """A mesh the renderer holds."""

    handle: Any
    digest: bytes
    # Name of the layer in `corner_uvs`, empty without one.
    uv_map: str


@dataclass(frozen=True)
class CachedImage:
    """An image the renderer holds."""

    handle: Any
    digest: bytes
    mean: tuple[float, float, float, float]


@dataclass(frozen=True)
class EvaluatedMesh:
    """What was read from an evaluated mesh (None without faces), and whose mesh it is."""

    owner: int
    mesh: CachedMesh | None


@dataclass
class Statistics:
    """What the exports of a render job have cost."""

    frames: int = 0
    meshes_read: int = 0
    meshes_built: int = 0
    images_built: int = 0
    seconds: float = 0.0


@dataclass
class ExportCache:
    """Meshes and images of a render job, by content, so that nothing is handed over twice."""

    meshes: dict[bytes, CachedMesh] = field(default_factory=dict)
    images: dict[tuple, CachedImage] = field(default_factory=dict)
    statistics: Statistics = field(default_factory=Statistics)
    _last_use: dict[bytes, int] = field(default_factory=dict)
    _changes: GeometryChanges = field(default_factory=GeometryChanges)
    # By address of the evaluated mesh: those of the last export that still hold, and this one's.
    _unchanged: dict[int, EvaluatedMesh] = field(default_factory=dict)
    _evaluated: dict[int, EvaluatedMesh] = field(default_factory=dict)

    def begin_frame(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Forget what Blender evaluated anew since the last export."""
        changed = self._changes.take(depsgraph)
        kept = {} if changed is None else self._evaluated
        self._unchanged = {k: e for k, e in kept.items() if e.owner not in (changed or ())}
        self._evaluated = {}

    def evaluated(self, owner: bpy.types.Object) -> EvaluatedMesh | None:
        """Return what was read from an object's evaluated mesh, if it is still what it was.

        Within a frame objects with one evaluated mesh share the entry. The address alone says
        nothing across frames, where another mesh may have taken it.
        """
        address = owner.data.as_pointer()
        if address in self._evaluated:
            return self._evaluated[address]
        entry = self._unchanged.get(address)
        if entry is None or entry.owner != owner.original.session_uid:
            return None
        self.remember(owner, entry.mesh)
        return entry

    def remember(self, owner: bpy.types.Object, mesh: CachedMesh | None) -> None:
        """Keep what was read from an object's evaluated mesh."""
        entry = EvaluatedMesh(owner.original.session_uid, mesh)
        self._evaluated[owner.data.as_pointer()] = entry
        if mesh is not None:
            self._last_use[mesh.digest] = self.statistics.frames

    def end_frame(self, seconds: float) -> None:
        """Count a finished export and let go of meshes that have not been used for a while."""
        self.statistics.frames += 1
        self.statistics.seconds += seconds
        oldest = self.statistics.frames - KEPT_EXPORTS
        for digest in [d for d, used in self._last_use.items() if used < oldest]:
            del self._last_use[digest]
            self.meshes.pop(digest, None)
