"""The engine with the compiled renderer: the pixels that arrive in Blender."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from addon.engine import passes
from numpy.typing import NDArray
from shots import animate, moving_cube, read, still, write_single_layer

Frames = dict[int, dict[str, NDArray[np.float32]]]
ROWS, COLUMNS = 6, 8


@pytest.fixture
def shot(scene: Any, tmp_path: Path) -> Any:
    scene = moving_cube(scene, tmp_path)
    scene.frame_end = 4
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.0))
    return scene


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Frames:
    """Collect every finished frame's passes."""
    seen: Frames = {}
    write = passes.Canvas.write

    def spy(canvas: Any, pixels: Any) -> None:
        seen[bpy.context.scene.frame_current] = {name: pixels[name].copy() for name in pixels}
        write(canvas, pixels)

    monkeypatch.setattr(passes.Canvas, "write", spy)
    return seen


def bits(frames: Frames) -> dict[int, bytes]:
    return {
        frame: b"".join(images[name].tobytes() for name in sorted(images))
        for frame, images in frames.items()
    }


def animated_bits(seen: Frames) -> dict[int, bytes]:
    seen.clear()
    animate()
    return bits(seen)


def still_combined(scene: Any, frame: int, seen: Frames) -> NDArray[np.float32]:
    still(scene, frame)
    return seen[frame]["Combined"]


@pytest.mark.parametrize("method", ["DUAL_CONE", "PAPER", "PATH"])
class TestBits:
    @pytest.mark.parametrize("shutter", ["closed", "CENTER", "END"])
    def test_do_not_depend_on_groups_threads_or_neighbours_rendered(
        self, shot: Any, seen: Frames, method: str, shutter: str
    ) -> None:
        shot.dualcone.method = method
        if shutter != "closed":
            shot.render.use_motion_blur = True
            shot.render.motion_blur_position = shutter
        animation = animated_bits(seen)
        assert set(animation) == {1, 2, 3, 4}
        assert len(set(animation.values())) == 4
        shot.dualcone.frames_together = 1
        shot.render.threads = 2
        assert animated_bits(seen) == animation
        seen.clear()
        for frame in (3, 1):
            still(shot, frame)
        assert bits(seen) == {frame: animation[frame] for frame in (1, 3)}

    def test_are_new_after_an_edit_and_old_after_its_undoing(
        self, shot: Any, seen: Frames, method: str
    ) -> None:
        shot.dualcone.method = method
        plane = bpy.data.objects["Plane"]
        first = still_combined(shot, 2, seen)
        plane.location.z = -1.0
        assert not np.array_equal(still_combined(shot, 2, seen), first)
        plane.location.z = 0.0
        np.testing.assert_array_equal(still_combined(shot, 2, seen), first)

    def test_changing_topology_inside_the_window(
        self, shot: Any, seen: Frames, method: str
    ) -> None:
        shot.dualcone.method = method
        array: Any = bpy.data.objects["Cube"].modifiers.new("Array", "ARRAY")
        for frame in range(1, 5):
            array.count = frame
            array.keyframe_insert("count", frame=frame)
        animation = animated_bits(seen)
        assert all(np.isfinite(images["Combined"]).all() for images in seen.values())
        seen.clear()
        still(shot, 3)
        assert bits(seen) == {3: animation[3]}


class TestPasses:
    def test_combined_is_in_the_file_as_rendered(
        self, shot: Any, seen: Frames, tmp_path: Path
    ) -> None:
        write_single_layer(shot)
        animate()
        for frame in range(1, 5):
            written = read(tmp_path / f"{frame:04}.exr").reshape(ROWS, COLUMNS, 4)
            np.testing.assert_array_equal(written, seen[frame]["Combined"])

    def test_depth_is_along_the_viewing_axis(self, shot: Any, seen: Frames) -> None:
        """The camera looks straight down from 8 m at the plane."""
        bpy.data.objects.remove(bpy.data.objects["Cube"])
        shot.camera.location, shot.camera.rotation_euler = (0.0, 0.0, 8.0), (0.0, 0.0, 0.0)
        layer = shot.view_layers[0]
        layer.use_pass_z = layer.use_pass_normal = layer.dualcone.use_pass_sample_count = True
        still(shot, 1)
        np.testing.assert_allclose(seen[1]["Depth"], 8.0, rtol=1e-5)
        np.testing.assert_allclose(seen[1]["Normal"][3, 4], (0.0, 0.0, 1.0), atol=1e-5)
        np.testing.assert_array_equal(seen[1]["Sample Count"], shot.dualcone.samples)

    def test_transparent_film_leaves_alpha_out(self, shot: Any, seen: Frames) -> None:
        for name in ("Cube", "Plane"):
            bpy.data.objects.remove(bpy.data.objects[name])
        shot.render.film_transparent = True
        np.testing.assert_array_equal(still_combined(shot, 1, seen), 0.0)
        shot.render.film_transparent = False
        np.testing.assert_array_equal(still_combined(shot, 1, seen)[..., 3], 1.0)

    def test_a_border_cuts_the_frame(self, shot: Any, seen: Frames) -> None:
        shot.dualcone.method = "PATH"
        whole = still_combined(shot, 1, seen)
        render = shot.render
        render.use_border = True
        render.border_min_x, render.border_max_x = 0.25, 0.75
        render.border_min_y, render.border_max_y = 0.5, 1.0
        cut = still_combined(shot, 1, seen)
        np.testing.assert_array_equal(cut, whole[3:6, 2:6])


def lit_by(image: Any) -> Any:
    """A world that shows an equirectangular image."""
    world: Any = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return world


def glowing(image: Any) -> Any:
    """A material that emits an image's colour."""
    material: Any = bpy.data.materials.new("Screen")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    texture, emission = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "Emission"))
    texture.image = image
    tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return material


def missing_image(folder: Path) -> Any:
    """An image whose file does not exist."""
    image: Any = bpy.data.images.new("gone.png", 2, 2)
    image.source, image.filepath = "FILE", str(folder / "gone.png")
    image.reload()
    return image


def broken_sky() -> Any:
    """A grey HDRI of 16 x 8 texels: one of them is NaN, one infinite.

    It is not written to a file, because Blender 4.2 reads infinity from a file as 1e16.
    """
    image: Any = bpy.data.images.new("sky.exr", 16, 8, float_buffer=True)
    texels = np.full((8, 16, 4), 0.5, np.float32)
    texels[..., 3] = 1.0
    texels[5, 3, 1], texels[6, 9, 0] = np.nan, np.inf
    image.pixels.foreach_set(texels.reshape(-1))
    return image


def messages(caplog: pytest.LogCaptureFixture) -> str:
    return "\n".join(record.getMessage() for record in caplog.records)


def look_at_the_sky(scene: Any) -> None:
    """Leave only the camera, turned up, with a wide lens."""
    for thing in list(bpy.data.objects):
        if thing != scene.camera:
            bpy.data.objects.remove(thing)
    scene.camera.rotation_euler = (2.0, 0.0, 0.0)
    scene.camera.data.lens = 8.0


@pytest.mark.parametrize("method", ["DUAL_CONE", "PATH"])
class TestBadImages:
    def test_a_missing_texture_is_magenta_and_named(
        self,
        shot: Any,
        seen: Frames,
        tmp_path: Path,
        caplog: pytest.LogCaptureFixture,
        method: str,
    ) -> None:
        shot.dualcone.method = method
        bpy.data.objects.remove(bpy.data.objects["Cube"])
        plane: Any = bpy.data.objects["Plane"].data
        plane.materials.append(glowing(missing_image(tmp_path)))
        shot.camera.location, shot.camera.rotation_euler = (0.0, 0.0, 5.0), (0.0, 0.0, 0.0)
        magenta = np.broadcast_to((1.0, 0.0, 1.0, 1.0), (ROWS, COLUMNS, 4))
        np.testing.assert_allclose(still_combined(shot, 1, seen), magenta, atol=1e-6)
        assert "'gone.png': image cannot be read" in messages(caplog)

    def test_a_missing_sky_is_magenta_and_named(
        self,
        shot: Any,
        seen: Frames,
        tmp_path: Path,
        caplog: pytest.LogCaptureFixture,
        method: str,
    ) -> None:
        shot.dualcone.method = method
        look_at_the_sky(shot)
        shot.world = lit_by(missing_image(tmp_path))
        magenta = np.broadcast_to((1.0, 0.0, 1.0, 1.0), (ROWS, COLUMNS, 4))
        np.testing.assert_allclose(still_combined(shot, 1, seen), magenta, atol=1e-6)
        assert "'gone.png': image cannot be read" in messages(caplog)

    def test_a_sky_with_texels_that_are_no_numbers(
        self, shot: Any, seen: Frames, caplog: pytest.LogCaptureFixture, method: str
    ) -> None:
        shot.dualcone.method = method
        shot.world = lit_by(broken_sky())
        lit = still_combined(shot, 1, seen)
        assert np.isfinite(lit).all()
        assert lit[..., :3].mean() > 0.1
        assert "'sky.exr': 2 texels are not numbers and are black" in messages(caplog)
        look_at_the_sky(shot)
        sky = still_combined(shot, 1, seen)
        assert np.isfinite(sky).all()
        assert sky[..., :3].max() <= 0.5 + 1e-6


class TestBadGeometry:
    def test_triangles_without_area(self, shot: Any, seen: Frames) -> None:
        mesh = bpy.data.objects["Cube"].data
        assert isinstance(mesh, bpy.types.Mesh)
        for vertex in mesh.vertices:
            vertex.co.z = vertex.co.x = 0.0
        assert np.isfinite(still_combined(shot, 1, seen)).all()

    def test_vertices_that_are_no_numbers(
        self, shot: Any, seen: Frames, caplog: pytest.LogCaptureFixture
    ) -> None:
        mesh = bpy.data.objects["Cube"].data
        assert isinstance(mesh, bpy.types.Mesh)
        mesh.vertices[3].co.x = float("nan")
        combined = still_combined(shot, 1, seen)
        assert np.isfinite(combined).all()
        assert any("Cube" in record.getMessage() for record in caplog.records)

    def test_a_scale_of_zero(self, shot: Any, seen: Frames) -> None:
        bpy.data.objects["Plane"].scale = (1.0, 0.0, 1.0)
        assert np.isfinite(still_combined(shot, 1, seen)).all()

    def test_nothing_at_all(self, shot: Any, seen: Frames) -> None:
        for thing in list(bpy.data.objects):
            if thing != shot.camera:
                bpy.data.objects.remove(thing)
        shot.world = None
        np.testing.assert_array_equal(
            still_combined(shot, 1, seen), (0.0, 0.0, 0.0, 1.0) * np.ones((6, 8, 1))
        )
