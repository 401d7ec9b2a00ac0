"""A user's way: install the zip, render a sample from the command line, look at the files."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from conftest import ROOT, Blender
from numpy.typing import NDArray

SAMPLE = ROOT / "blend_samples" / "loader.blend"
# Blender's Bevel, which `loader` uses, gives texture coordinates other last bits in each process.
SAMPLE_WITHOUT_BEVEL = ROOT / "blend_samples" / "figure.blend"

# Small, and as 32-bit floats: what is compared is what was rendered, not what a PNG kept of it.
SMALL_FLOATS = """
import bpy
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = 96, 64
scene.render.resolution_percentage = 100
scene.dualcone.samples = 4
image = scene.render.image_settings
if hasattr(image, "media_type"):
    image.media_type = "IMAGE"
image.file_format = "OPEN_EXR"
image.color_mode = "RGBA"
image.color_depth = "32"
"""


def read_pixels(path: Path) -> NDArray[np.float32]:
    """Return the (height * width * 4,) floats of an image file."""
    image: Any = bpy.data.images.load(str(path))  # its stub calls `pixels` one float
    pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels


def render(blender: Blender, folder: Path, *what: object, original: Path = SAMPLE) -> list[Path]:
    """Render a sample into `folder` and return the files, sorted by name."""
    folder.mkdir()
    # the copy lies in the folder above: textures beside the sample are packed or not needed
    sample = folder.parent / original.name
    sample.write_bytes(original.read_bytes())
    done = blender(
        "-b", sample, "-E", "DUALCONE", "--python-expr", SMALL_FLOATS, "-o", folder / "####", *what
    )
    assert done.returncode == 0, done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def animation(blender: Blender, shared_folder: Path) -> list[Path]:
    """Return the files of frames 1 to 3, rendered as an animation."""
    return render(blender, shared_folder / "animation", "-s", 1, "-e", 3, "-a")


def test_the_zip_is_a_valid_extension(bare_blender: Blender, extension: Path) -> None:
    validated = bare_blender("--command", "extension", "validate", extension)
    assert validated.returncode == 0, validated.stdout


def test_an_animation_writes_its_frames(animation: list[Path]) -> None:
    assert [path.name for path in animation] == ["0001.exr", "0002.exr", "0003.exr"]


def test_frames_show_something_that_moves(animation: list[Path]) -> None:
    frames = [read_pixels(path).reshape(-1, 4)[:, :3] for path in animation]
    for frame in frames:
        assert np.isfinite(frame).all()
        assert frame.mean() > 0.01
        assert (frame.max(axis=1) > 0).mean() > 0.9
    assert not np.array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[1], frames[2])


def test_a_frame_alone_has_the_bits_it_has_in_the_animation(
    blender: Blender, shared_folder: Path
) -> None:
    def frame_2(name: str, *what: object) -> NDArray[np.float32]:
        folder = shared_folder / name
        files = render(blender, folder, *what, original=SAMPLE_WITHOUT_BEVEL)
        return read_pixels(next(path for path in files if path.name == "0002.exr"))

    animated = frame_2("run", "-s", 1, "-e", 3, "-a")
    np.testing.assert_array_equal(frame_2("alone", "-f", 2), animated)
