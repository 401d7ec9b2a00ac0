"""The camera: placement, projection, clipping."""

from __future__ import annotations

import bpy
import numpy as np

from .report import ExportError, Warnings
from .transform import matrix_3x4, without_scale


def export_camera(
    depsgraph: bpy.types.Depsgraph, resolution: tuple[int, int], warnings: Warnings
) -> dict[str, np.ndarray]:
    """Arrays `world_from_camera`, `clip_from_camera`, `camera_clip` of the scene's active camera.

    `resolution` is the whole frame in pixels, before any border. Raises ExportError without a
    camera or for a projection other than perspective.
    """
    scene = depsgraph.scene
    if scene.camera is None:
        raise ExportError(
            f"Scene '{scene.name}' has no camera: add one and make it active "
            "(Scene properties, Camera)"
        )
    camera = scene.camera.evaluated_get(depsgraph)
    _check(camera, scene, warnings)
    width, height = resolution
    if width < 1 or height < 1:
        raise ExportError(f"Scene '{scene.name}' has no pixels to render: {width} x {height}")
    clip_from_camera = camera.calc_matrix_camera(
        depsgraph,
        x=width,
        y=height,
        scale_x=scene.render.pixel_aspect_x,
        scale_y=scene.render.pixel_aspect_y,
    )
    placement = without_scale(camera.matrix_world)
    if placement is None:
        raise ExportError(f"Camera '{camera.name}' has a scale of zero: clear its scale")
    return {
        "world_from_camera": matrix_3x4(placement),
        "clip_from_camera": np.array(clip_from_camera, np.float32, order="C"),
        "camera_clip": np.array([camera.data.clip_start, camera.data.clip_end], np.float32),
    }


def _check(camera: bpy.types.Object, scene: bpy.types.Scene, warnings: Warnings) -> None:
    data = camera.data
    if camera.type != "CAMERA" or data.type != "PERSP":
        kind = camera.type if camera.type != "CAMERA" else data.type
        raise ExportError(
            f"Camera '{camera.name}' is of type {kind.title()}: only perspective cameras are "
            "rendered yet (Camera properties, Lens, Type)"
        )
    if data.dof.use_dof:
        warnings.not_rendered(camera.name, "Depth of field")
    if scene.render.use_motion_blur:
        warnings.not_rendered(scene.name, "Motion blur")
    if scene.render.use_multiview:
        warnings.not_rendered(scene.name, "Stereoscopy")
