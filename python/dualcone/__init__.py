"""The renderer behind the DualCone extension for Blender."""

from dualcone._core import (
    Image,
    Mesh,
    Render,
    SceneFrame,
    __version__,
    contract,
    window_frames,
)

__all__ = [
    "Image",
    "Mesh",
    "Render",
    "SceneFrame",
    "__version__",
    "contract",
    "window_frames",
]
