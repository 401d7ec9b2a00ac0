"""Reads what Blender writes: OpenEXR files of one part, in lines, without compression.

After "The OpenEXR File Layout" (openexr.com). Blender itself hands out no pixels of files with
several layers.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = 20000630
# Pixel types by their numbers in the file.
TYPES = (np.dtype("<u4"), np.dtype("<f2"), np.dtype("<f4"))


@dataclass
class Exr:
    """A file: its metadata, and pixels (H, W) of each channel, rows from the bottom up."""

    metadata: dict[str, str]
    channels: dict[str, NDArray[np.float32]]

    def layer(self, name: str) -> NDArray[np.float32]:
        """Return the channels (H, W, n) of a pass, in Blender's order, whatever its view layer."""
        found = {}
        for channel, pixels in self.channels.items():
            prefix, _, letter = channel.rpartition(".")
            if prefix == name or prefix.endswith(f".{name}"):
                found[letter] = pixels
        letters = sorted(found, key="XYZWUVRGBArgba".index)
        return np.stack([found[letter] for letter in letters], axis=-1)

    def layers(self) -> set[str]:
        """Return the names of all passes."""
        return {channel.split(".")[-2] for channel in self.channels if "." in channel}


def write_all_passes(scene: Any, folder: Path) -> None:
    """Let a scene write files that `read_exr` reads, to folder/NNNN.exr."""
    scene.render.filepath = f"{folder}/"
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"
    image.exr_codec = "NONE"
    if hasattr(image, "use_exr_interleave"):
        image.use_exr_interleave = True


def read_exr(path: Path) -> Exr:
    """Read a file. Raises ValueError for one that is not of the simple kind."""
    data = path.read_bytes()
    magic, version = struct.unpack_from("<II", data)
    if magic != MAGIC or version & 0x1A00:
        raise ValueError(f"{path} is not a file of one part in lines: version {version:x}")
    attributes, start = _header(data)
    if attributes["compression"] != b"\0":
        raise ValueError(f"{path} is compressed")
    x_min, y_min, x_max, y_max = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x_max - x_min + 1, y_max - y_min + 1
    names = list(_channels(attributes["channels"]))
    line = np.dtype([(name, TYPES[kind], (width,)) for name, kind in names])
    rows = np.empty(height, line)
    for offset in struct.unpack_from(f"<{height}Q", data, start):
        y = struct.unpack_from("<i", data, offset)[0]
        rows[height - 1 - (y - y_min)] = np.frombuffer(data, line, 1, offset + 8)[0]
    metadata = {
        name: value.decode(errors="replace")
        for name, value in attributes.items()
        if name not in ("channels", "compression", "dataWindow")
    }
    return Exr(metadata, {name: rows[name].astype(np.float32) for name, _ in names})


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    """Attributes by name, and where the header ends."""
    attributes = {}
    at = 8
    while data[at]:
        name, at = _word(data, at)
        _, at = _word(data, at)
        size = struct.unpack_from("<i", data, at)[0]
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _word(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def _channels(data: bytes) -> Any:
    at = 0
    while data[at]:
        name, at = _word(data, at)
        yield name, struct.unpack_from("<i", data, at)[0]
        at += 16
