"""The README's pictures: a room in PATH and in DUAL_CONE, and a strip of the wheel loader's frames.

python scripts/readme_pictures.py [--samples 16] [--out docs/images]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy  # noqa: F401  first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

from measure import Sample, save_picture

ROOT = Path(__file__).resolve().parent.parent
GAP = 6  # white pixels between pictures
ROOM_SIZE, ROOM_FRAME = (450, 300), 40
STRIP_SIZE, STRIP_FRAMES = (300, 200), (2, 24, 46)


def side_by_side(pictures: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Put pictures (H, W, 3) of one height next to each other."""
    gap = np.ones((pictures[0].shape[0], GAP, 3))
    parts = [part for picture in pictures for part in (gap, picture)]
    return np.concatenate(parts[1:], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description="Render the README's pictures.")
    parser.add_argument("--samples", type=int, default=16, help="per pixel and frame")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    arguments = parser.parse_args()

    room = Sample("indoor")
    settings = {"samples": arguments.samples}
    methods = ({"method": "PATH"}, {"method": "DUAL_CONE", "window": 5})
    pair = [
        room.render([ROOM_FRAME], ROOM_SIZE, {**settings, **method}).pictures[0]
        for method in methods
    ]
    save_picture(side_by_side(pair), arguments.out / "readme-room.jpg")

    loader = Sample("loader")
    strip = [
        loader.render([frame], STRIP_SIZE, {**settings, "method": "DUAL_CONE"}).pictures[0]
        for frame in STRIP_FRAMES
    ]
    save_picture(side_by_side(strip), arguments.out / "readme-loader.jpg")


if __name__ == "__main__":
    main()
