"""Layers of a mesh that materials ask for: values at the corners of its faces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from . import tangent
from .tangent import read

# How many numbers each type of attribute holds, and the property that reads them.
ATTRIBUTE_TYPES = {
    "FLOAT": (1, "value"),
    "INT": (1, "value"),
    "INT8": (1, "value"),
    "BOOLEAN": (1, "value"),
    "FLOAT2": (2, "vector"),
    "FLOAT_VECTOR": (3, "vector"),
    "FLOAT_COLOR": (4, "color"),
    "BYTE_COLOR": (4, "color"),
    "QUATERNION": (4, "value"),
}


def read_layers(
    mesh: bpy.types.Mesh, wanted: frozenset[str], warn: Callable[[str], None]
) -> dict[str, np.ndarray]:
    """Values (corners, 4) of each layer by its name in `shader/layers.py`.

    One that the mesh does not have is told to `warn` and left out: programs read zero.
    """
    layers = {}
    for layer in sorted(wanted):
        kind, _, name = layer.partition(":")
        values = READERS[kind](mesh, name)
        if values is not None:
            layers[layer] = values
        elif name:
            warn(f"there is no {KINDS[kind]} '{name}', zero is used")
    return layers


def _uv(mesh: bpy.types.Mesh, name: str) -> np.ndarray | None:
    layer = mesh.uv_layers.get(name)
    return None if layer is None else _padded(read(layer.uv, "vector", 2))


def _attribute(mesh: bpy.types.Mesh, name: str) -> np.ndarray | None:
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type not in ATTRIBUTE_TYPES:
        return None
    width, field = ATTRIBUTE_TYPES[attribute.data_type]
    values = read(attribute.data, field, width)
    if width == 1:
        values = np.repeat(values, 3, axis=1)
    corners = _corner_elements(mesh, attribute.domain)
    return None if corners is None else _padded(values)[corners]


def _color(mesh: bpy.types.Mesh, name: str) -> np.ndarray | None:
    """A colour attribute; without a name the one that is marked for rendering."""
    colors = mesh.color_attributes
    if not name:
        row = colors.render_color_index
        name = colors[row].name if 0 <= row < len(colors) else ""
    return _attribute(mesh, name)


def _generated(mesh: bpy.types.Mesh, _: str) -> np.ndarray:
    """From 0 to 1 within the texture space of the mesh before it is deformed."""
    positions = read(mesh.vertices, "undeformed_co", 3)
    size = np.array(mesh.texspace_size, np.float32)
    scale = np.divide(0.5, size, out=np.zeros_like(size), where=size != 0.0)
    generated = (positions - np.array(mesh.texspace_location, np.float32)) * scale + 0.5
    return _padded(generated)[_corner_elements(mesh, "POINT")]


def _flat(mesh: bpy.types.Mesh, _: str) -> np.ndarray:
    """One at the corners of flat faces, zero at those of smooth ones."""
    values = _attribute(mesh, "sharp_face")
    return np.zeros((len(mesh.loops), 4), np.float32) if values is None else values


def _tangent(mesh: bpy.types.Mesh, name: str) -> np.ndarray | None:
    """Tangents along a UV map (MikkTSpace, as Blender bakes with), and the bitangents' sign.

    A mesh without any map has one from a sphere around it, as in Cycles.
    """
    layers = mesh.uv_layers
    layer = layers.get(name) if name else next((m for m in layers if m.active_render), None)
    if layer is None:
        return None if name or layers else tangent.along(mesh, tangent.sphere(mesh), wraps=True)
    values = np.empty((len(mesh.loops), 4), np.float32)
    # Read now: `layer` may be no more once Blender has tried.
    uvs = read(layer.uv, "vector", 2)
    try:
        mesh.calc_tangents(uvmap=layer.name)
    except RuntimeError:  # Blender takes triangles and quads only.
        return tangent.along(mesh, uvs)
    values[:, :3] = read(mesh.loops, "tangent", 3)
    values[:, 3:] = read(mesh.loops, "bitangent_sign", 1)
    mesh.free_tangents()
    return values


def _corner_elements(mesh: bpy.types.Mesh, domain: str) -> Any:
    """Which element of a domain each corner reads; None for domains that corners do not have."""
    if domain == "CORNER":
        return slice(None)
    if domain == "POINT":
        return read(mesh.attributes[".corner_vert"].data, "value", 1, np.int32)[:, 0]
    if domain == "FACE":
        totals = read(mesh.polygons, "loop_total", 1, np.int32)[:, 0]
        return np.repeat(np.arange(len(totals)), totals)
    return None


def _padded(values: np.ndarray) -> np.ndarray:
    """Four columns: zeros after the given ones, and an alpha of one."""
    padded = np.zeros((len(values), 4), np.float32)
    padded[:, 3] = 1.0
    padded[:, : values.shape[1]] = values
    return padded


Reader = Callable[[bpy.types.Mesh, str], np.ndarray | None]

READERS: dict[str, Reader] = {
    "uv": _uv,
    "attribute": _attribute,
    "color": _color,
    "generated": _generated,
    "flat": _flat,
    "tangent": _tangent,
}

KINDS = {
    "uv": "UV map",
    "attribute": "attribute",
    "color": "colour attribute",
    "tangent": "UV map",
}
