"""Images as RGBA, rows from the bottom up: bytes stay bytes, all else is scene-linear float32."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Color

from .cache import CachedImage, ExportCache
from .report import Warnings

MAGENTA = (1.0, 0.0, 1.0, 1.0)
# Number of the first UDIM tile.
FIRST_TILE = 1001

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
class Timing:
    """When a sequence shows which frame: Blender's settings of the same names."""

    duration: int
    start: int
    offset: int
    is_cyclic: bool

    @staticmethod
    def of(image: bpy.types.Image, user: bpy.types.ImageUser) -> Timing | None:
        """Read a texture's settings; None for what is no sequence."""
        if image.source != "SEQUENCE":
            return None
        return Timing(user.frame_duration, user.frame_start, user.frame_offset, user.use_cyclic)

    def number(self, frame: int) -> int:
        """Number in the name of the file that is shown at a frame of the scene."""
        if self.duration == 0:
            return 0
        shown = frame - self.start + 1
        if self.is_cyclic:
            shown = (shown - 1) % self.duration + 1
        return min(max(shown, 0), self.duration) + self.offset


@dataclass(frozen=True)
class ImageUse:
    """How a texture node uses an image."""

    image: bpy.types.Image
    extension: str = "REPEAT"
    interpolation: str = "Linear"
    # Of a sequence: which of its frames is shown when.
    timing: Timing | None = None
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

    def __init__(self, cache: ExportCache, core: Any, warnings: Warnings, frame: int) -> None:
        self._frame = frame
        self._cache = cache
        self._core = core
        self._warnings = warnings
        self._rows: dict[tuple, int] = {}
        self.used: list[CachedImage] = []

    def index(self, use: ImageUse) -> int:
        """Row of the image in the frame's list."""
        key = _key(use, self._frame)
        if key not in self._rows:
            self._rows[key] = len(self.used)
            self.used.append(self._load(use, key))
            self._cache.keep_image(key)
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
            self._cache.images[key] = self._made(use)
            self._cache.statistics.images_built += 1
        image = self._cache.images[key]
        if count := image.handle.replaced_texels:
            self._warnings.add(use.image.name, f"{count} texels are not numbers and are black")
        return image

    def _made(self, use: ImageUse) -> CachedImage:
        files = _files(use, self._frame)
        if not files:
            return self._made_of(use, use.image)
        parts = []
        for number, path in files.items():
            with _loaded(path, use.image) as image:
                if image is None:
                    self._warnings.add(use.image.name, f"image cannot be read ({path})")
                else:
                    parts.append((number, self._made_of(use, image)))
        if use.image.source != "TILED":
            return parts[0][1] if parts else self._made_of(use, None)
        handle = self._core.Image.tiled([(number, part.handle) for number, part in parts])
        digest = hashlib.blake2b(repr([*files]).encode(), digest_size=16)
        for _, part in parts:
            digest.update(part.digest)
        return CachedImage(handle, digest.digest())

    def _made_of(self, use: ImageUse, image: bpy.types.Image | None) -> CachedImage:
        texels = read_texels(use, image, self._warnings)
        how = (use.extension, use.interpolation, texels.encoding, texels.divides_alpha)
        digest = hashlib.blake2b(repr(how).encode(), digest_size=16)
        digest.update(texels.pixels)
        return CachedImage(self._core.Image(texels.pixels, *how), digest.digest())


def _files(use: ImageUse, frame: int) -> dict[int, str]:
    """The files of tiles by their numbers, or that of the frame of a sequence; else none."""
    image = use.image
    if use.timing is not None:
        return {0: _absolute(image, numbered(image.filepath, use.timing.number(frame)))}
    if image.source != "TILED":
        return {}
    return {tile.number: _tile_path(image, tile.number) for tile in image.tiles}


def numbered(path: str, number: int) -> str:
    """The path of another frame of a sequence: the last digits of the file's name count."""
    name = re.search(r"[^/\\]*$", path)
    digits = list(re.finditer(r"\d+", name.group().rpartition(".")[0])) if name else []
    if not name or not digits:
        return path
    start, end = (name.start() + place for place in digits[-1].span())
    return f"{path[:start]}{number:0{end - start}}{path[end:]}"


def _tile_path(image: bpy.types.Image, number: int) -> str:
    column, row = (number - FIRST_TILE) % 10 + 1, (number - FIRST_TILE) // 10 + 1
    path = image.filepath.replace("<UDIM>", str(number))
    return _absolute(image, path.replace("<UVTILE>", f"u{column}_v{row}"))


def _absolute(image: bpy.types.Image, path: str) -> str:
    return bpy.path.abspath(path, library=image.library)


@contextmanager
def _loaded(path: str, like: bpy.types.Image) -> Iterator[bpy.types.Image | None]:
    """A file as an image of its own, to be read as another one says; None where it cannot be."""
    try:
        image = bpy.data.images.load(path)
    except RuntimeError:
        yield None
        return
    try:
        image.colorspace_settings.name = like.colorspace_settings.name
        image.alpha_mode = like.alpha_mode
        yield image
    finally:
        bpy.data.images.remove(image)


def read_texels(use: ImageUse, image: bpy.types.Image | None, warnings: Warnings) -> Texels:
    """What Cycles holds of an image; one magenta pixel if there are none."""
    width, height = image.size if image else (0, 0)  # makes Blender load the file
    if image is None or width * height == 0:
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


def _key(use: ImageUse, frame: int) -> tuple:
    """Changes whenever the pixels would: the image, its file's stamp, and how it is read."""
    image = use.image
    paths = tuple(_files(use, frame).values()) or (_absolute(image, image.filepath),)
    generated = ()
    if image.source == "GENERATED":
        generated = (image.generated_type, image.generated_color[:], image.size[:])
    return (
        image.session_uid,
        use.extension,
        use.interpolation,
        use.multiply_alpha,
        paths,
        tuple(_stamp(path) for path in paths),
        generated,
        image.colorspace_settings.name,
        image.alpha_mode,
        image.source,
        image.is_dirty,
    )


def _stamp(path: str) -> tuple[int, int] | None:
    """Changes when the file does."""
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return (stat.st_mtime_ns, stat.st_size)


def _warn(image: bpy.types.Image, warnings: Warnings) -> None:
    if image.source == "MOVIE":
        warnings.add(image.name, "movies stay at one frame")
    if image.source not in ("TILED", "SEQUENCE") and image.size[0] * image.size[1] == 0:
        where = image.filepath or "no file"
        warnings.add(image.name, f"image cannot be read ({where}), magenta is shown instead")
