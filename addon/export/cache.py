"""What one exported frame leaves for the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

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

    def mesh(self, digest: bytes) -> CachedMesh | None:
        """The mesh with this content, if an earlier frame handed it over."""
        self._last_use[digest] = self.statistics.frames
        return self.meshes.get(digest)

    def end_frame(self, seconds: float) -> None:
        """Count a finished export and let go of meshes that have not been used for a while."""
        self.statistics.frames += 1
        self.statistics.seconds += seconds
        oldest = self.statistics.frames - KEPT_EXPORTS
        for digest in [d for d, used in self._last_use.items() if used < oldest]:
            del self._last_use[digest]
            self.meshes.pop(digest, None)
