"""Worlds."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .rows import table
from .stage import Stage, add_node, give, node_tree, output, shade


def start(stage: Stage) -> Any:
    """An empty world tree, and no lamp."""
    bpy.data.objects.remove(stage.lamp)
    stage.scene.world = bpy.data.worlds.new("World")
    return node_tree(stage.scene.world)


def finish(tree: Any, color: Any, strength: float = 1.0) -> None:
    background = add_node(tree, "ShaderNodeBackground", Color=color, Strength=strength)
    tree.links.new(background.outputs[0], output(tree).inputs["Surface"])


def plain(stage: Stage, color: tuple[float, ...], strength: float = 1.0) -> None:
    finish(start(stage), color, strength)


def panorama(width: int, sun: float) -> bpy.types.Image:
    """Blue above, brown below, and a bright spot."""
    height = width // 2
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.ones((height, width, 4), np.float32)
    ground, zenith = np.array((0.3, 0.2, 0.1)), np.array((0.2, 0.4, 0.9))
    pixels[..., :3] = np.where(v[..., None] < 0.5, ground, zenith) * (0.5 + 0.5 * u[..., None])
    spot = (u - 0.2) ** 2 + (v - 0.75) ** 2 < 0.03**2
    pixels[spot, :3] = sun
    image = bpy.data.images.new("Panorama", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def environment(
    stage: Stage, sun: float = 5.0, mapping: dict[str, Any] | None = None, **values: Any
) -> None:
    """An image all around, perhaps turned."""
    tree = start(stage)
    place = add_node(tree, "ShaderNodeTexCoord").outputs["Generated"]
    if mapping:
        place = add_node(tree, "ShaderNodeMapping", Vector=place, **mapping).outputs[0]
    image = panorama(128, sun)
    texture = add_node(tree, "ShaderNodeTexEnvironment", Vector=place, image=image, **values)
    finish(tree, texture.outputs["Color"], 0.8)


def sky_texture(stage: Stage, **values: Any) -> None:
    """Blender's sky; the strength brings daylight to the size of the other rows."""
    tree = start(stage)
    kind = values.pop("sky_type", None) or (
        "MULTIPLE_SCATTERING" if bpy.app.version >= (5, 0, 0) else "NISHITA"
    )
    texture = add_node(tree, "ShaderNodeTexSky", sky_type=kind, **values)
    finish(tree, texture.outputs["Color"], 0.1)


def pattern(stage: Stage, kind: str, **values: Any) -> None:
    """A texture that depends on the direction."""
    tree = start(stage)
    place = add_node(tree, "ShaderNodeTexCoord").outputs["Generated"]
    texture = add_node(tree, kind, Vector=place, **values)
    ramp = add_node(tree, "ShaderNodeValToRGB", Fac=texture.outputs[0])
    ramp.color_ramp.elements[0].color = (0.1, 0.2, 0.8, 1.0)
    ramp.color_ramp.elements[1].color = (1.0, 0.7, 0.3, 1.0)
    finish(tree, ramp.outputs["Color"])


def height_gradient(stage: Stage) -> None:
    """Colour by height: Separate XYZ and a Color Ramp."""
    tree = start(stage)
    place = add_node(tree, "ShaderNodeTexCoord").outputs["Generated"]
    height = add_node(tree, "ShaderNodeSeparateXYZ", Vector=place).outputs["Z"]
    color = add_node(tree, "ShaderNodeValToRGB", Fac=height).outputs["Color"]
    finish(tree, color)


def blackbody(stage: Stage, temperature: float) -> None:
    tree = start(stage)
    finish(tree, add_node(tree, "ShaderNodeBlackbody", Temperature=temperature).outputs[0])


def camera_split(stage: Stage) -> None:
    """Light Path: the camera sees another world than the one that lights."""
    tree = start(stage)
    lights = add_node(tree, "ShaderNodeBackground", Color=(0.4, 0.6, 0.9, 1.0))
    shows = add_node(tree, "ShaderNodeBackground", Color=(0.8, 0.1, 0.1, 1.0))
    factor = add_node(tree, "ShaderNodeLightPath").outputs["Is Camera Ray"]
    mix = add_node(
        tree,
        "ShaderNodeMixShader",
        Fac=factor,
        Shader=lights.outputs[0],
        Shader_001=shows.outputs[0],
    )
    tree.links.new(mix.outputs[0], output(tree).inputs["Surface"])


def two_backgrounds(stage: Stage, kind: str, **values: Any) -> None:
    """An image and a colour, mixed or added."""
    environment(stage)
    tree = stage.scene.world.node_tree
    first = output(tree).inputs["Surface"].links[0].from_socket
    second = add_node(tree, "ShaderNodeBackground", Color=(0.1, 0.3, 0.1, 1.0))
    both = add_node(tree, kind, **values)
    for shader, socket in zip((first, second.outputs[0]), both.inputs[-2:], strict=True):
        tree.links.new(shader, socket)
    tree.links.new(both.outputs[0], output(tree).inputs["Surface"])


def hidden(stage: Stage, ray: str) -> None:
    """A world that one kind of ray does not see; floor and ball are glossy."""
    environment(stage)
    for thing in (stage.floor, stage.ball):
        material = bpy.data.materials.new("Glossy")
        shade(material, "ShaderNodeBsdfAnisotropic", Color=(0.8, 0.8, 0.8, 1.0), Roughness=0.4)
        give(thing, material)
    setattr(stage.scene.world.cycles_visibility, ray, False)


def bounded(stage: Stage, bounces: int) -> None:
    plain(stage, (0.5, 0.5, 0.5, 1.0))
    stage.scene.world.cycles.max_bounces = bounces


def transparent_film(stage: Stage) -> None:
    environment(stage)
    stage.scene.render.film_transparent = True


ROWS = table(
    "world",
    ("colour", plain, {"color": (0.2, 0.4, 0.9, 1.0), "strength": 1.5}),
    ("image", environment),
    ("image with a sun", environment, {"sun": 300.0}),
    ("image, turned", environment, {"mapping": {"Rotation": (0.3, 0.2, 1.0)}}),
    ("image, Closest", environment, {"interpolation": "Closest"}),
    ("image, mirror ball", environment, {"projection": "MIRROR_BALL"}),
    ("Sky Texture, multiple scattering", sky_texture, {"sun_elevation": 0.4}),
    ("Sky Texture, low sun", sky_texture, {"sun_elevation": 0.05, "sun_rotation": 1.0}),
    ("Sky Texture, sun towards -X", sky_texture, {"sun_elevation": 0.3, "sun_rotation": -1.5708}),
    ("Sky Texture, no disc", sky_texture, {"sun_disc": False}),
    ("Sky Texture, single scattering", sky_texture, {"sky_type": "SINGLE_SCATTERING"}),
    ("Sky Texture, Preetham", sky_texture, {"sky_type": "PREETHAM"}),
    ("Sky Texture, Hosek/Wilkie", sky_texture, {"sky_type": "HOSEK_WILKIE"}),
    ("Gradient", pattern, {"kind": "ShaderNodeTexGradient"}),
    ("Noise", pattern, {"kind": "ShaderNodeTexNoise", "Scale": 3.0}),
    ("Separate XYZ, Color Ramp", height_gradient),
    ("Blackbody", blackbody, {"temperature": 4000.0}),
    ("Light Path, Is Camera Ray", camera_split),
    ("Mix Shader", two_backgrounds, {"kind": "ShaderNodeMixShader", "Fac": 0.3}),
    ("Add Shader", two_backgrounds, {"kind": "ShaderNodeAddShader"}),
    ("hidden from the camera", hidden, {"ray": "camera"}),
    ("hidden from diffuse rays", hidden, {"ray": "diffuse"}),
    ("hidden from glossy rays", hidden, {"ray": "glossy"}),
    ("max bounces 0", bounded, {"bounces": 0}),
    ("transparent film", transparent_film),
)
