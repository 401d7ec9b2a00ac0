"""Tangents of meshes for which Blender computes none: those with larger polygons, or no UV map.

After MikkTSpace (Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008) over triangles, as
Cycles has them. Departure: triangles that touch only in a corner share its tangent too.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

TINY = np.finfo(np.float32).tiny
# Of a corner where no triangle has an area in the map: a tangent, and the bitangent's sign.
UNKNOWN = (1.0, 0.0, 0.0, -1.0)


def along(mesh: bpy.types.Mesh, uvs: np.ndarray, wraps: bool = False) -> np.ndarray:
    """Tangents (corners, 4) along u, given the map (corners, 2), and the bitangents' sign.

    A map that wraps has no seam: 0 and 1 are the same u.
    """
    mesh.calc_loop_triangles()
    corners = read(mesh.loop_triangles, "loops", 3, np.int32)
    vertices = read(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
    points = read(mesh.vertices, "co", 3)[vertices]
    normals = read(mesh.corner_normals, "vector", 3)
    values = np.tile(np.array(UNKNOWN, np.float32), (len(vertices), 1))
    if len(corners):
        # What lies in one place, faces alike and maps alike is one corner, whatever its index.
        alike = _rows_alike(np.concatenate([points, normals, uvs], axis=1))
        maps = uvs[corners]
        if wraps:
            maps[..., 0] -= np.round(maps[..., 0] - maps[:, :1, 0])
        values[corners] = _shared(points[corners], normals[corners], maps, alike[corners])
    return values


def sphere(mesh: bpy.types.Mesh) -> np.ndarray:
    """A map (corners, 2) from the directions in which the corners lie, z up."""
    vertices = read(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
    x, y, z = read(mesh.vertices, "co", 3).T
    length = np.sqrt(x * x + y * y + z * z)
    height = np.divide(z, length, out=np.zeros_like(z), where=length > 0.0)
    u = np.where((x == 0.0) & (y == 0.0), 0.0, 0.5 - np.arctan2(x, y) / (2.0 * np.pi))
    v = 1.0 - np.arccos(np.clip(height, -1.0, 1.0)) / np.pi
    maps = np.stack([u, np.where(length > 0.0, v, 0.0)], axis=1).astype(np.float32)
    return maps[vertices]


def read(collection: Any, name: str, width: int, dtype: type = np.float32) -> np.ndarray:
    """One property of all elements as (count, width)."""
    values = np.empty((len(collection), width), dtype)
    collection.foreach_get(name, values.reshape(-1))
    return values


def _rows_alike(rows: np.ndarray) -> np.ndarray:
    """A number for each row, the same for equal ones."""
    rows = np.ascontiguousarray(rows + np.float32(0.0))  # one zero, not two
    whole = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1])))[:, 0]
    return np.unique(whole, return_inverse=True)[1].reshape(-1)


def _shared(
    points: np.ndarray, normals: np.ndarray, uvs: np.ndarray, alike: np.ndarray
) -> np.ndarray:
    """Tangents and signs (triangles, 3, 4), the means of the triangles that share a corner."""
    tangents, is_mirrored, is_good = _of_triangles(points, uvs)
    before, after = np.roll(points, 1, axis=1) - points, np.roll(points, -1, axis=1) - points
    cos = (_projected(normals, before) * _projected(normals, after)).sum(-1)
    weights = np.arccos(np.clip(cos, -1.0, 1.0)) * is_good[:, None]
    parts = _projected(normals, tangents[:, None]) * weights[..., None]
    # Mirrored triangles share among themselves.
    groups = 2 * alike + is_mirrored[:, None]
    count = 2 * (alike.max() + 1)
    sums = [np.bincount(groups.ravel(), part.ravel(), count) for part in np.moveaxis(parts, -1, 0)]
    is_known = np.bincount(groups.ravel(), np.repeat(is_good, 3), count) > 0.0
    # A triangle without an area in the map takes what there is.
    taken = np.where(is_good[:, None], groups, 2 * alike + ~is_known[2 * alike])
    signs = np.where(taken % 2 == 1, -1.0, 1.0)
    shared = np.concatenate([_unit(np.stack(sums, -1))[taken], signs[..., None]], axis=-1)
    return np.where(is_known[taken][..., None], shared, UNKNOWN).astype(np.float32)


def _of_triangles(points: np.ndarray, uvs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each triangle the direction of u, whether its map is mirrored, and has an area."""
    one, other = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    area = u1 * v2 - v1 * u2
    along_u = v2[:, None] * one - v1[:, None] * other
    along_v = u1[:, None] * other - u2[:, None] * one
    lengths = (along_u * along_u).sum(-1), (along_v * along_v).sum(-1)
    is_good = (np.abs(area) > TINY) & (lengths[0] > TINY) & (lengths[1] > TINY)
    is_mirrored = ~(area > 0.0)
    return _unit(along_u) * np.where(is_mirrored, -1.0, 1.0)[:, None], is_mirrored, is_good


def _projected(normals: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Unit vectors across the normals."""
    return _unit(vectors - normals * (normals * vectors).sum(-1, keepdims=True))


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
