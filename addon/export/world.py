"""The world: a colour or an equirectangular image, turned; of other nodes a picture is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import bpy
import numpy as np
from mathutils import Euler, Matrix

from .image import ImageTable, ImageUse, Timing
from .material import uses_nodes
from .nodes import Color, Constant, Source, surface
from .report import Warnings
from .visibility import ALL, SHADOW, bits
from .world_bake import bake, depends_on_ray

BLACK = (0.0, 0.0, 0.0)
# What Blender sets: no limit.
MAX_BOUNCES = 1024


@dataclass(frozen=True)
class World:
    """The world arrays of the contract, before they are arrays."""

    radiance: Color = BLACK
    image: int = -1
    # What the camera sees instead.
    camera_image: int = -1
    environment_from_world: Matrix = field(default_factory=lambda: Matrix.Identity(3))
    visibility: int = ALL
    max_bounces: int = MAX_BOUNCES

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "world_radiance": np.array(self.radiance, np.float32),
            "world_image": np.array(self.image, np.int32),
            "world_camera_image": np.array(self.camera_image, np.int32),
            "world_visibility": np.array(self.visibility, np.uint32),
            "world_max_bounces": np.array(self.max_bounces, np.uint32),
            "environment_from_world": np.array(self.environment_from_world, np.float32, order="C"),
        }


# Power of the share of the way into the mist, by Blender's names.
FALLOFF = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}


def mist(world: bpy.types.World | None) -> np.ndarray:
    """`mist` of the contract; without a world what Cycles takes."""
    if world is None:
        return np.array([0.0, 100.0, 1.0], np.float32)
    settings = world.mist_settings
    return np.array([settings.start, settings.depth, FALLOFF[settings.falloff]], np.float32)


def ambient_distance(world: bpy.types.World | None) -> np.ndarray:
    """`ambient_distance` of the contract; without a world there is no limit."""
    return np.array(world.light_settings.distance if world else 1e30, np.float32)


class _NotPlain(Exception):
    """More than the arrays of the contract can say."""


def export_world(
    world: bpy.types.World | None,
    images: ImageTable,
    frame: float,
    warnings: Warnings,
    should_stop: Callable[[], bool],
) -> World:
    """Reads an evaluated world, of this time; without one it is black. Raises ExportStopped."""
    if world is None:
        return World()
    try:
        read = _plain(world, images)
    except _NotPlain:
        read = _baked(world, images, frame, warnings, should_stop)
    return replace(
        read,
        # What lies in between always stops its light.
        visibility=bits(world.cycles_visibility, "") | SHADOW,
        # The limit is one of looking for light. Cycles does not look for that of a plain world:
        # scattered rays find it, after any number of bounces.
        max_bounces=MAX_BOUNCES if read.image < 0 else world.cycles.max_bounces,
    )


def _baked(
    world: bpy.types.World,
    images: ImageTable,
    frame: float,
    warnings: Warnings,
    should_stop: Callable[[], bool],
) -> World:
    baked = bake(world, frame, warnings, should_stop)
    if baked is None:
        return World()
    camera = -1 if baked.camera is None else images.index_of_pixels(baked.camera)
    return World((1.0, 1.0, 1.0), images.index_of_pixels(baked.light), camera)


def _plain(world: bpy.types.World, images: ImageTable) -> World:
    """A world that is one Background of a colour or an image."""
    if not uses_nodes(world):
        return World(tuple(world.color))
    shader = surface(world.node_tree)
    if shader is None:
        return World()
    is_background = isinstance(shader, Source) and shader.node.bl_idname == "ShaderNodeBackground"
    if not is_background or depends_on_ray(world.node_tree):
        raise _NotPlain
    strength = _constant(shader, "Strength").number()
    source = shader.input("Color").follow()
    if isinstance(source, Source) and source.node.bl_idname == "ShaderNodeTexEnvironment":
        return _environment(source, strength, images)
    red, green, blue = _constant(shader, "Color").color()
    return World((red * strength, green * strength, blue * strength))


def _environment(texture: Source, strength: float, images: ImageTable) -> World:
    node = texture.node
    if node.projection != "EQUIRECTANGULAR" or node.interpolation not in ("Linear", "Closest"):
        raise _NotPlain
    linear = _environment_from_world(texture)
    if node.image is None:
        return World()
    timing = Timing.of(node.image, node.image_user)
    use = ImageUse(node.image, "REPEAT", node.interpolation, timing, multiply_alpha=True)
    image = images.index(use)
    return World((strength,) * 3, image, environment_from_world=linear)


def _environment_from_world(texture: Source) -> Matrix:
    """The linear part of the Mapping nodes between the direction and the texture."""
    linear = Matrix.Identity(3)
    end = texture.input("Vector").follow()
    while isinstance(end, Source) and end.node.bl_idname == "ShaderNodeMapping":
        linear = linear @ _mapping(end)
        end = end.input("Vector").follow()
    if isinstance(end, Source) and not _is_direction(end):
        raise _NotPlain
    return linear


def _is_direction(source: Source) -> bool:
    """In a world these outputs are all the direction one looks along."""
    outputs = {"ShaderNodeTexCoord": ("Generated",), "ShaderNodeNewGeometry": ("Position",)}
    return source.output.identifier in outputs.get(source.node.bl_idname, ())


def _mapping(mapping: Source) -> Matrix:
    kind = mapping.node.vector_type
    if kind in ("POINT", "TEXTURE") and any(_constant(mapping, "Location").color()):
        raise _NotPlain
    factors = _constant(mapping, "Scale").color()
    rotation = Euler(_constant(mapping, "Rotation").color(), "XYZ").to_matrix()
    scale = Matrix.Diagonal(factors)
    if kind in ("TEXTURE", "NORMAL") and 0.0 in factors:
        raise _NotPlain
    if kind == "TEXTURE":
        return scale.inverted() @ rotation.transposed()
    if kind == "NORMAL":
        return rotation @ scale.inverted()
    return rotation @ scale


def _constant(node: Source, identifier: str) -> Constant:
    """The value that an input holds for good."""
    end = node.input(identifier).follow()
    if isinstance(end, Constant):
        return end
    raise _NotPlain
