"""A small animation to render, and ways to render it and to read the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray


def moving_cube(scene: Any, folder: Path) -> Any:
    """Make five frames, 8 x 6 pixels: a cube rises above a plane, in a grey world.

    They are written as 32-bit floats with all passes to folder/NNNN.exr.
    """
    bpy.ops.mesh.primitive_plane_add(size=10.0)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    assert cube is not None
    for frame, height in ((1, 0.0), (5, 2.0)):
        cube.location.z = height
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.object.camera_add(location=(0.0, -8.0, 2.0), rotation=(1.4, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("Grey")
    scene.frame_start, scene.frame_end = 1, 5
    scene.frame_set(1)
    scene.render.resolution_x, scene.render.resolution_y = 8, 6
    scene.dualcone.frames_together = 3
    scene.render.filepath = f"{folder}/"
    _write(scene, "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER")
    return scene


def write_single_layer(scene: Any) -> None:
    """Write Combined alone, as 32-bit floats."""
    _write(scene, "IMAGE", "OPEN_EXR")


def _write(scene: Any, media_type: str, file_format: str) -> None:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = media_type
    image.file_format = file_format
    image.color_mode = "RGBA"
    image.color_depth = "32"


def animate() -> None:
    """Render the animation as `-a` does."""
    bpy.ops.render.render(animation=True)


def still(scene: Any, frame: int) -> None:
    """Render one frame as F12 does; nothing is written."""
    scene.frame_set(frame)
    bpy.ops.render.render()


def read(path: Path) -> NDArray[np.float32]:
    """Return the floats of an image file, row by row from the bottom up."""
    image: Any = bpy.data.images.load(str(path))
    try:
        pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels
    finally:
        bpy.data.images.remove(image)
