"""The renderer behind the DualCone extension: numpy arrays in, numpy arrays out.

`contract()` lists every array and every setting that may be handed over, with shapes, units and
spaces. A `Mesh` or `Image` is checked once and then shared by all frames that show it; a
`SceneFrame` is one frame of the animation; a `Render` works in the background and is polled.
"""

from .dualcone import (
    Grid,
    Image,
    Mesh,
    Render,
    SceneFrame,
    __version__,
    contract,
    operations,
    window_frames,
)

__all__ = [
    "Grid",
    "Image",
    "Mesh",
    "Render",
    "SceneFrame",
    "__version__",
    "contract",
    "operations",
    "window_frames",
]
