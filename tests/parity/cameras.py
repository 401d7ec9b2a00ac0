"""Cameras and film."""

from __future__ import annotations

from typing import Any

import bpy

from .rows import table
from .stage import Stage, give, set_known, shade


def camera(stage: Stage, **values: Any) -> None:
    """Camera data; projections of Cycles' own have the names of its settings."""
    data = stage.camera.data
    for name, value in values.items():
        setattr(data if hasattr(data, name) else data.cycles, name, value)


def focus(stage: Stage, **values: Any) -> None:
    """A wide aperture, focused on the ball."""
    dof = stage.camera.data.dof
    dof.use_dof, dof.focus_distance = True, 6.0
    dof.aperture_fstop = 0.1
    for name, value in values.items():
        setattr(dof, name, value)


def border(stage: Stage) -> None:
    render = stage.scene.render
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.25, 0.75


def aspect(stage: Stage) -> None:
    stage.scene.render.pixel_aspect_x = 1.5
    stage.camera.data.sensor_fit = "VERTICAL"


def pixel_filter(stage: Stage, kind: str, width: float) -> None:
    set_known(stage.scene.cycles, pixel_filter_type=kind, filter_width=width)
    set_known(getattr(stage.scene, "dualcone", None), filter=kind, filter_width=width)


def exposure(stage: Stage) -> None:
    stage.scene.cycles.film_exposure = 2.0
    set_known(getattr(stage.scene, "dualcone", None), film_exposure=2.0, exposure=2.0)


def transparent_glass(stage: Stage, roughness: float = 0.0, threshold: float = 0.1) -> None:
    stage.scene.render.film_transparent = True
    cycles = stage.scene.cycles
    cycles.film_transparent_glass, cycles.film_transparent_roughness = True, threshold
    material = bpy.data.materials.new("Glass")
    give(stage.ball, shade(material, "ShaderNodeBsdfGlass", Roughness=roughness, IOR=1.45))
    stage.lamp.data.size = 5.0


CAMERAS = table(
    "camera",
    ("perspective, shifted", camera, {"shift_x": 0.2, "shift_y": -0.1}),
    ("perspective, wide", camera, {"lens": 15.0}),
    ("perspective, clipped", camera, {"clip_start": 6.5, "clip_end": 9.0}),
    ("orthographic", camera, {"type": "ORTHO", "ortho_scale": 6.0}),
    ("equirectangular", camera, {"type": "PANO", "panorama_type": "EQUIRECTANGULAR"}),
    ("fisheye, equidistant", camera, {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": 2.0}),
    ("fisheye, equisolid", camera, {"type": "PANO", "panorama_type": "FISHEYE_EQUISOLID"}),
    ("mirror ball", camera, {"type": "PANO", "panorama_type": "MIRRORBALL"}),
    ("depth of field", focus),
    ("depth of field, 5 blades", focus, {"aperture_blades": 5, "aperture_rotation": 0.3}),
    ("depth of field, ratio 2", focus, {"aperture_ratio": 2.0}),
    ("border", border),
    ("pixel aspect", aspect),
)  # fmt: skip

FILM = table(
    "film",
    ("box filter", pixel_filter, {"kind": "BOX", "width": 1.5}),
    ("Gaussian filter, 3 pixels", pixel_filter, {"kind": "GAUSSIAN", "width": 3.0}),
    ("Blackman-Harris filter, 2 pixels", pixel_filter, {"kind": "BLACKMAN_HARRIS", "width": 2.0}),
    ("exposure 2", exposure),
    ("transparent glass", transparent_glass),
    ("transparent glass, rough", transparent_glass, {"roughness": 0.3, "threshold": 0.4}),
    ("transparent glass, too rough", transparent_glass, {"roughness": 0.3}),
)

ROWS = CAMERAS + FILM
