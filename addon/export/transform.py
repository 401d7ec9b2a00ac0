"""Matrices on their way from Blender to the renderer."""

from __future__ import annotations

import numpy as np
from mathutils import Matrix, Vector

# Below this an axis has no direction left, and its inverse leaves the range of a float32.
SMALLEST_SCALE = 1e-12
# Volume of the parallelepiped of the normalised axes below which they lie in a plane.
SMALLEST_VOLUME = 1e-6


def matrix_3x4(matrix: Matrix) -> np.ndarray:
    """The upper three rows, float32."""
    return np.array([row[:] for row in matrix[:3]], np.float32)


def axis_scale(matrix: Matrix) -> Vector:
    """Lengths of the three axes."""
    return Vector(matrix.col[i].to_3d().length for i in range(3))


def without_scale(matrix: Matrix) -> Matrix | None:
    """The same place and axes, each of length one; None if an axis has no direction.

    A mirrored matrix stays mirrored. Shear, which only parents with unequal scale make, is taken
    out by keeping the viewing axis.
    """
    axes = [matrix.col[i].to_3d() for i in range(3)]
    if not all(SMALLEST_SCALE < axis.length < float("inf") for axis in axes):
        return None
    mirrored = axes[0].cross(axes[1]).dot(axes[2]) < 0
    z = axes[2].normalized()
    x = (axes[0] - axes[0].dot(z) * z).normalized()
    if x.length == 0.0:
        return None
    y = z.cross(x) * (-1 if mirrored else 1)
    rotation = Matrix((x, y, z)).transposed()
    return Matrix.Translation(matrix.to_translation()) @ rotation.to_4x4()


def is_singular(world_from_object: np.ndarray) -> np.ndarray:
    """For matrices (I, 3, 4): whether each flattens space or holds a number that is not finite."""
    linear = world_from_object[:, :, :3].astype(np.float64)
    lengths = np.linalg.norm(linear, axis=1)
    finite = np.isfinite(world_from_object).all(axis=(1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        volume = np.abs(np.linalg.det(linear / lengths[:, None, :]))
    regular = finite & (lengths > SMALLEST_SCALE).all(axis=1) & (volume > SMALLEST_VOLUME)
    return ~regular


def is_without_area(world_from_object: np.ndarray) -> np.ndarray:
    """For matrices (I, 3, 4): whether each maps all of space to a line or a point."""
    x, y, z = np.moveaxis(world_from_object[:, :, :3].astype(np.float64), 2, 0)
    areas = [np.linalg.norm(np.cross(a, b), axis=1) for a, b in ((x, y), (y, z), (z, x))]
    return np.maximum.reduce(areas) < SMALLEST_SCALE**2
