"""Volume objects, and simulations of smoke and fire, as grids of voxels within boxes."""

from __future__ import annotations

import hashlib
import importlib
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .cache import CachedMesh, ExportCache
from .mesh import load_surface
from .report import Warnings
from .shader.layers import layer_key
from .strands import Surface

# Numbers of one grid above which it is left out: a gigabyte.
NUMBERS_MAX = 2**28
# What motion blur leaves out.
UNBLURRED = "its voxels are not blurred by their velocity"
# Blender's modules for OpenVDB: until 4.3, and after.
MODULES = ("openvdb", "pyopenvdb")


@dataclass(frozen=True)
class Voxels:
    """Values at the points of a grid."""

    name: str
    values: np.ndarray  # (X, Y, Z, N)
    index_from_object: np.ndarray  # (3, 4)

    def corners(self) -> np.ndarray:
        """Where the last values have faded to zero (8, 3) m, object: a step beyond the points."""
        ends = np.array([(-1.0, size) for size in self.values.shape[:3]])
        index = np.array([[x, y, z] for x in ends[0] for y in ends[1] for z in ends[2]])
        linear, offset = self.index_from_object[:, :3], self.index_from_object[:, 3]
        return np.linalg.solve(linear.astype(np.float64), (index - offset).T).T


def grid_names(layers: Iterable[frozenset[str]]) -> frozenset[str]:
    """The grids that materials read, by the names in `shader/layers.py`."""
    found = frozenset().union(*layers)
    return frozenset(name for name in found if name.startswith("attribute:"))


def mesh_texture_space(mesh: Any) -> np.ndarray:
    """Lower corner and size (2, 3) m, object: of what Generated coordinates count from 0 to 1."""
    half = np.array(mesh.texspace_size, np.float32)
    return np.array([np.array(mesh.texspace_location, np.float32) - half, 2.0 * half], np.float32)


def filled(
    mesh: CachedMesh,
    grids: Sequence[Voxels],
    texture_space: np.ndarray,
    is_scaled: bool,
    cache: ExportCache,
    core: Any,
) -> CachedMesh:
    """The mesh with grids in it; texture space (0 or 2, 3)."""
    content = hashlib.sha1(mesh.digest, usedforsecurity=False)
    content.update(f"{texture_space.tolist()}{is_scaled}".encode())
    for grid in grids:
        content.update(f"{grid.name}{grid.values.shape}{grid.index_from_object.tolist()}".encode())
        content.update(grid.values)
    digest = content.digest()
    cached = cache.meshes.get(digest)
    if cached is None:
        given = [
            (
                layer_key(f"attribute:{grid.name}"),
                core.Grid(voxels=grid.values, index_from_object=grid.index_from_object),
            )
            for grid in grids
        ]
        handle = mesh.handle.filled(given, texture_space, is_scaled)
        cached = replace(mesh, handle=handle, digest=digest, form=digest)
        cache.add(cached)
    cache.keep_mesh(digest)
    return cached


def grid_box(
    grids: Sequence[Voxels],
    wanted: frozenset[str],
    is_scaled: bool,
    cache: ExportCache,
    core: Any,
) -> CachedMesh | None:
    """The box around grids, with them in it; None without any."""
    if not grids:
        return None
    corners = np.concatenate([grid.corners() for grid in grids])
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    mesh = load_surface(_box(lower, upper), cache, core)
    space = np.array([lower, upper - lower], np.float32)
    return replace(filled(mesh, grids, space, is_scaled, cache, core), layers=wanted)


def _box(lower: np.ndarray, upper: np.ndarray) -> Surface:
    """Twelve triangles, seen from outside."""
    units = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [(a, *pair) for a, b, c, d in faces for pair in ((b, c), (c, d))]
    vertices = np.where(units, upper, lower).astype(np.float32)
    return Surface(vertices, np.zeros_like(vertices), np.array(triangles, np.uint32))


def smoke_domain(owner: bpy.types.Object) -> Any:
    """The settings of a simulation of smoke or fire that an object is the box of, or None."""
    for modifier in owner.modifiers:
        if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
            settings = modifier.domain_settings
            if settings.domain_type == "GAS":
                return settings
    return None


# Numbers at each point of a domain's grids, and whether they are as fine as its noise.
SMOKE = {
    "density": (1, True),
    "color": (4, True),
    "flame": (1, True),
    "temperature": (1, True),
    "heat": (1, False),
}


def read_smoke(owner: bpy.types.Object, wanted: frozenset[str], frame: int) -> list[Voxels]:
    """The grids of a domain at this frame; none where nothing is simulated."""
    domain = smoke_domain(owner)
    if not domain.cache_frame_start <= frame <= domain.cache_frame_end:
        return []
    low, size = mesh_texture_space(owner.data)
    found = []
    for name, (width, is_fine) in SMOKE.items():
        if f"attribute:{name}" not in wanted:
            continue
        finer = domain.noise_scale if is_fine and domain.use_noise else 1
        x, y, z = (int(points) * finer for points in domain.domain_resolution)
        grid = getattr(domain, f"{name}_grid")
        if not len(grid) or len(grid) != x * y * z * width:
            continue
        values = np.empty(len(grid), np.float32)
        grid.foreach_get(values)
        # Along X they count fastest, and belong to the middles of cells.
        values = np.ascontiguousarray(values.reshape(z, y, x, width).transpose(2, 1, 0, 3))
        scale = np.array([x, y, z]) / size
        index = np.column_stack([np.diag(scale), -low * scale - 0.5]).astype(np.float32)
        found.append(Voxels(name, values, np.ascontiguousarray(index)))
    return found


def openvdb() -> Any:
    """The module that reads OpenVDB, as Blender brings it; None where it brings none."""
    for expose in (lambda: None, getattr(bpy.utils, "expose_bundled_modules", lambda: None)):
        expose()
        for name in MODULES:
            try:
                return importlib.import_module(name)
            except ImportError:
                continue
    return None


def read_volume(
    owner: bpy.types.Object, wanted: frozenset[str], warnings: Warnings, is_blurred: bool = False
) -> list[Voxels]:
    """The grids of an evaluated volume object that materials read."""
    data = owner.data
    if not data.grids.load():
        warnings.add(owner.name, f"its OpenVDB file cannot be read ({data.grids.error_message})")
        return []
    names = [grid.name for grid in data.grids if f"attribute:{grid.name}" in wanted]
    if is_blurred and any(grid.name == data.velocity_grid for grid in data.grids):
        warnings.add(owner.name, UNBLURRED)
    if not names:
        return []
    reader = openvdb()
    if reader is None:
        what = "this Blender has no openvdb module for Python, the volume is left out"
        warnings.add(owner.name, what)
        return []
    # Whatever modifiers have made of it; the grids in memory are not to be had otherwise.
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "volume.vdb")
        if not data.grids.save(filepath=path):
            warnings.add(owner.name, "its grids cannot be written, the volume is left out")
            return []
        read = [_voxels(reader.read(path, name), name, owner.name, warnings) for name in names]
    return [voxels for voxels in read if voxels]


def _voxels(grid: Any, name: str, owner: str, warnings: Warnings) -> Voxels | None:
    """The active part of an OpenVDB grid."""
    if grid.activeVoxelCount() == 0:
        return None
    lower, upper = (np.array(corner) for corner in grid.evalActiveVoxelBoundingBox())
    size = upper - lower + 1
    width = 3 if isinstance(grid.background, (tuple, list)) else 1
    reason = ""
    if not grid.transform.isLinear:
        reason = "is no box"
    elif int(np.prod(size)) * width > NUMBERS_MAX:
        reason = f"has {size[0]} x {size[1]} x {size[2]} points, which are too many"
    elif not isinstance(np.ravel(grid.background)[0], np.floating):
        reason = "holds no decimal numbers"
    if reason:
        warnings.add(owner, f"its grid '{name}' {reason} and is left out")
        return None
    values = np.zeros((*size, 3) if width == 3 else tuple(size), np.float32)
    grid.copyToArray(values, ijk=tuple(int(x) for x in lower))
    return Voxels(name, values.reshape(*size, width), _index_from_object(grid.transform, lower))


def _index_from_object(transform: Any, first: np.ndarray) -> np.ndarray:
    """The affine map (3, 4) that a linear transform of OpenVDB is, to indices from `first` on."""
    origin = np.array(transform.worldToIndex((0.0, 0.0, 0.0)))
    axes = [np.array(transform.worldToIndex(axis)) - origin for axis in np.eye(3).tolist()]
    return np.column_stack([*axes, origin - first]).astype(np.float32)
