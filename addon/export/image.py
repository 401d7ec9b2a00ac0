"""Images as RGBA, rows from the bottom up: bytes stay bytes, all else is scene-linear float32."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Color

from .cache import CachedImage, ExportCache
from .report import Warnings

MAGENTA = (1.0, 0.0, 1.0, 1.0)

# Linear spaces that Blender can convert: the method of mathutils.Color that does it.
LINEAR_SPACES = {
    "Linear Rec.709": "from_rec709_linear_to_scene_linear",
    "Linear": "from_rec709_linear_to_scene_linear",
    "Linear Rec.2020": "from_rec2020_linear_to_scene_linear",
    "Linear CIE-XYZ D65": "from_xyz_d65_to_scene_linear",
    "ACES2065-1": "from_aces_to_scene_linear",
    "ACEScg": "from_acescg_to_scene_linear",
}
DATA_SPACES = ("Non-Color", "Raw", "Generic Data")


@dataclass(frozen=True)
class ImageUse:
    """How a texture node uses an image."""

    image: bpy.types.Image
    extension: str = "REPEAT"
    interpolation: str = "Linear"
    # Colours are multiplied by alpha unless the alpha of the node is used as well.
    multiply_alpha: bool = False


@dataclass(frozen=True)
class Texels:
    """What the renderer is given: colours (H, W, 4), and what their numbers mean."""

    pixels: np.ndarray
    # LINEAR, or what fits 8 bits: BYTE and SRGB.
    encoding: str = "LINEAR"
    # Whether colours are to be divided by alpha behind the filter.
    divides_alpha: bool = False


class ImageTable:
    """The images of one frame, each once, in the order of their first use."""

    def __init__(self, cache: ExportCache, core: Any, warnings: Warnings) -> None:
        self._cache = cache
        self._core = core
        self._warnings = warnings
        self._rows: dict[tuple, int] = {}
        self.used: list[CachedImage] = []

    def index(self, use: ImageUse) -> int:
        """Row of the image in the frame's list."""
        key = _key(use)
        if key not in self._rows:
            self._rows[key] = len(self.used)
            self.used.append(self._load(use, key))
        return self._rows[key]

    def index_of_pixels(self, pixels: np.ndarray) -> int:
        """Row of an image (H, W, 4) that is none of Blender's."""
        digest = hashlib.blake2b(pixels, digest_size=16).digest()
        key = ("pixels", digest)
        if key not in self._rows:
            if key not in self._cache.images:
                handle = self._core.Image(pixels, "REPEAT", "Linear")
                self._cache.images[key] = CachedImage(handle, digest)
                self._cache.statistics.images_built += 1
            self._rows[key] = len(self.used)
            self.used.append(self._cache.images[key])
        return self._rows[key]

    def _load(self, use: ImageUse, key: tuple) -> CachedImage:
        _warn(use.image, self._warnings)
        if key not in self._cache.images:
            texels = read_texels(use, self._warnings)
            how = (use.extension, use.interpolation, texels.encoding, texels.divides_alpha)
            handle = self._core.Image(texels.pixels, *how)
            digest = hashlib.blake2b(repr(how).encode(), digest_size=16)
            digest.update(texels.pixels)
            self._cache.images[key] = CachedImage(handle, digest.digest())
            self._cache.statistics.images_built += 1
        image = self._cache.images[key]
        if count := image.handle.replaced_texels:
            self._warnings.add(use.image.name, f"{count} texels are not numbers and are black")
        return image


def read_texels(use: ImageUse, warnings: Warnings) -> Texels:
    """What Cycles holds of an image; one magenta pixel if there are none."""
    image = use.image
    width, height = image.size  # makes Blender load the file
    if width * height == 0:
        return Texels(np.full((1, 1, 4), MAGENTA, np.float32))
    pixels = np.empty((height, width, 4), np.float32)
    _read_rgba(image, pixels)
    if image.alpha_mode == "NONE":
        pixels[..., 3] = 1.0
    apart = image.alpha_mode in ("NONE", "CHANNEL_PACKED") or _is_data(image)
    if image.is_float:
        encoding = "LINEAR"  # Blender converted and multiplied when it loaded the file
    else:
        encoding = _decode(image, pixels, warnings)
        if not apart:
            _multiply_alpha(pixels, in_bytes=encoding == "SRGB")
    return Texels(pixels, encoding, not apart and not use.multiply_alpha)


def _read_rgba(image: bpy.types.Image, pixels: np.ndarray) -> None:
    channels = image.channels
    if channels == 4:
        image.pixels.foreach_get(pixels.reshape(-1))
        return
    raw = np.empty((*pixels.shape[:2], channels), np.float32)
    image.pixels.foreach_get(raw.reshape(-1))
    pixels[..., 3] = 1.0
    pixels[..., :3] = raw if channels == 3 else raw[..., :1]


def _multiply_alpha(pixels: np.ndarray, in_bytes: bool) -> None:
    """Multiply colours by alpha; bytes are rounded down, as Cycles does."""
    color, alpha = pixels[..., :3], pixels[..., 3:]
    color *= alpha
    if in_bytes:
        # The products of two bytes over 255 that are whole must not fall below themselves.
        np.floor(color * 255.0 + 1e-3, out=color)
        color /= 255.0


def _is_data(image: bpy.types.Image) -> bool:
    """Whether the channels are numbers, that no colour management and no alpha touches."""
    settings = image.colorspace_settings
    return settings.is_data or settings.name in DATA_SPACES


def _decode(image: bpy.types.Image, pixels: np.ndarray, warnings: Warnings) -> str:
    """Convert bytes from the image's own space where they do not stay bytes; say what they are."""
    space = image.colorspace_settings.name
    if _is_data(image):
        return "BYTE"
    if space in LINEAR_SPACES and hasattr(Color, LINEAR_SPACES[space]):
        _apply_matrix(pixels, LINEAR_SPACES[space])
        return "LINEAR"
    if space != "sRGB":
        warnings.add(image.name, f"colour space {space} is not known, its colours are read as sRGB")
    if _is_identity(_scene_from_space(LINEAR_SPACES["Linear Rec.709"])):
        return "SRGB"
    # 256 possible values: a table is ten times faster than the power function.
    codes = np.rint(pixels[..., :3] * 255.0).astype(np.uint8)
    pixels[..., :3] = srgb_to_linear(np.arange(256, dtype=np.float32) / 255.0)[codes]
    _apply_matrix(pixels, LINEAR_SPACES["Linear Rec.709"])
    return "LINEAR"


def _apply_matrix(pixels: np.ndarray, method: str) -> None:
    """Convert the primaries as Blender's colour management does."""
    scene_from_space = _scene_from_space(method)
    if not _is_identity(scene_from_space):
        pixels[..., :3] = pixels[..., :3] @ scene_from_space.T


def _scene_from_space(method: str) -> np.ndarray:
    """The matrix (3, 3) of a conversion, by what it does to the axes."""
    axes = [getattr(Color(axis), method)()[:] for axis in np.eye(3).tolist()]
    return np.array(axes, np.float32).T


def _is_identity(matrix: np.ndarray) -> bool:
    return np.allclose(matrix, np.eye(3), atol=1e-5)


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, per channel."""
    low = encoded / 12.92
    high = ((encoded + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(np.float32)


def _key(use: ImageUse) -> tuple:
    """Changes whenever the pixels would: the image, its file's stamp, and how it is read."""
    image = use.image
    path = bpy.path.abspath(image.filepath, library=image.library)
    try:
        stat = os.stat(path)
        stamp = (stat.st_mtime_ns, stat.st_size)
    except OSError:
        stamp = None
    generated = ()
    if image.source == "GENERATED":
        generated = (image.generated_type, image.generated_color[:], image.size[:])
    return (
        image.session_uid,
        use.extension,
        use.interpolation,
        use.multiply_alpha,
        path,
        stamp,
        generated,
        image.colorspace_settings.name,
        image.alpha_mode,
        image.source,
        image.is_dirty,
    )


def _warn(image: bpy.types.Image, warnings: Warnings) -> None:
    if image.size[0] * image.size[1] == 0:
        where = image.filepath or "no file"
        warnings.add(image.name, f"image cannot be read ({where}), magenta is shown instead")
    if image.source in ("SEQUENCE", "MOVIE"):
        warnings.add(image.name, "image sequences and movies stay at one frame")
    if image.source == "TILED":
        warnings.add(image.name, "only the first UDIM tile is rendered")
