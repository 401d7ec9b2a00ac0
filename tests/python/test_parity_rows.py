"""Some rows of the parity table, against the stored pictures of Cycles."""

from __future__ import annotations

import bpy
import pytest
from tests.parity import judge
from tests.parity.catalogue import ROWS
from tests.parity.judge import Reference
from tests.parity.rows import Row

# One of each kind that does not depend on the version of Blender.
NAMES = (
    "light: spot, blend 1",
    "light: area, spread 60 degrees",
    "light: no shadow",
    "light: linking: lights the ball alone",
    "light: linking: shadow of all but the ball",
    "light: linking: glow lights the ball alone",
    "light: linking: shadow of a glow by all but the ball",
    "light: node: IES, type C, a quadrant",
    "light: hidden from glossy rays",
    "visibility: collection, holdout",
    "world: Sky Texture, sun towards -X",
    "film: transparent glass, rough",
    "shader: Glass, GGX alone",
    "shader: Glossy, Beckmann",
    "shader: Refraction",
    "shader: None",
    "shader: Toon",
    "texture: Bump, finer than a pixel",
    "texture: Bump, finer than a pixel, Filter Width 1",
    "texture: Ambient Occlusion",
    "texture: Ambient Occlusion, emission",
    "texture: Bevel",
    "shader: Toon, glossy",
    "geometry: hair curves, 3D",
    "geometry: hair particles",
    "geometry: displaced, smooth",
    "geometry: displaced and bumped, flat",
    "geometry: point cloud",
    "motion blur: armature",
    "motion blur: shutter 1.5, at end",
    "shader: sheets, 5, limit 10",
    "texture: Object Info, Random",
    "volume: Scatter, density by a gradient",
    "volume: OpenVDB, blackbody",
)
CHOSEN = [row for row in ROWS if f"{row.group}: {row.name}" in NAMES]

pytestmark = pytest.mark.skipif(
    bpy.app.version < (5, 0, 0), reason="the pictures were made with Blender 5"
)


def test_all_names_are_rows() -> None:
    assert len(CHOSEN) == len(NAMES)


@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.key)
def test_a_feature_agrees_with_cycles(row: Row) -> None:
    """Energy within 1 %, relMSE beyond noise at most 1e-3; seeds are fixed.

    The standard error of the energy is 0.1 to 0.3 %, that of the relMSE 1e-4.
    """
    reference = Reference.load(row)
    assert reference is not None, "its script changed: make parity-references"
    assert judge.outcome(row, reference, with_dual_cone=False).verdict == "agrees"
