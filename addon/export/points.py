"""Point clouds as balls."""

from __future__ import annotations

from typing import Any

import numpy as np

from .strands import Surface

# Divisions of the ball's faces: 1280 triangles, whose outline is off by half a per cent.
DIVISIONS = 3
# Cycles' radius where the attribute is missing [m].
RADIUS = 0.01


def read_points(data: Any) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) and radii (N,) of an evaluated point cloud [m, object]."""
    count = len(data.points)
    positions = np.empty((count, 3), np.float32)
    data.attributes["position"].data.foreach_get("vector", positions.reshape(-1))
    radii = np.full(count, RADIUS, np.float32)
    radius = data.attributes.get("radius")
    if radius is not None and radius.data_type == "FLOAT":
        radius.data.foreach_get("value", radii)
    return positions, radii


def placements(
    world_from_object: np.ndarray, positions: np.ndarray, radii: np.ndarray
) -> np.ndarray:
    """Matrices (N, 3, 4) that place the unit ball at each point, of one matrix (3, 4)."""
    linear, origin = world_from_object[:, :3], world_from_object[:, 3]
    matrices = np.empty((len(positions), 3, 4), np.float32)
    matrices[:, :, :3] = radii[:, None, None] * linear
    matrices[:, :, 3] = positions @ linear.T + origin
    return matrices


def unit_ball() -> Surface:
    """A sphere of radius 1, an icosahedron divided; its mean outline is that of the sphere."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    vertices = np.array([np.roll(c, shift) for shift in range(3) for c in corners])
    vertices /= np.linalg.norm(vertices[0])
    triangles = _nearest_triples(vertices)
    for _ in range(DIVISIONS):
        vertices, triangles = _divided(vertices, triangles)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    surface = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    # A convex body's mean outline is a quarter of its surface (Cauchy).
    grown = vertices * np.sqrt(4.0 * np.pi / surface)
    return Surface(
        grown.astype(np.float32), vertices.astype(np.float32), triangles.astype(np.uint32)
    )


def _nearest_triples(vertices: np.ndarray) -> np.ndarray:
    """The triples of vertices one edge apart, counter-clockwise seen from outside."""
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    edge = distance[distance > 0.0].min() * 1.01
    near = (distance > 0.0) & (distance < edge)
    i, j, k = np.nonzero(near[:, :, None] & near[None, :, :] & near[:, None, :])
    once = (i < j) & (j < k)
    triples = np.stack([i[once], j[once], k[once]], axis=1)
    a, b, c = (vertices[triples[:, n]] for n in range(3))
    inward = (np.cross(b - a, c - a) * a).sum(axis=1) < 0.0
    triples[inward] = triples[inward][:, ::-1]
    return triples


def _divided(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every triangle in four, on the unit sphere."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    pairs, index = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    middles = vertices[pairs].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    ab, bc, ca = (index.reshape(-1, 3) + len(vertices)).T
    a, b, c = triangles.T
    new = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    return np.concatenate([vertices, middles]), np.array(new).transpose(2, 0, 1).reshape(-1, 3)
