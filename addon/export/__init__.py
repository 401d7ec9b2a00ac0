"""From Blender's evaluated scene to the arrays of the renderer's contract.

`export_frame` is the only way in. Nothing here changes the user's data or the current frame.
"""

from .cache import ExportCache
from .frame import ExportedFrame, export_frame
from .report import ExportError, ExportStopped, Warnings

__all__ = [
    "ExportCache",
    "ExportError",
    "ExportStopped",
    "ExportedFrame",
    "Warnings",
    "export_frame",
]
