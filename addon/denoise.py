"""OpenImageDenoise through its C interface: arrays in, arrays out.

The library is Blender's own where Blender has one, so that two versions never meet in a process,
and else that of the PyPI wheel pyoidn, which the "full" extension carries.
"""

from __future__ import annotations

import ctypes
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

# oidn.h: OIDN_DEVICE_TYPE_CPU and OIDN_FORMAT_FLOAT3.
CPU_DEVICE = 1
FLOAT3 = 3
_NAMES = {
    "linux": ("libOpenImageDenoise.so.2", "libOpenImageDenoise.so"),
    "darwin": ("libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"),
    "win32": ("OpenImageDenoise.dll",),
}
_POINTER, _SIZE, _TEXT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
_IMAGE = (_POINTER, _TEXT, _POINTER, ctypes.c_int, *[_SIZE] * 5)
# Function: result and arguments.
_FUNCTIONS = {
    "oidnNewDevice": (_POINTER, (ctypes.c_int,)),
    "oidnSetDeviceBool": (None, (_POINTER, _TEXT, ctypes.c_bool)),
    "oidnCommitDevice": (None, (_POINTER,)),
    "oidnGetDeviceError": (ctypes.c_int, (_POINTER, ctypes.POINTER(_TEXT))),
    "oidnNewFilter": (_POINTER, (_POINTER, _TEXT)),
    "oidnSetSharedFilterImage": (None, _IMAGE),
    "oidnSetFilterBool": (None, (_POINTER, _TEXT, ctypes.c_bool)),
    "oidnCommitFilter": (None, (_POINTER,)),
    "oidnExecuteFilter": (None, (_POINTER,)),
    "oidnReleaseFilter": (None, (_POINTER,)),
}


class DenoiseError(Exception):
    """OpenImageDenoise is missing or has failed; the message is for the user."""


def _candidates() -> Iterator[str]:
    """List where the library may be, Blender's own first."""
    names = _NAMES.get(sys.platform, ())
    place = Path(bpy.utils.resource_path("LOCAL")).parent
    for folder in ("lib", "blender.shared"):
        yield from (str(place / folder / name) for name in names)
    found = importlib.util.find_spec("pyoidn")  # Found, not imported: it would want cffi.
    for place in (found.submodule_search_locations or ()) if found else ():
        folder = "bin" if sys.platform == "win32" else "lib"
        yield from (str(Path(place) / "oidn" / folder / name) for name in names)


@cache
def _library() -> ctypes.CDLL:
    for candidate in _candidates():
        if Path(candidate).exists():
            library = ctypes.CDLL(candidate)
            for name, (result, arguments) in _FUNCTIONS.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
            return library
    raise DenoiseError("OpenImageDenoise is not part of this Blender, nor of this extension")


@cache
def _device() -> int:
    device = _library().oidnNewDevice(CPU_DEVICE)
    # To bind its threads to cores it asks Blender's TBB with the tables of its own: in a Blender
    # without denoiser (Debian's 5.2) that crashed.
    _library().oidnSetDeviceBool(device, b"setAffinity", False)
    _library().oidnCommitDevice(device)
    _check(device)
    return device


def _check(device: int) -> None:
    message = _TEXT()
    if _library().oidnGetDeviceError(device, ctypes.byref(message)):
        raise DenoiseError(f"OpenImageDenoise: {(message.value or b'?').decode()}")


def problem() -> str | None:
    """Tell why nothing can be denoised, or None where it can."""
    try:
        _device()
    except (DenoiseError, OSError, AttributeError) as error:
        return str(error)
    return None


def _filter(images: Mapping[str, Floats], **switches: bool) -> Floats:
    """Run OIDN's ray tracing filter over contiguous images (H, W, 3)."""
    library, device = _library(), _device()
    height, width, _ = next(iter(images.values())).shape
    output = np.empty((height, width, 3), np.float32)
    handle = library.oidnNewFilter(device, b"RT")
    try:
        for name, image in {**images, "output": output}.items():
            library.oidnSetSharedFilterImage(
                handle, name.encode(), image.ctypes.data, FLOAT3, width, height, 0, 0, 0
            )
        for name, value in switches.items():
            library.oidnSetFilterBool(handle, name.encode(), value)
        library.oidnCommitFilter(handle)
        library.oidnExecuteFilter(handle)
        _check(device)
    finally:
        library.oidnReleaseFilter(handle)
    return output


def denoise(combined: Floats, albedo: Floats, normal: Floats) -> Floats:
    """Return `combined` without noise.

    The guides are denoised first, as Cycles does with the prefilter Accurate.

    Args:
        combined: scene-linear radiance (H, W, 3), or (H, W, 4) with an alpha that is kept.
        albedo: reflectance (H, W, 3).
        normal: shading normal in world space (H, W, 3).

    Raises:
        DenoiseError: the library is missing or has failed.
    """
    color = np.ascontiguousarray(combined[..., :3], np.float32)
    guides = {
        name: _filter({name: np.ascontiguousarray(image[..., :3], np.float32)})
        for name, image in (("albedo", albedo), ("normal", normal))
    }
    clean = _filter({"color": color, **guides}, hdr=True, cleanAux=True)
    return np.concatenate([clean, combined[..., 3:]], axis=-1)
