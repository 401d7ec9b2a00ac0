"""Pictures made of pictures."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray


def save_png(picture: NDArray[Any], path: Path) -> None:
    """Write display-referred colours (H, W, 3 or 4) as PNG, the lowest row first."""
    height, width, channels = picture.shape
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :channels] = picture
    image: Any = bpy.data.images.new(path.stem, width, height)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
