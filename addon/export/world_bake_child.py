"""Runs in a Blender of its own: renders the world of FOLDER/world.blend all around.

Arguments after `--`: FOLDER, the world's name, the frame, the width of the image. Leaves light.npy,
and camera.npy where the nodes ask which ray looks.
"""

import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

# Looks along +X with +Z up: the middle of an equirectangular image.
LOOKING_ALONG_X = (1.5707963267948966, 0.0, -1.5707963267948966)
SAMPLES = 16


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
    path = folder / f"{name}.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image: Any = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    rgba = np.ones((height, width, 4), np.float32)
    # No light is less than none, whatever the nodes compute.
    rgba[..., :3] = np.maximum(pixels.reshape(height, width, -1)[..., :3], 0.0)
    np.save(folder / f"{name}.npy", rgba)


main()
