"""All rows of the table."""

from __future__ import annotations

from . import cameras, geometry, lights, materials, motion, visibility, worlds

ROWS = (
    lights.ROWS
    + worlds.ROWS
    + visibility.ROWS
    + geometry.ROWS
    + materials.ROWS
    + cameras.ROWS
    + motion.ROWS
)
