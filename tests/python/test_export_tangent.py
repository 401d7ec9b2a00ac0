"""Tangents that Blender does not compute, against those that it does of the same triangles."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
import pytest
from addon.export import layer, tangent
from mathutils import Vector


def ball(is_smooth: bool, is_polygonal: bool = False) -> bpy.types.Mesh:
    """A ball with a UV map; with some faces joined to larger ones, or of triangles."""
    mesh = bpy.data.meshes.new("Ball")
    body = bmesh.new()
    body.loops.layers.uv.new("UVMap")
    bmesh.ops.create_uvsphere(body, u_segments=12, v_segments=7, radius=1.0, calc_uvs=True)
    if is_polygonal:
        bmesh.ops.dissolve_edges(body, edges=edges_between_pairs(body))
    else:
        bmesh.ops.triangulate(body, faces=body.faces)
    for face in body.faces:
        face.smooth = is_smooth
    body.to_mesh(mesh)
    body.free()
    return mesh


def edges_between_pairs(body: bmesh.types.BMesh) -> list[bmesh.types.BMEdge]:
    """Edges between two quads that each touch no other one of them.

    Not at the seam of the map, where one face would have both of its ends.
    """
    uv = body.loops.layers.uv.active
    found, taken = [], set()
    for edge in sorted(body.edges, key=lambda edge: sum((v.co for v in edge.verts), Vector())[:]):
        faces = {face.index for face in edge.link_faces}
        loops = [loop for face in edge.link_faces for loop in face.loops]
        is_inside = all(0.2 < loop[uv].uv.x < 0.8 for loop in loops)
        if is_inside and len(loops) == 8 and not faces & taken:
            found.append(edge)
            taken |= faces
    return found


def uvs_of(mesh: bpy.types.Mesh) -> np.ndarray:
    return tangent.read(mesh.uv_layers[0].uv, "vector", 2)


@pytest.mark.parametrize("is_smooth", [False, True])
def test_tangents_are_those_of_blender(is_smooth: bool) -> None:
    mesh = ball(is_smooth)
    # Half of the map is mirrored. A few flat triangles have no area in it; of smooth ones those
    # around them would touch in a corner only.
    uvs = uvs_of(mesh)
    uvs[:, 0] = np.abs(uvs[:, 0] - 0.5)
    has_area = np.ones(len(uvs), bool)
    has_area[60:69] = is_smooth
    uvs[~has_area] = 0.25
    mesh.uv_layers[0].uv.foreach_set("vector", uvs.ravel())
    found = tangent.along(mesh, uvs)
    mesh.calc_tangents(uvmap="UVMap")
    expected = tangent.read(mesh.loops, "tangent", 3)
    signs = tangent.read(mesh.loops, "bitangent_sign", 1)[:, 0]
    assert np.allclose(found[has_area, :3], expected[has_area], atol=2e-3)
    assert np.array_equal(found[has_area, 3], signs[has_area])
    assert np.array_equal(found[~has_area], np.tile(tangent.UNKNOWN, ((~has_area).sum(), 1)))


def test_larger_polygons_share_tangents() -> None:
    mesh = ball(is_smooth=True, is_polygonal=True)
    assert max(len(face.vertices) for face in mesh.polygons) > 4
    found = layer.read_layers(mesh, frozenset({"tangent:"}), print)["tangent:"]
    vertices = tangent.read(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
    points = tangent.read(mesh.vertices, "co", 3)[vertices]
    # Away from the poles they run around the axis; those of single faces would be 15 degrees off.
    # Few do not: three corners of a joined face may lie on one line of the map.
    away = np.abs(points[:, 2]) < 0.8
    around = np.stack([-points[:, 1], points[:, 0]], 1)
    around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-6)
    cosines = np.abs((found[:, :2] * around).sum(1))[away]
    assert np.quantile(cosines, 0.2) > 0.98


def test_without_a_map_they_run_around_the_axis() -> None:
    mesh = ball(is_smooth=True)
    mesh.uv_layers.remove(mesh.uv_layers[0])
    found = layer.read_layers(mesh, frozenset({"tangent:"}), print)["tangent:"]
    vertices = tangent.read(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
    points = tangent.read(mesh.vertices, "co", 3)[vertices]
    away = np.abs(points[:, 2]) < 0.8
    around = np.stack([-points[:, 1], points[:, 0]], 1)
    around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-6)
    assert (found[:, :2] * around).sum(1)[away].min() > 0.99
    assert (found[away, 3] == 1.0).all()
    named = layer.read_layers(mesh, frozenset({"tangent:Gone"}), lambda _: None)
    assert named == {}
