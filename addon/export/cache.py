"""What one exported frame leaves for the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy as np

from .changes import Changes
from .shader import Program

# Exports after which a mesh that no frame used is let go. A window looks ahead by its length, and
# a mesh comes back when the next chunk starts with the frames the last one ended with.
KEPT_EXPORTS = 32

# Bevel interpolates texture coordinates in another order each time it is evaluated, so their last
# bits are random. Meshes that differ by no more are one mesh: otherwise nothing would be shared
# between frames. A sixteenth of a texel of a texture of 65536 texels.
UV_NOISE = 2.0**-20


@dataclass(frozen=True, eq=False)
class CachedMesh:
    """A mesh the renderer holds."""

    handle: Any
    digest: bytes
    # The same for meshes that differ in texture coordinates only.
    form: bytes
    corner_uvs: np.ndarray
    # Layers that were asked for, by their names in `shader/layers.py`.
    layers: frozenset[str]


@dataclass(frozen=True)
class CachedImage:
    """An image the renderer holds."""

    handle: Any
    digest: bytes


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
    materials_compiled: int = 0
    images_built: int = 0
    seconds: float = 0.0


@dataclass
class ExportCache:
    """What a render job holds, so that nothing is read twice: meshes and images by content."""

    meshes: dict[bytes, CachedMesh] = field(default_factory=dict)
    images: dict[tuple, CachedImage] = field(default_factory=dict)
    statistics: Statistics = field(default_factory=Statistics)
    # Programs of materials that are what they were, by the material's `session_uid`.
    programs: dict[int, Program] = field(default_factory=dict)
    _last_use: dict[bytes, int] = field(default_factory=dict)
    _last_image_use: dict[tuple, int] = field(default_factory=dict)
    _by_form: dict[bytes, list[CachedMesh]] = field(default_factory=dict)
    _changes: Changes = field(default_factory=Changes)
    # By address of the evaluated mesh: those of the last export that still hold, and this one's.
    _unchanged: dict[int, EvaluatedMesh] = field(default_factory=dict)
    _evaluated: dict[int, EvaluatedMesh] = field(default_factory=dict)

    def begin_frame(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Forget what Blender evaluated anew since the last export."""
        changed = self._changes.take(depsgraph)
        if changed is None:
            self.programs.clear()
        for uid in changed or ():
            self.programs.pop(uid, None)
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

    def add(self, mesh: CachedMesh) -> None:
        """Keep a mesh that the renderer holds."""
        self.meshes[mesh.digest] = mesh
        self._by_form.setdefault(mesh.form, []).append(mesh)
        self.statistics.meshes_built += 1

    def same_but_noise(self, form: bytes, corner_uvs: np.ndarray) -> CachedMesh | None:
        """Return the mesh of that form whose texture coordinates differ by noise at most."""
        for mesh in self._by_form.get(form, ()):
            is_alike = mesh.corner_uvs.shape == corner_uvs.shape
            if is_alike and np.allclose(mesh.corner_uvs, corner_uvs, rtol=0.0, atol=UV_NOISE):
                return mesh
        return None

    def changed(self, depsgraph: bpy.types.Depsgraph) -> set[int]:
        """Return the `session_uid` of each object evaluated anew since `begin_frame`."""
        return self._changes.so_far(depsgraph)

    def moving(self, mesh: CachedMesh, digest: bytes, positions: np.ndarray) -> CachedMesh:
        """Return a mesh in motion, with positions (Y, V, 3); `digest` is of both."""
        cached = self.meshes.get(digest)
        if cached is None:
            handle = mesh.handle.moving(positions)
            cached = replace(mesh, handle=handle, digest=digest, form=digest)
            self.add(cached)
        self._last_use[digest] = self.statistics.frames
        return cached

    def keep_image(self, key: tuple) -> None:
        """Note that this frame shows an image."""
        self._last_image_use[key] = self.statistics.frames

    def keep_mesh(self, digest: bytes) -> None:
        """Note that this frame shows a mesh."""
        self._last_use[digest] = self.statistics.frames

    def _drop(self, digest: bytes) -> None:
        del self._last_use[digest]
        mesh = self.meshes.pop(digest, None)
        if mesh is not None:
            alike = self._by_form[mesh.form]
            alike.remove(mesh)
            if not alike:
                del self._by_form[mesh.form]

    def end_frame(self, seconds: float) -> None:
        """Count a finished export and let go of what has not been used for a while."""
        self.statistics.frames += 1
        self.statistics.seconds += seconds
        oldest = self.statistics.frames - KEPT_EXPORTS
        for digest in [d for d, used in self._last_use.items() if used < oldest]:
            self._drop(digest)
        for key in [k for k, used in self._last_image_use.items() if used < oldest]:
            del self._last_image_use[key], self.images[key]
