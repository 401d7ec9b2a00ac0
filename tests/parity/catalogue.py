"""All rows of the table."""

from __future__ import annotations

from . import cameras, geometry, hair, lights, materials, motion, visibility, volumes, worlds

ROWS = (
    lights.ROWS
    + worlds.ROWS
    + visibility.ROWS
    + geometry.ROWS
    + hair.ROWS
    + materials.ROWS
    + volumes.ROWS
    + cameras.ROWS
    + motion.ROWS
)
