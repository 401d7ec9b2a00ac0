"""Images: the exported texels against those Cycles shows on an emitting plane."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import (
    RecordingCore,
    add_camera,
    add_material,
    add_object,
    export,
    export_now,
    render_with_cycles,
    scene,
)

import dualcone

TEXELS = np.array(
    [
        [(0, 51, 102, 255), (255, 204, 128, 128)],
        [(10, 200, 30, 64), (90, 60, 250, 0)],
    ],
    np.float32,
)


@pytest.fixture(autouse=True)
def empty_scene() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def save_image(folder: Path, kind: str) -> str:
    """Write TEXELS as a file and return its path."""
    image: Any = bpy.data.images.new("Write", 2, 2, alpha=True, float_buffer=kind == "OPEN_EXR")
    image.pixels.foreach_set((TEXELS / 255).reshape(-1))
    image.file_format = kind
    image.filepath_raw = str(folder / f"texels.{kind.lower()}")
    image.save()
    bpy.data.images.remove(image)
    return str(folder / f"texels.{kind.lower()}")


def load(path: str) -> Any:
    return bpy.data.images.load(path)


def emitting_plane(image: Any, with_alpha: bool) -> None:
    """A square that fills an orthogonal view and emits the image's colour.

    The alpha, if it is used at all, goes where it changes nothing: what counts is that it is used.
    """
    mesh: Any = bpy.data.meshes.new("Plane")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", (0, 0, 1, 0, 1, 1, 0, 1))

    def build(tree: Any) -> Any:
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image, texture.interpolation = image, "Closest"
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        emission = tree.nodes.new("ShaderNodeEmission")
        add = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
        tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
        if with_alpha:
            tree.links.new(texture.outputs["Alpha"], shader.inputs["Roughness"])
        tree.links.new(shader.outputs[0], add.inputs[0])
        tree.links.new(emission.outputs[0], add.inputs[1])
        return add.outputs[0]

    mesh.materials.append(add_material("Screen", build))
    add_object("Plane", mesh)
    add_camera(lens=180)  # 36 mm of sensor see 2 m from 10 m


def assert_cycles_shows(frame: Any, folder: Path) -> None:
    """Compare all texels that are not fully transparent; Cycles blackens those."""
    (image,) = frame.images
    theirs = render_with_cycles(folder, 8, samples=1)[2::4, 2::4, :3]
    shown = image.pixels[..., 3] > 0.0
    assert np.allclose(image.seen()[shown, :3], theirs[shown], atol=1e-3)


@pytest.mark.parametrize("with_alpha", [False, True])
@pytest.mark.parametrize(
    ("kind", "alpha_mode"),
    # Cycles takes the first two for what the format says, whatever the image says.
    [
        ("PNG", "STRAIGHT"),
        ("OPEN_EXR", "PREMUL"),
        ("PNG", "CHANNEL_PACKED"),
        ("OPEN_EXR", "CHANNEL_PACKED"),
        ("PNG", "NONE"),
        ("OPEN_EXR", "NONE"),
    ],
)
def test_alpha_as_in_cycles(kind: str, alpha_mode: str, with_alpha: bool, tmp_path: Path) -> None:
    image = load(save_image(tmp_path, kind))
    image.alpha_mode = alpha_mode
    if kind == "OPEN_EXR":
        image.colorspace_settings.name = "Linear Rec.709"
    emitting_plane(image, with_alpha)
    assert_cycles_shows(export_now(), tmp_path)


@pytest.mark.parametrize("with_alpha", [False, True])
@pytest.mark.parametrize("kind", ["PNG", "OPEN_EXR"])
def test_no_alpha_touches_data(kind: str, with_alpha: bool, tmp_path: Path) -> None:
    image = load(save_image(tmp_path, kind))
    image.colorspace_settings.name = "Non-Color"
    emitting_plane(image, with_alpha)
    assert_cycles_shows(export_now(), tmp_path)


@pytest.mark.parametrize(
    "space", ["sRGB", "Non-Color", "Linear Rec.709", "ACEScg", "Linear Rec.2020", "ACES2065-1"]
)
def test_colour_spaces_as_in_cycles(space: str, tmp_path: Path) -> None:
    image = load(save_image(tmp_path, "PNG"))
    image.colorspace_settings.name, image.alpha_mode = space, "NONE"
    emitting_plane(image, with_alpha=False)
    frame = export_now()
    if not [warning for warning in frame.warnings if "colour space" in warning]:
        assert_cycles_shows(frame, tmp_path)
    else:
        assert bpy.app.version < (5, 0, 0)
        assert space in ("ACEScg", "Linear Rec.2020")


def test_an_unknown_colour_space_is_named(tmp_path: Path) -> None:
    image = load(save_image(tmp_path, "PNG"))
    image.colorspace_settings.name = "Filmic Log"
    emitting_plane(image, with_alpha=False)
    assert "'texels.png': colour space Filmic Log is not known, its colours are read as sRGB" in (
        export_now().warnings
    )


def test_a_missing_file_is_magenta_and_named(tmp_path: Path) -> None:
    path = save_image(tmp_path, "PNG")
    image = load(path)
    Path(path).unlink()
    image.reload()
    emitting_plane(image, with_alpha=False)
    frame = export_now()
    assert frame.images[0].pixels.tolist() == [[[1.0, 0.0, 1.0, 1.0]]]
    assert (
        f"'texels.png': image cannot be read ({path}), magenta is shown instead" in frame.warnings
    )


def test_texels_that_are_no_numbers_are_counted_in_every_frame() -> None:
    image: Any = bpy.data.images.new("Holes", 2, 2, float_buffer=True)
    image.pixels.foreach_set(np.array([1, 1, 1, 1, np.nan, 1, 1, 1] * 2, np.float32))
    emitting_plane(image, with_alpha=False)
    cache = export.ExportCache()
    for _ in range(2):
        frame = export_now(cache, dualcone)
        assert "'Holes': 2 texels are not numbers and are black" in frame.warnings


def test_a_packed_image_needs_no_file(tmp_path: Path) -> None:
    path = save_image(tmp_path, "PNG")
    image = load(path)
    image.pack()
    Path(path).unlink()
    emitting_plane(image, with_alpha=True)
    assert_cycles_shows(export_now(), tmp_path)


def test_an_image_is_handed_over_once_until_it_changes(tmp_path: Path) -> None:
    image = load(save_image(tmp_path, "PNG"))
    emitting_plane(image, with_alpha=False)
    cache, core = export.ExportCache(), RecordingCore()
    first, second = export_now(cache, core), export_now(cache, core)
    assert first.images[0] is second.images[0]
    assert first.content_hash == second.content_hash
    image.colorspace_settings.name = "Non-Color"
    third = export_now(cache, core)
    assert third.images[0] is not first.images[0]
    assert third.content_hash != first.content_hash


def test_images_of_one_and_three_channels(tmp_path: Path) -> None:
    pixels = {}
    for mode in ("BW", "RGB"):
        image: Any = bpy.data.images.new(mode, 2, 2)
        image.pixels.foreach_set((TEXELS / 255).reshape(-1))
        settings = scene().render.image_settings
        settings.file_format, settings.color_mode = "PNG", mode
        path = str(tmp_path / f"{mode}.png")
        image.save_render(path)
        loaded = load(path)
        loaded.colorspace_settings.name = "Non-Color"
        emitting_plane(loaded, with_alpha=False)
        pixels[mode] = export_now().images[-1].pixels
    assert (pixels["BW"][..., :3] == pixels["BW"][..., :1]).all()
    assert (pixels["RGB"][..., 3] == 1.0).all()


def save_plain(path: Path, red: float) -> str:
    """Write an image of one colour."""
    image: Any = bpy.data.images.new("Write", 2, 2)
    image.pixels.foreach_set(np.tile(np.array([red, 0.0, 0.0, 1.0], np.float32), 4))
    image.file_format, image.filepath_raw = "PNG", str(path)
    image.save()
    bpy.data.images.remove(image)
    return str(path)


def test_tiles_are_read_by_their_numbers(tmp_path: Path) -> None:
    for number, red in ((1001, 0.2), (1002, 0.4), (1011, 0.6)):
        first = save_plain(tmp_path / f"wood.{number}.png", red)
    image = load(first.replace("1011", "1001"))
    image.filepath, image.source = str(tmp_path / "wood.<UDIM>.png"), "TILED"
    for number in (1002, 1011, 1012):
        if image.tiles.get(number) is None:
            image.tiles.new(number)
    emitting_plane(image, with_alpha=False)
    before = len(bpy.data.images)
    frame = export_now()
    (made,) = frame.images
    reds = {number: round(float(tile.pixels[0, 0, 0]), 2) for number, tile in made.tiles}
    assert reds == {1001: 0.2, 1002: 0.4, 1011: 0.6}
    missing = str(tmp_path / "wood.1012.png")
    assert frame.warnings == [f"'{image.name}': image cannot be read ({missing})"]
    assert len(bpy.data.images) == before


def test_sequences_count_as_blender_does() -> None:
    once = export.image.Timing(duration=3, start=10, offset=4, is_cyclic=False)
    assert [once.number(frame) for frame in (1, 10, 12, 20)] == [4, 5, 7, 7]
    again = export.image.Timing(duration=3, start=1, offset=0, is_cyclic=True)
    assert [again.number(frame) for frame in (0, 1, 3, 4)] == [3, 1, 3, 1]
    numbered = export.image.numbered
    assert numbered("//shots2/a1_009.exr", 10) == "//shots2/a1_010.exr"
    assert numbered("C:\\shots\\sky7.png", 12) == "C:\\shots\\sky12.png"
    assert numbered("//no/digits.png", 3) == "//no/digits.png"


def test_a_sequence_shows_the_frame_of_its_user(tmp_path: Path) -> None:
    for frame in (1, 2, 3):
        save_plain(tmp_path / f"shot{frame:03}.png", 0.2 * frame)
    image = load(str(tmp_path / "shot001.png"))
    image.source = "SEQUENCE"
    emitting_plane(image, with_alpha=False)
    tree = bpy.data.materials["Screen"].node_tree
    texture: Any = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    texture.image_user.frame_start, texture.image_user.frame_duration = 1, 3
    cache = export.ExportCache()
    for frame in (1, 2, 3):
        scene().frame_set(frame)
        exported = export_now(cache)
        (made,) = exported.images
        assert exported.warnings == []
        assert round(float(made.pixels[0, 0, 0]), 2) == round(0.2 * frame, 2)
