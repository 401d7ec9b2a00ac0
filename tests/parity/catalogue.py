"""All rows of the table."""

from __future__ import annotations

from . import cameras, geometry, lights, materials, motion, visibility, volumes, worlds

ROWS = (
    lights.ROWS
    + worlds.ROWS
    + visibility.ROWS
    + geometry.ROWS
    + materials.ROWS
    + volumes.ROWS
    + cameras.ROWS
    + motion.ROWS
)
