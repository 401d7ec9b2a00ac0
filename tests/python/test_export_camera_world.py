"""Camera and world: against Blender's own projection, and against pixels that Cycles renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from export_oracle import add_camera, add_object, export, export_now, render_with_cycles, scene
from mathutils import Vector

POINTS = [(0, 0, 0), (1, 2, 3), (-2, 0.5, 4), (0.1, -1, -5)]


@pytest.fixture(autouse=True)
def empty_scene() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.mark.parametrize(
    ("lens", "resolution", "aspect"),
    [
        ({}, (32, 24), (1, 1)),
        ({}, (24, 32), (1, 1)),
        ({"sensor_fit": "VERTICAL"}, (32, 24), (1, 1)),
        ({"sensor_fit": "HORIZONTAL"}, (24, 32), (1, 1)),
        ({"shift_x": 0.3, "shift_y": -0.2, "lens": 20}, (32, 24), (1, 1)),
        ({"sensor_width": 20, "clip_start": 0.5, "clip_end": 20}, (32, 24), (1.5, 1)),
        ({"lens_unit": "FOV", "angle": 1.0}, (32, 32), (1, 2)),
        ({"type": "ORTHO", "ortho_scale": 7.0}, (32, 24), (1, 1)),
        ({"type": "ORTHO", "ortho_scale": 3.0, "shift_x": 0.2}, (24, 32), (1, 1.5)),
    ],
)
def test_projection_is_blenders(
    lens: dict[str, Any], resolution: tuple[int, int], aspect: tuple[float, float]
) -> None:
    camera = add_camera(**lens)
    camera.rotation_euler, camera.scale = (0.2, 0.1, 0.3), (2, 3, 0.5)
    render = scene().render
    render.resolution_x, render.resolution_y = resolution
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    arrays = export_now(resolution=resolution).arrays
    rotation, place = arrays["world_from_camera"][:, :3], arrays["world_from_camera"][:, 3]
    assert np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
    for point in POINTS:
        in_camera = rotation.T @ (np.array(point) - place)
        clip = arrays["clip_from_camera"] @ [*in_camera, 1.0]
        ours = (clip[:2] / clip[3] + 1.0) / 2.0
        theirs = world_to_camera_view(scene(), camera, Vector(point))
        assert np.allclose(ours, theirs[:2], atol=1e-4)
    assert np.allclose(arrays["camera_clip"], [camera.data.clip_start, camera.data.clip_end])


def test_a_scene_without_camera_says_what_to_do() -> None:
    with pytest.raises(export.ExportError, match="'Scene' has no camera: add one"):
        export_now()


def panoramic(kind: str, **settings: Any) -> Any:
    """A camera with a panorama; its settings belonged to Cycles until Blender 5.0."""
    camera = add_camera(type="PANO")
    holder = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    holder.panorama_type = kind
    for name, value in settings.items():
        setattr(holder, name, value)
    return camera


def test_a_panorama_is_given_by_its_angles_and_its_shift() -> None:
    angles = {"longitude_min": -1, "longitude_max": 2, "latitude_min": -0.5, "latitude_max": 1}
    camera = panoramic("EQUIRECTANGULAR", **angles)
    camera.data.shift_x, camera.data.shift_y = 0.1, -0.2
    arrays = export_now().arrays
    assert arrays["camera_kind"] == 1
    assert np.allclose(arrays["camera_panorama"], [0.1, -0.2, -1, 2, -0.5, 1, 0, 0, 0, 0])


@pytest.mark.parametrize(
    ("fit", "resolution", "sensor"),
    [
        ("AUTO", (40, 20), (36, 18)),
        ("AUTO", (20, 40), (18, 36)),
        ("HORIZONTAL", (20, 40), (36, 72)),
        ("VERTICAL", (40, 20), (48, 24)),
    ],
)
def test_a_fisheye_fills_the_sensor_as_blender_fits_it(
    fit: str, resolution: tuple[int, int], sensor: tuple[float, float]
) -> None:
    camera = panoramic("FISHEYE_EQUISOLID", fisheye_fov=3.0, fisheye_lens=12.0)
    data = camera.data
    data.sensor_fit, data.sensor_width, data.sensor_height = fit, 36.0, 24.0
    arrays = export_now(resolution=resolution).arrays
    assert arrays["camera_kind"] == 3
    assert np.allclose(arrays["camera_panorama"][:6], [0, 0, 3.0, 12.0, *sensor])


def test_every_panorama_has_its_kind() -> None:
    kinds = {"FISHEYE_EQUIDISTANT": 2, "FISHEYE_LENS_POLYNOMIAL": 4, "MIRRORBALL": 5}
    for name, kind in kinds.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        panoramic(name)
        assert export_now().arrays["camera_kind"] == kind


def test_depth_of_field_is_the_aperture_and_what_is_in_focus() -> None:
    camera = add_camera(lens=50.0)
    camera.location, camera.rotation_euler, camera.scale = (1, 2, 3), (0.3, 0.2, 0.1), (2, 2, 2)
    assert export_now().arrays["camera_lens"][0] == 0.0
    dof = camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 2.0, 4.0
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 6, 0.5, 2.0
    assert np.allclose(export_now().arrays["camera_lens"], [0.0125, 4.0, 6, 0.5, 2.0])
    # An object in focus counts by its distance along the axis, not by its own.
    bpy.context.view_layer.update()
    axes = camera.matrix_world.to_3x3().normalized()
    empty = add_object("Focus", None)
    empty.location = camera.location + axes @ Vector((3.0, -2.0, -7.0))
    dof.focus_object = empty
    assert np.isclose(export_now().arrays["camera_lens"][1], 7.0)
    camera.data.type = "ORTHO"
    assert np.isclose(export_now().arrays["camera_lens"][0], 0.25)


def test_a_picture_without_pixels_is_refused() -> None:
    add_camera()
    with pytest.raises(export.ExportError, match="no pixels to render: 0 x 24"):
        export_now(resolution=(0, 24))


def test_a_camera_without_size_is_refused_by_name() -> None:
    add_camera().scale = (0, 1, 1)
    with pytest.raises(export.ExportError, match="'Camera' has a scale of zero"):
        export_now()


def test_what_the_camera_does_beyond_is_named() -> None:
    add_camera()
    scene().render.use_multiview = True
    assert export_now().warnings == [
        "'Scene': Stereoscopy is not rendered yet",
    ]


def add_world() -> Any:
    world: Any = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.cycles.sampling_method = "NONE"  # nothing to light: spares Cycles its importance map
    scene().world = world
    return world


def background(world: Any) -> Any:
    return next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")


def test_a_plain_world_is_colour_times_strength() -> None:
    add_camera()
    node = background(add_world())
    node.inputs["Color"].default_value = (0.2, 0.4, 0.8, 1)
    node.inputs["Strength"].default_value = 2.5
    frame = export_now()
    assert np.allclose(frame.arrays["world_radiance"], (0.5, 1.0, 2.0))
    assert frame.arrays["world_image"] == -1
    assert frame.warnings == []


def test_other_worlds_are_baked_as_cycles_shows_them(tmp_path: Path) -> None:
    camera = add_camera(lens=14)
    camera.rotation_euler = (1.2, 0.4, 0.7)
    tree = add_world().node_tree
    coordinate = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinate.outputs["Generated"], background(scene().world).inputs["Color"])
    frame = export_now(resolution=(32, 32))
    assert frame.warnings == []
    ours, _ = radiance_of_pixels(frame, 32)
    theirs = render_with_cycles(tmp_path, 32, samples=1)[..., :3]
    # A texel is 0.006 rad wide.
    assert np.allclose(ours, np.maximum(theirs, 0.0), atol=0.01)
    images = export_now().arrays["world_image"], export_now().arrays["world_camera_image"]
    assert images == (0, -1)


def test_a_world_that_the_camera_sees_otherwise_is_baked_twice() -> None:
    add_camera()
    tree = add_world().node_tree
    ray = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(ray.outputs["Is Camera Ray"], background(scene().world).inputs["Color"])
    frame = export_now()
    light, camera = (
        frame.images[frame.arrays[name]].pixels[..., 0].mean()
        for name in ("world_image", "world_camera_image")
    )
    assert (light, camera) == (0.0, 1.0)


def marked_environment(width: int = 16, height: int = 8) -> Any:
    """An environment whose texels all differ."""
    image: Any = bpy.data.images.new("Marked", width, height, float_buffer=True)
    pixels = np.random.default_rng(1).random((height, width, 4), dtype=np.float32)
    pixels[..., 3] = 1.0
    image.pixels.foreach_set(pixels.reshape(-1))
    return image


def radiance_of_pixels(frame: Any, size: int) -> tuple[np.ndarray, np.ndarray]:
    """What the contract says each pixel's centre sees of the environment, and how sure that is.

    The second array tells pixels apart whose direction lies close to the border of a texel.
    """
    arrays = frame.arrays
    centres = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    x, y = np.meshgrid(centres, centres)
    clip = np.stack([x, y, np.zeros_like(x), np.ones_like(x)], axis=-1)
    view = clip @ np.linalg.inv(arrays["clip_from_camera"]).T
    direction = (view[..., :3] / view[..., 3:]) @ arrays["world_from_camera"][:, :3].T
    direction = direction @ arrays["environment_from_world"].T
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    u = 0.5 - np.arctan2(direction[..., 1], direction[..., 0]) / (2 * np.pi)
    v = 1.0 - np.arccos(direction[..., 2]) / np.pi
    pixels = frame.images[arrays["world_image"]].pixels
    height, width = pixels.shape[:2]
    column, row = u % 1.0 * width, v * height
    inside = np.minimum(np.abs(column - np.rint(column)), np.abs(row - np.rint(row))) > 0.02
    texel = pixels[row.astype(int).clip(0, height - 1), column.astype(int) % width, :3]
    return texel * arrays["world_radiance"], inside


@pytest.mark.parametrize(
    ("kind", "rotation", "scale"),
    [
        (None, (0, 0, 0), (1, 1, 1)),
        ("POINT", (0.3, -0.7, 1.1), (1, 1, 1)),
        ("POINT", (0, 0, 0.5), (1, 2, -3)),
        ("TEXTURE", (0.3, -0.7, 1.1), (1, 2, 3)),
        ("VECTOR", (0.3, -0.7, 1.1), (1, 2, 3)),
        ("NORMAL", (0.3, -0.7, 1.1), (1, 2, 3)),
    ],
)
def test_an_environment_lies_where_cycles_puts_it(
    kind: str | None, rotation: Any, scale: Any, tmp_path: Path
) -> None:
    camera = add_camera(lens=14)
    camera.rotation_euler = (1.2, 0.4, 0.7)
    world = add_world()
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image, texture.interpolation = marked_environment(), "Closest"
    tree.links.new(texture.outputs[0], background(world).inputs["Color"])
    background(world).inputs["Strength"].default_value = 1.5
    if kind is not None:
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.vector_type = kind
        mapping.inputs["Rotation"].default_value = rotation
        mapping.inputs["Scale"].default_value = scale
        coordinate = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinate.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    frame = export_now(resolution=(32, 32))
    assert frame.warnings == []
    ours, inside = radiance_of_pixels(frame, 32)
    theirs = render_with_cycles(tmp_path, 32, samples=1)[..., :3]
    agree = np.isclose(ours, theirs, atol=1e-3).all(axis=-1)
    assert inside.mean() > 0.8
    assert agree[inside].all()


def test_light_probes_and_empties_change_nothing() -> None:
    add_camera()
    add_object("Empty", None)
    frame = export_now()
    assert frame.warnings == []
    assert frame.arrays["light_kind"].shape == (0,)
