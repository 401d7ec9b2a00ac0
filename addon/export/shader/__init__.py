"""Compiles node graphs to the renderer's programs; see `src/shader/` for what runs them."""

from .closures import compile_surface
from .compiler import Compiler
from .layers import ACTIVE_UV, layer_key
from .program import Operations, Program, Programs
from .volumes import compile_volume, default_volume

__all__ = [
    "ACTIVE_UV",
    "Compiler",
    "Operations",
    "Program",
    "Programs",
    "compile_surface",
    "compile_volume",
    "default_volume",
    "layer_key",
]
