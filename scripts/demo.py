"""Render some frames of a sample animation and put them side by side.

python scripts/demo.py [--sample loader] [--frames 12] [--out out/demo]
"""

import argparse
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import bpy  # first: it brings its own numpy settings and libraries
import numpy as np
from numpy.typing import NDArray

import local_addon
from pictures import save_png

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = 3
GAP = 4  # pixels between the pictures of the sheet


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Render a sample animation.")
    parser.add_argument("--sample", default="loader", help="name of a .blend in blend_samples")
    parser.add_argument("--start", type=int, help="first frame, else the sample's own")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--width", type=int, default=480, help="pixels; the shape is the sample's")
    parser.add_argument("--samples", type=int, default=8, help="per pixel and frame")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "demo")
    return parser.parse_args()


def render(arguments: argparse.Namespace, folder: Path) -> list[Path]:
    """Render the animation as PNG files into an empty folder and return them in order."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "blend_samples" / f"{arguments.sample}.blend"))
    scene: Any = bpy.context.scene  # Any: the stubs of bpy do not know scene.dualcone
    scene.render.engine = "DUALCONE"
    scene.dualcone.samples = arguments.samples
    scene.render.resolution_percentage = 100
    height = scene.render.resolution_y * arguments.width / scene.render.resolution_x
    scene.render.resolution_x, scene.render.resolution_y = arguments.width, round(height)
    scene.frame_start = arguments.start or scene.frame_start
    scene.frame_end = scene.frame_start + arguments.frames - 1
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "PNG"
    scene.render.filepath = str(folder / "####")
    bpy.ops.render.render(animation=True)
    return sorted(folder.glob("*.png"))


def read_picture(path: Path) -> NDArray[np.float32]:
    """Return the pixels of a file, (H, W, 4), the lowest row first."""
    image: Any = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)


def write_sheet(pictures: list[NDArray[np.float32]], path: Path) -> None:
    """Write all pictures into one, row by row from the top left."""
    height, width, _ = pictures[0].shape
    rows = -(-len(pictures) // COLUMNS)
    size = (rows * (height + GAP) - GAP, COLUMNS * (width + GAP) - GAP, 4)
    sheet = np.ones(size, np.float32)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, COLUMNS)
        bottom = (rows - 1 - row) * (height + GAP)
        left = column * (width + GAP)
        sheet[bottom : bottom + height, left : left + width] = picture
    save_png(sheet, path)


def main() -> None:
    """Render, then show where the pictures are."""
    arguments = parse_arguments()
    folder = arguments.out.resolve() / "frames"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    started = time.perf_counter()
    with local_addon.registered():
        files = render(arguments, folder)
    if len(files) != arguments.frames:
        sys.exit(f"{len(files)} of {arguments.frames} frames were written, the log above says why")
    sheet = folder.parent / "contact-sheet.png"
    write_sheet([read_picture(path) for path in files], sheet)
    print(f"{len(files)} frames in {time.perf_counter() - started:.0f} s: {folder}")
    print(f"side by side: {sheet}")


if __name__ == "__main__":
    main()
