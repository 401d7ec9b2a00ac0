"""Runs in a Blender of its own: renders the world of FOLDER/world.blend all around.

Arguments after `--`: FOLDER, the world's name, the frame, the width of the image. Leaves light.npy,
and camera.npy where the nodes ask which ray looks.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

# Looks along +X with +Z up: the middle of an equirectangular image.
LOOKING_ALONG_X = (1.5707963267948966, 0.0, -1.5707963267948966)
SAMPLES = 16
# The same of what is small and bright: a sun covers so few pixels that its energy would be left to
# the chance with which so few samples hit its edge.
FINE_SAMPLES = 1024
# Brightness over the brightest pixel's from which on a pixel counts as bright, and the largest
# share of the picture that is rendered so.
BRIGHT = 0.1
SMALL = 1 / 256


def main() -> None:
    folder, name, frame, width = sys.argv[sys.argv.index("--") + 1 :]
    scene = load(Path(folder), name)
    scene.frame_set(int(float(frame)), subframe=float(frame) % 1.0)
    set_up(scene, int(width))
    light_paths = list(light_path_nodes(scene.world.node_tree, set()))
    if light_paths:
        render(scene, Path(folder), "camera")
    for tree, node in light_paths:
        answer_for_light(tree, node)
    render(scene, Path(folder), "light")


def load(folder: Path, name: str) -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(str(folder / "world.blend")) as (_, target):
        target.worlds = [name]
    scene: Any = bpy.context.scene
    scene.world = target.worlds[0]
    return scene


def set_up(scene: Any, width: int) -> None:
    data: Any = bpy.data.cameras.new("All around")
    data.type = "PANO"
    # A setting of the camera's since Blender 5, of its Cycles settings before.
    (data if hasattr(data, "panorama_type") else data.cycles).panorama_type = "EQUIRECTANGULAR"
    camera = bpy.data.objects.new("All around", data)
    camera.rotation_euler = LOOKING_ALONG_X
    scene.collection.objects.link(camera)
    scene.camera = camera
    render_settings = scene.render
    render_settings.engine = "CYCLES"
    render_settings.resolution_x, render_settings.resolution_y = width, width // 2
    render_settings.resolution_percentage = 100
    render_settings.film_transparent = False
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = SAMPLES, False, False
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = 0.0
    # What fills the world is rendered, not baked.
    for output in (n for n in scene.world.node_tree.nodes if "Output" in n.bl_idname):
        for link in list(output.inputs["Volume"].links):
            scene.world.node_tree.links.remove(link)
    # What hides the world from the camera hides it from no other ray.
    scene.world.cycles_visibility.camera = True
    image = render_settings.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"


def light_path_nodes(tree: Any, seen: set) -> Any:
    if tree is None or tree in seen:
        return
    seen.add(tree)
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeLightPath":
            yield tree, node
        yield from light_path_nodes(getattr(node, "node_tree", None), seen)


def answer_for_light(tree: Any, node: Any) -> None:
    """Let the node answer as for a diffuse ray, while it is the camera that looks."""
    for output in node.outputs:
        if output.name in ("Is Camera Ray", "Is Diffuse Ray"):
            value = tree.nodes.new("ShaderNodeValue")
            value.outputs[0].default_value = float(output.name == "Is Diffuse Ray")
            for link in list(output.links):
                tree.links.new(value.outputs[0], link.to_socket)


def render(scene: Any, folder: Path, name: str) -> None:
    pixels = rendered(scene, folder / f"{name}.exr")
    for rows, columns in small_bright_parts(pixels[..., :3].max(axis=-1)):
        scene.cycles.samples = FINE_SAMPLES
        limit_to(scene, rows, columns)
        fine = rendered(scene, folder / f"{name}-fine.exr")
        pixels[rows, columns] = fine[rows, columns]
    scene.cycles.samples = SAMPLES
    scene.render.use_border = False
    np.save(folder / f"{name}.npy", pixels)


def rendered(scene: Any, path: Path) -> np.ndarray:
    """The picture (H, W, 4), lowest row first."""
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image: Any = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    rgba = np.ones((height, width, 4), np.float32)
    # No light is less than none, whatever the nodes compute.
    rgba[..., :3] = np.maximum(pixels.reshape(height, width, -1)[..., :3], 0.0)
    return rgba


def small_bright_parts(brightness: np.ndarray) -> Iterator[tuple[slice, slice]]:
    """Rows and columns of the brightest things in each half, left and right, if they are small.

    A sun behind the picture's edge lies in both.
    """
    height, width = brightness.shape
    is_bright = brightness > BRIGHT * brightness.max()
    for first in (0, width // 2):
        rows, columns = np.nonzero(is_bright[:, first : first + width // 2])
        if len(rows):
            box = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
            # One more on each side: few samples may have missed its edge.
            high = slice(max(box[0].start - 1, 0), min(box[0].stop + 1, height))
            wide = slice(max(first + box[1].start - 1, 0), min(first + box[1].stop + 1, width))
            if (high.stop - high.start) * (wide.stop - wide.start) <= SMALL * height * width:
                yield high, wide


def limit_to(scene: Any, rows: slice, columns: slice) -> None:
    """Render these alone, and what rounding adds; the rest of the picture is black."""
    settings = scene.render
    settings.use_border, settings.use_crop_to_border = True, False
    settings.border_min_x = max(columns.start - 0.5, 0.0) / settings.resolution_x
    settings.border_max_x = min((columns.stop + 0.5) / settings.resolution_x, 1.0)
    settings.border_min_y = max(rows.start - 0.5, 0.0) / settings.resolution_y
    settings.border_max_y = min((rows.stop + 0.5) / settings.resolution_y, 1.0)


main()
