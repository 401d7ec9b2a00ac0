"""The world: a colour or an equirectangular image, turned."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Euler, Matrix

from .image import ImageTable, ImageUse
from .material import uses_nodes
from .nodes import Color, Constant, Source, surface
from .report import Warnings

BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class World:
    """The world arrays of the contract, before they are arrays."""

    radiance: Color = BLACK
    image: int = -1
    environment_from_world: Matrix = field(default_factory=lambda: Matrix.Identity(3))

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "world_radiance": np.array(self.radiance, np.float32),
            "world_image": np.array(self.image, np.int32),
            "environment_from_world": np.array(self.environment_from_world, np.float32, order="C"),
        }


def export_world(world: bpy.types.World | None, images: ImageTable, warnings: Warnings) -> World:
    """Reads an evaluated world; without one, or without a Background, it is black."""
    if world is None:
        return World()
    if not uses_nodes(world):
        return World(tuple(world.color))
    shader = surface(world.node_tree)
    if shader is None:
        return World()
    if shader.node.bl_idname != "ShaderNodeBackground":
        warnings.not_rendered(world.name, shader.label)
        return World()
    strength = _constant(shader, "Strength", world.name, warnings).number()
    source = shader.input("Color").follow()
    if isinstance(source, Source) and source.node.bl_idname == "ShaderNodeTexEnvironment":
        return _environment(source, strength, world.name, images, warnings)
    red, green, blue = _constant(shader, "Color", world.name, warnings).color()
    return World((red * strength, green * strength, blue * strength))


def _environment(
    texture: Source, strength: float, name: str, images: ImageTable, warnings: Warnings
) -> World:
    node = texture.node
    if node.image is None:
        return World()
    if node.projection != "EQUIRECTANGULAR":
        warnings.not_rendered(name, f"{node.projection.replace('_', ' ').title()} projection")
    interpolation = "Closest" if node.interpolation == "Closest" else "Linear"
    image = images.index(ImageUse(node.image, "REPEAT", interpolation, multiply_alpha=True))
    linear = _environment_from_world(texture, name, warnings)
    return World((strength,) * 3, image, linear)


def _environment_from_world(texture: Source, name: str, warnings: Warnings) -> Matrix:
    """The linear part of the Mapping nodes between the direction and the texture."""
    linear = Matrix.Identity(3)
    end = texture.input("Vector").follow()
    while isinstance(end, Source) and end.node.bl_idname == "ShaderNodeMapping":
        linear = linear @ _mapping(end, name, warnings)
        end = end.input("Vector").follow()
    if isinstance(end, Source) and not _is_direction(end):
        what = end.output.name if end.node.bl_idname == "ShaderNodeTexCoord" else end.label
        warnings.not_rendered(name, f"{what} coordinate of the environment")
    return linear


def _is_direction(source: Source) -> bool:
    """In a world these outputs are all the direction one looks along."""
    outputs = {"ShaderNodeTexCoord": ("Generated",), "ShaderNodeNewGeometry": ("Position",)}
    return source.output.identifier in outputs.get(source.node.bl_idname, ())


def _mapping(mapping: Source, name: str, warnings: Warnings) -> Matrix:
    kind = mapping.node.vector_type
    if kind in ("POINT", "TEXTURE"):
        location = _constant(mapping, "Location", name, warnings).color()
        if any(location):
            warnings.not_rendered(name, "Location of the environment's Mapping")
    angles = _constant(mapping, "Rotation", name, warnings).color()
    factors = _constant(mapping, "Scale", name, warnings).color()
    rotation = Euler(angles, "XYZ").to_matrix()
    scale = Matrix.Diagonal(factors)
    if kind in ("TEXTURE", "NORMAL") and 0.0 in factors:
        warnings.not_rendered(name, "Mapping with a scale of zero")
        return rotation
    if kind == "TEXTURE":
        return scale.inverted() @ rotation.transposed()
    if kind == "NORMAL":
        return rotation @ scale.inverted()
    return rotation @ scale


def _constant(node: Source, identifier: str, name: str, warnings: Warnings) -> Constant:
    """The input's value; where a node computes it, the typed value with a warning."""
    socket = node.input(identifier)
    end = socket.follow()
    if isinstance(end, Constant):
        return end
    warnings.add(
        name, f"{end.label} in {socket.socket.name} is not rendered yet (its default value is used)"
    )
    return Constant(socket.socket)
