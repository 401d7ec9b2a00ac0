"""The camera: placement, projection or panorama, aperture, clipping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from .report import ExportError, Warnings
from .transform import matrix_3x4, without_scale

# Entries of `camera_panorama`: the shift, then what the kind needs.
PANORAMA_ENTRIES = 10
# Sharp everywhere: `camera_lens` without depth of field.
PINHOLE = (0.0, 1.0, 0.0, 0.0, 1.0)


def export_camera(
    depsgraph: bpy.types.Depsgraph, resolution: tuple[int, int], warnings: Warnings
) -> dict[str, np.ndarray]:
    """Arrays whose names begin with `camera_`, and the two matrices, of the scene's active camera.

    `resolution` is the whole frame in pixels, before any border. Raises ExportError without a
    camera or for one that is not rendered.
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
    matrices = camera_matrices(camera, depsgraph, resolution)
    render = scene.render
    aspect = (width * render.pixel_aspect_x) / (height * render.pixel_aspect_y)
    kind, panorama = _panorama(camera.data, aspect)
    return {
        **matrices,
        "camera_clip": np.array([camera.data.clip_start, camera.data.clip_end], np.float32),
        "camera_frame_width": np.array(width, np.uint32),
        "camera_kind": np.array(kind, np.uint32),
        "camera_panorama": panorama,
        "camera_lens": np.array(_lens(camera, depsgraph), np.float32),
    }


def camera_matrices(
    camera: bpy.types.Object, depsgraph: bpy.types.Depsgraph, resolution: tuple[int, int]
) -> dict[str, np.ndarray]:
    """`world_from_camera` and `clip_from_camera` of an evaluated camera. Raises ExportError."""
    render = depsgraph.scene.render
    width, height = resolution
    clip_from_camera = camera.calc_matrix_camera(
        depsgraph,
        x=width,
        y=height,
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    placement = without_scale(camera.matrix_world)
    if placement is None:
        raise ExportError(f"Camera '{camera.name}' has a scale of zero: clear its scale")
    return {
        "world_from_camera": matrix_3x4(placement),
        "clip_from_camera": np.array(clip_from_camera, np.float32, order="C"),
    }


def _check(camera: bpy.types.Object, scene: bpy.types.Scene, warnings: Warnings) -> None:
    data = camera.data
    if camera.type != "CAMERA" or data.type not in {"PERSP", "ORTHO", "PANO"}:
        kind = camera.type if camera.type != "CAMERA" else data.type
        raise ExportError(
            f"Camera '{camera.name}' is of type {kind.title()}: only perspective, orthographic and "
            "panoramic cameras are rendered (Camera properties, Lens, Type)"
        )
    if scene.render.use_multiview:
        warnings.not_rendered(scene.name, "Stereoscopy")


def _lens(camera: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[float, ...]:
    """`camera_lens`: radius of the aperture [m], focus distance [m], blades, rotation, ratio."""
    data = camera.data
    dof = data.dof
    if not dof.use_dof:
        return PINHOLE
    # An orthographic camera has no focal length: Cycles takes a metre for it.
    focal_length = 1.0 if data.type == "ORTHO" else 1e-3 * data.lens
    radius = focal_length / (2.0 * max(dof.aperture_fstop, 1e-5))
    distance = dof.focus_distance
    if dof.focus_object is not None:
        distance = _distance_to(dof, camera.matrix_world, depsgraph)
    blades = float(dof.aperture_blades)
    # At the camera itself nothing is in focus; the renderer wants a distance.
    return radius, max(distance, 1e-5), blades, dof.aperture_rotation, dof.aperture_ratio


def _distance_to(
    dof: bpy.types.CameraDOFSettings, placement: Any, depsgraph: bpy.types.Depsgraph
) -> float:
    """Distance [m] of the focus object, or of its bone, along the viewing axis."""
    focus = dof.focus_object.evaluated_get(depsgraph)
    matrix = focus.matrix_world
    bone = focus.pose.bones.get(dof.focus_subtarget) if focus.pose else None
    if bone is not None:
        matrix = matrix @ bone.matrix
    offset = placement.to_translation() - matrix.to_translation()
    return abs(placement.col[2].to_3d().normalized().dot(offset))


def _panorama(data: bpy.types.Camera, aspect: float) -> tuple[int, np.ndarray]:
    """`camera_kind` and `camera_panorama` of a camera whose frame has this width over height."""
    entries = np.zeros(PANORAMA_ENTRIES, np.float32)
    if data.type != "PANO":
        return 0, entries
    # Until Blender 5.0 the settings of panoramas belonged to Cycles.
    settings: Any = data if hasattr(data, "panorama_type") else getattr(data, "cycles", None)
    if settings is None:
        raise ExportError(
            f"Camera '{data.name}' is panoramic, and its settings belong to Cycles: enable the "
            "Cycles add-on"
        )
    kind, values = PANORAMAS.get(settings.panorama_type, (0, None))
    if values is None:
        raise ExportError(
            f"Camera '{data.name}' has the panorama {settings.panorama_type.title()}, which is not "
            "rendered yet (Camera properties, Lens, Panorama Type)"
        )
    entries[:2] = data.shift_x, data.shift_y
    given = values(settings, _sensor(data, aspect))
    entries[2 : 2 + len(given)] = given
    return kind, entries


def _sensor(data: bpy.types.Camera, aspect: float) -> tuple[float, float]:
    """Width and height [mm] of the sensor that the frame covers, by Blender's sensor fit."""
    if data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and aspect > 1.0):
        return data.sensor_width, data.sensor_width / aspect
    size = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    return size * aspect, size


def _equirectangular(s: Any, _sensor: tuple[float, float]) -> tuple[float, ...]:
    return s.longitude_min, s.longitude_max, s.latitude_min, s.latitude_max


def _polynomial(s: Any, sensor: tuple[float, float]) -> tuple[float, ...]:
    coefficients = (getattr(s, f"fisheye_polynomial_k{power}") for power in range(5))
    return s.fisheye_fov, *sensor, *coefficients


def _cylindrical(s: Any, _sensor: tuple[float, float]) -> tuple[float, ...]:
    radius = s.central_cylindrical_radius
    return (
        s.central_cylindrical_range_u_min,
        s.central_cylindrical_range_u_max,
        s.central_cylindrical_range_v_min / radius,
        s.central_cylindrical_range_v_max / radius,
    )


# Blender's panorama types: `camera_kind`, and what makes the entries of `camera_panorama`.
Entries = Callable[[Any, tuple[float, float]], tuple[float, ...]]
PANORAMAS: dict[str, tuple[int, Entries]] = {
    "EQUIRECTANGULAR": (1, _equirectangular),
    "FISHEYE_EQUIDISTANT": (2, lambda s, _: (s.fisheye_fov,)),
    "FISHEYE_EQUISOLID": (3, lambda s, sensor: (s.fisheye_fov, s.fisheye_lens, *sensor)),
    "FISHEYE_LENS_POLYNOMIAL": (4, _polynomial),
    "MIRRORBALL": (5, lambda _s, _: ()),
    "EQUIANGULAR_CUBEMAP_FACE": (6, lambda _s, _: ()),
    "CENTRAL_CYLINDRICAL": (7, _cylindrical),
}
