"""Hair and curves as tubes of triangles.

Cycles draws a Catmull-Rom spline through the points of each strand, as a round tube or as a ribbon
that turns to the ray and is shaded as if round: from outside a tube looks like both.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from .report import Warnings
from .shader.layers import STRAND, STRAND_INFO

# Faces around a tube. Corner normals make it look round; its mean width is that of a circle.
SIDES = 8
# Straight pieces between two points, as Cycles has it by default (2 subdivisions).
PIECES = 4
# Triangles of one object above which strands get fewer pieces and sides: 4 million take about a
# gigabyte in all.
TRIANGLES_MAX = 4_000_000
# Points asked of a particle system one by one; a million takes about a second.
PARTICLE_POINTS_MAX = 5_000_000
# Cycles' radius where the attribute is missing [m].
RADIUS = 0.005


@dataclass(frozen=True)
class Strands:
    """Control points of many strands, one after the other."""

    points: np.ndarray  # (P, 3) m, object
    radii: np.ndarray  # (P,) m
    counts: np.ndarray  # (S,) points of each strand
    # Number of the first strand among those of its object.
    first: int = 0


@dataclass(frozen=True)
class Surface:
    """Triangles with a normal at each vertex."""

    vertices: np.ndarray  # (V, 3) m, object
    normals: np.ndarray  # (V, 3) unit, object
    triangles: np.ndarray  # (T, 3) vertex
    # (S, 3) unit, object: across each strand at its root, if it is of strands.
    roots: np.ndarray = field(default_factory=lambda: np.empty((0, 3), np.float32))
    # (V, 4) each, by the name of the layer.
    layers: dict[str, np.ndarray] = field(default_factory=dict)


def strands_of_curves(data: Any) -> Strands:
    """The strands of an evaluated Curves datablock."""
    count = len(data.points)
    points = np.empty((count, 3), np.float32)
    data.attributes["position"].data.foreach_get("vector", points.reshape(-1))
    radii = np.full(count, RADIUS, np.float32)
    radius = data.attributes.get("radius")
    if radius is not None and radius.domain == "POINT" and radius.data_type == "FLOAT":
        radius.data.foreach_get("value", radii)
    ends = np.empty(len(data.curve_offset_data), np.int32)
    data.curve_offset_data.foreach_get("value", ends)
    return Strands(points, radii, np.diff(ends))


def strands_of_particles(owner: Any, system: Any, warnings: Warnings) -> Strands | None:
    """The strands of an evaluated hair particle system as a render shows them.

    Blender hands out their points one by one.
    """
    settings = system.settings
    parents, children = len(system.particles), len(system.child_particles)
    # Children replace their parents unless these are asked for.
    first = parents if children and not settings.use_parent_particles else 0
    steps = 2**settings.render_step + 1
    count = parents + children - first
    if count * steps > PARTICLE_POINTS_MAX:
        warnings.add(owner.name, f"{count} hairs of '{system.name}' are too many and left out")
        return None
    if count <= 0:
        return None
    points = np.array(
        [
            system.co_hair(object=owner, particle_no=strand, step=step)
            for strand in range(first, parents + children)
            for step in range(steps)
        ],
        np.float32,
    ).reshape(count, steps, 3)
    # A strand that Blender did not make is all zeros.
    points = points[points.any(axis=(1, 2))]
    radii = particle_radii(settings, points)
    object_from_world = np.array(Matrix(owner.matrix_world).inverted_safe(), np.float32)
    points = points @ object_from_world[:3, :3].T + object_from_world[:3, 3]
    counts = np.full(len(points), steps, np.int32)
    return Strands(points.reshape(-1, 3), radii.reshape(-1), counts)


def particle_radii(settings: Any, points: np.ndarray) -> np.ndarray:
    """Radius at each point (S, P) of strands (S, P, 3), by the profile of the particle settings."""
    to_tip = 1.0 - travelled(points)[0]
    shape = settings.shape
    exponent = 1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, 1e-6)
    profile = np.clip(to_tip, 0.0, 1.0) ** exponent
    root, tip = (
        0.5 * settings.radius_scale * r for r in (settings.root_radius, settings.tip_radius)
    )
    radii = tip + (root - tip) * profile
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return radii.astype(np.float32)


def travelled(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share of its length at each point (S, P) of strands (S, P, 3), and the lengths (S,)."""
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    lengths = steps.sum(axis=1, keepdims=True)
    shares = np.cumsum(steps, axis=1) / np.maximum(lengths, 1e-12)
    return np.concatenate([np.zeros_like(shares[:, :1]), shares], axis=1), lengths[:, 0]


def tubes(
    strands: Strands,
    name: str,
    warnings: Warnings,
    roots: np.ndarray | None = None,
    wanted: Collection[str] = (),
) -> Surface | None:
    """The tubes of all strands with at least two points; None without any.

    `roots` are those of the same strands at another time: tubes do not turn in between. `wanted`
    names the layers that materials read.
    """
    groups = _by_length(strands)
    pieces, sides = PIECES, SIDES
    spans = sum(len(g.points) * (g.points.shape[1] - 1) for g in groups)
    while spans * pieces * sides * 2 > TRIANGLES_MAX and (pieces, sides) != (1, 3):
        pieces, sides = max(1, pieces - 1), max(3, sides - 1)
    if (pieces, sides) != (PIECES, SIDES):
        count = spans * pieces * sides * 2
        warnings.add(name, f"its strands are drawn coarsely, with {count} triangles")
    ends = np.cumsum([len(g.points) for g in groups])
    if roots is not None and (not groups or len(roots) != ends[-1]):
        roots = None
    starts = [None] * len(groups) if roots is None else np.split(roots, ends[:-1])
    surfaces = [
        _tubes(group, pieces, sides, start, wanted)
        for group, start in zip(groups, starts, strict=True)
    ]
    return _joined(surfaces) if surfaces else None


@dataclass(frozen=True)
class Alike:
    """Strands of as many points each."""

    points: np.ndarray  # (S, P, 3) m, object
    radii: np.ndarray  # (S, P) m
    numbers: np.ndarray  # (S,) of the strands in their object


def _by_length(strands: Strands) -> list[Alike]:
    """The strands of at least two points."""
    starts = np.cumsum(strands.counts) - strands.counts
    groups = []
    for length in np.unique(strands.counts):
        if length > 1:
            numbers = np.flatnonzero(strands.counts == length)
            rows = starts[numbers][:, None] + np.arange(length)
            groups.append(Alike(strands.points[rows], strands.radii[rows], numbers + strands.first))
    return groups


def _joined(surfaces: list[Surface]) -> Surface:
    offsets = np.cumsum([0] + [len(s.vertices) for s in surfaces[:-1]])
    triangles = [s.triangles + o for s, o in zip(surfaces, offsets, strict=True)]
    return Surface(
        np.concatenate([s.vertices for s in surfaces]),
        np.concatenate([s.normals for s in surfaces]),
        np.concatenate(triangles).astype(np.uint32),
        np.concatenate([s.roots for s in surfaces]),
        {name: np.concatenate([s.layers[name] for s in surfaces]) for name in surfaces[0].layers},
    )


def _tubes(
    group: Alike, pieces: int, sides: int, roots: np.ndarray | None, wanted: Collection[str]
) -> Surface:
    line = catmull_rom(np.concatenate([group.points, group.radii[..., None]], axis=2), pieces)
    centres, radius = line[..., :3], np.maximum(line[..., 3], 0.0)
    across, up = frames(centres, roots)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    # (S, P, sides, 3)
    normals = np.cos(angle)[:, None] * across[:, :, None] + np.sin(angle)[:, None] * up[:, :, None]
    # The mean width of a convex shape is its perimeter over pi: that of a circle is to stay.
    grown = radius * (np.pi / sides / np.sin(np.pi / sides))
    vertices = centres[:, :, None] + grown[:, :, None, None] * normals
    strands, rings = radius.shape
    layers = {}
    if STRAND in wanted:
        along = radius[..., None] * np.cross(across, up)
        layers[STRAND] = _ring_layer(along, np.full((strands, rings, 1), sides), sides)
    if STRAND_INFO in wanted:
        layers[STRAND_INFO] = _ring_layer(
            _infos(group, pieces), np.zeros((strands, rings, 1)), sides
        )
    return Surface(
        vertices.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        _tube_triangles(strands, rings, sides),
        across[:, 0].astype(np.float32),
        layers,
    )


def _infos(group: Alike, pieces: int) -> np.ndarray:
    """What Hair Info tells at each ring (S, R, 3): share of the length, the length, the number."""
    shares, lengths = travelled(group.points)
    t = np.arange(pieces) / pieces
    between = shares[:, :-1, None] * (1.0 - t) + shares[:, 1:, None] * t
    shares = np.concatenate([between.reshape(len(shares), -1), shares[:, -1:]], axis=1)
    columns = (shares, lengths[:, None], group.numbers[:, None])
    return np.stack(np.broadcast_arrays(*columns), axis=2)


def _ring_layer(values: np.ndarray, last: np.ndarray, sides: int) -> np.ndarray:
    """Values (S, R, 3) and (S, R, 1) of each ring, for all vertices (V, 4)."""
    rows = np.concatenate([values, last], axis=2).astype(np.float32)
    return np.repeat(rows.reshape(-1, 4), sides, axis=0)


def _tube_triangles(strands: int, rings: int, sides: int) -> np.ndarray:
    """Triangles between neighbouring rings of vertices, seen from outside."""
    side = np.arange(sides)
    ring = np.arange(rings - 1)[:, None] * sides
    here, there = ring + side, ring + (side + 1) % sides
    quads = [[here, there, there + sides], [here, there + sides, here + sides]]
    triangles = np.array(quads).transpose(2, 3, 0, 1).reshape(-1, 3)
    first = np.arange(strands)[:, None, None] * (rings * sides)
    return (first + triangles).reshape(-1, 3)


def catmull_rom(points: np.ndarray, pieces: int) -> np.ndarray:
    """`pieces` pieces per span of the splines through points (S, P, C); ends are repeated."""
    padded = np.concatenate([points[:, :1], points, points[:, -1:]], axis=1)
    a, b, c, d = (padded[:, i : i + points.shape[1] - 1, None] for i in range(4))
    t = (np.arange(pieces) / pieces)[:, None]
    spans = 0.5 * (
        2.0 * b
        + (c - a) * t
        + (2.0 * a - 5.0 * b + 4.0 * c - d) * t**2
        + (3.0 * b - a - 3.0 * c + d) * t**3
    )
    line = spans.reshape(len(points), -1, points.shape[2])
    return np.concatenate([line, points[:, -1:]], axis=1)


def frames(line: np.ndarray, roots: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Two axes (S, P, 3) across each line (S, P, 3) that turn as little as they can.

    The first begins near `roots` (S, 3), if there are any.
    """
    ahead = np.gradient(line, axis=1)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=2, keepdims=True), 1e-20)
    across = np.empty_like(ahead)
    # To start with: the axis of space that the line is most across.
    reference = np.eye(3)[np.abs(ahead[:, 0]).argmin(axis=1)] if roots is None else roots
    for ring in range(line.shape[1]):
        along = ahead[:, ring]
        reference = reference - (reference * along).sum(axis=1, keepdims=True) * along
        reference /= np.maximum(np.linalg.norm(reference, axis=1, keepdims=True), 1e-20)
        across[:, ring] = reference
    return across, np.cross(ahead, across)


def has_hair(system: bpy.types.ParticleSystem) -> bool:
    """Whether a render shows the system's strands."""
    return system.settings.type == "HAIR" and system.settings.render_type == "PATH"
