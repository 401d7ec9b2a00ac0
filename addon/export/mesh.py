"""Evaluated meshes as arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from .cache import CachedMesh, ExportCache
from .layer import read_layers
from .shader.layers import ACTIVE_UV, OF_STRANDS, PARTICLE, layer_key
from .strands import Surface


class NotFinite(Exception):
    """A vertex, normal or texture coordinate is NaN or infinite."""


@dataclass(frozen=True)
class Faces:
    """What tells two meshes apart, read with one copy per attribute: cheap enough each frame."""

    positions: np.ndarray  # (V, 3) m, object
    corner_vertices: np.ndarray  # (K,) vertex
    corner_normals: np.ndarray  # (K, 3) unit, object; zero of flat faces
    corner_uvs: np.ndarray  # (K, 2), or (0, 2) where nobody asks for them
    face_starts: np.ndarray  # (F,) corner
    face_materials: np.ndarray  # (F,) slot
    layers: dict[str, np.ndarray]  # (K, 4) each, by name

    def digests(self) -> tuple[bytes, bytes]:
        """Hash of all but the texture coordinates, and of everything."""
        # Processors have instructions for it: of deforming meshes every byte is hashed each frame.
        content = hashlib.sha1(repr(sorted(self.layers)).encode(), usedforsecurity=False)
        for array in (*vars(self).values(), *self.layers.values()):
            if isinstance(array, np.ndarray) and array is not self.corner_uvs:
                content.update(str(array.shape).encode())
                content.update(array)
        form = content.digest()
        content.update(self.corner_uvs)
        return form, content.digest()


def load_mesh(
    mesh: bpy.types.Mesh,
    cache: ExportCache,
    core: Any,
    wanted: frozenset[str],
    warn: Callable[[str], None],
) -> CachedMesh | None:
    """The renderer's mesh with the content of an evaluated mesh; None if it has no faces.

    Triangles are read and handed over only if no earlier frame held the same content. `wanted`
    names the layers that materials read; one that is missing is told to `warn`. Texture coordinates
    are left out where nobody asks for them: some modifiers, Bevel among them, compute them with
    other last bits at each evaluation, and the mesh would never be the same twice.
    Raises NotFinite.
    """
    if len(mesh.polygons) == 0:
        return None
    faces = read_faces(mesh, wanted, warn)
    cache.statistics.meshes_read += 1
    form, digest = faces.digests()
    cached = cache.meshes.get(digest) or cache.same_but_noise(form, faces.corner_uvs)
    if cached is None:
        arrays = (faces.positions, faces.corner_normals, faces.corner_uvs)
        for array in (*arrays, *faces.layers.values()):
            if not np.isfinite(array).all():
                raise NotFinite
        handle = core.Mesh(**triangle_arrays(mesh, faces))
        cached = CachedMesh(handle, digest, form, faces.corner_uvs, wanted)
        cache.add(cached)
    return cached


def load_surface(surface: Surface, cache: ExportCache, core: Any) -> CachedMesh:
    """The renderer's mesh with these triangles, of one material slot. Raises NotFinite."""
    if not np.isfinite(surface.vertices).all():
        raise NotFinite
    content = hashlib.blake2b(digest_size=16)
    parts = (surface.vertices, surface.normals, surface.triangles, surface.roots)
    for array in (*parts, *surface.layers.values()):
        content.update(np.ascontiguousarray(array))
    digest = content.digest()
    cached = cache.meshes.get(digest)
    if cached is None:
        corner_uvs = np.zeros((*surface.triangles.shape, 2), np.float32)
        handle = core.Mesh(
            vertices=surface.vertices,
            triangles=surface.triangles,
            corner_normals=surface.normals[surface.triangles],
            corner_uvs=corner_uvs,
            layer_keys=np.array([layer_key(name) for name in surface.layers], np.uint32),
            layer_values=np.array(
                [values[surface.triangles] for values in surface.layers.values()], np.float32
            ).reshape(-1, *surface.triangles.shape, 4),
            material_slots=np.zeros(len(surface.triangles), np.uint32),
        )
        cached = CachedMesh(handle, digest, digest, corner_uvs, frozenset(surface.layers))
        cache.add(cached)
    return cached


def read_faces(mesh: bpy.types.Mesh, wanted: frozenset[str], warn: Callable[[str], None]) -> Faces:
    """Positions, corners and faces of an evaluated mesh."""
    corners = len(mesh.loops)
    attributes = mesh.attributes
    materials = attributes.get("material_index")
    uv_maps = mesh.uv_layers if ACTIVE_UV in wanted else ()
    uv_map = next((uv_map for uv_map in uv_maps if uv_map.active_render), None)
    face_count = len(mesh.polygons)
    # Into signed numbers unsigned ones are read one by one: a hundred times as long.
    starts = np.empty(face_count, np.uint32)
    mesh.polygons.foreach_get("loop_start", starts)
    face_materials = np.zeros(face_count, np.int32)
    if materials is not None and materials.domain == "FACE" and materials.data_type == "INT":
        materials.data.foreach_get("value", face_materials)
    return Faces(
        # The attribute is copied as a block; `vertices` and `loops` are read one by one.
        positions=_read(attributes["position"].data, "vector", len(mesh.vertices), 3),
        corner_vertices=_read(attributes[".corner_vert"].data, "value", corners, 0),
        corner_normals=_corner_normals(mesh, starts),
        corner_uvs=(
            _read(uv_map.uv, "vector", corners, 2) if uv_map else np.empty((0, 2), np.float32)
        ),
        face_starts=starts,
        face_materials=np.maximum(face_materials, 0),
        layers=read_layers(mesh, wanted - {ACTIVE_UV, PARTICLE} - OF_STRANDS, warn),
    )


def mesh_positions(owner: bpy.types.Object) -> np.ndarray | None:
    """Positions (V, 3) of an object's evaluated mesh; None for one that is being edited."""
    mesh = owner.data
    if mesh.is_editmode:
        return None
    return _read(mesh.attributes["position"].data, "vector", len(mesh.vertices), 3)


def triangle_arrays(mesh: bpy.types.Mesh, faces: Faces) -> dict[str, np.ndarray]:
    """The arrays of the contract's MESH table."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    corners = np.empty((count, 3), np.uint32)
    mesh.loop_triangles.foreach_get("loops", corners.reshape(-1))
    polygons = np.empty(count, np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", polygons)
    rows = corners.astype(np.intp)  # else each `take` would make its own

    def of_corners(values: np.ndarray) -> np.ndarray:
        return values.take(rows, axis=0)  # twice as fast as an index

    return {
        "vertices": faces.positions,
        "triangles": of_corners(faces.corner_vertices).view(np.uint32),
        "corner_normals": of_corners(faces.corner_normals),
        "corner_uvs": (
            of_corners(faces.corner_uvs)
            if len(faces.corner_uvs)
            else np.zeros((count, 3, 2), np.float32)
        ),
        "layer_keys": np.array([layer_key(name) for name in faces.layers], np.uint32),
        "layer_values": np.array(
            [of_corners(values) for values in faces.layers.values()], np.float32
        ).reshape(-1, count, 3, 4),
        "material_slots": faces.face_materials.take(polygons).view(np.uint32),
    }


def _corner_normals(mesh: bpy.types.Mesh, face_starts: np.ndarray) -> np.ndarray:
    """Normals (K, 3) of the corners; zero, the triangle's own, where Cycles shades triangles flat.

    A flat face that is no plane has several triangles, each with a normal of its own; Blender says
    that of the whole face. Where edges are sharp or normals are custom Cycles takes that as well.
    """
    corners = len(mesh.loops)
    if mesh.normals_domain == "FACE" and not mesh.has_custom_normals:
        return np.zeros((corners, 3), np.float32)
    normals = _read(mesh.corner_normals, "vector", corners, 3)
    if mesh.normals_domain == "CORNER" and not mesh.has_custom_normals:
        is_flat, is_sharp = _flags(mesh, "sharp_face"), _flags(mesh, "sharp_edge")
        if is_flat is not None and (is_sharp is None or not is_sharp.any()):
            sizes = np.diff(face_starts, append=np.uint32(corners))
            normals[np.repeat(is_flat, sizes)] = 0.0
    return normals


def _flags(mesh: bpy.types.Mesh, name: str) -> np.ndarray | None:
    """An attribute of truths, if the mesh has it."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type != "BOOLEAN":
        return None
    flags = np.empty(len(attribute.data), np.bool_)
    attribute.data.foreach_get("value", flags)
    return flags


def _read(collection: Any, name: str, count: int, width: int) -> np.ndarray:
    """One attribute as (count, width) float32, or for width 0 as (count,) int32."""
    array = np.empty((count, width), np.float32) if width else np.empty(count, np.int32)
    collection.foreach_get(name, array.reshape(-1))
    return array
