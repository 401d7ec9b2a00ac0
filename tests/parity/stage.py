"""The scene that every row starts from, and what the rows are made with.

The stored references are found by this file: whatever changes it has them rendered anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
from mathutils import Vector

GREY = (0.7, 0.7, 0.7)


@dataclass
class Stage:
    """A cube and a ball on a floor, all matt, a square lamp above and a dim grey sky."""

    scene: Any = field(init=False)
    floor: Any = field(init=False)
    cube: Any = field(init=False)
    ball: Any = field(init=False)
    lamp: Any = field(init=False)
    camera: Any = field(init=False)

    def __post_init__(self) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.scene.world = sky((0.25, 0.25, 0.25))
        self.floor = plane(12.0)
        bpy.ops.mesh.primitive_cube_add(location=(-1.2, 0.3, 1.0), rotation=(0.0, 0.0, 0.5))
        self.cube = bpy.context.object
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(1.3, 0.0, 1.0))
        bpy.ops.object.shade_smooth()
        self.ball = bpy.context.object
        for thing, color in (
            (self.floor, GREY),
            (self.cube, (0.8, 0.2, 0.1)),
            (self.ball, (0.2, 0.5, 0.8)),
        ):
            give(thing, matt(color))
        self.lamp = self.add_lamp("AREA", location=(2.0, -3.0, 5.0), energy=300.0, size=1.0)
        bpy.ops.object.camera_add(location=(0.0, -7.0, 3.0), rotation=(1.2, 0.0, 0.0))
        self.camera = bpy.context.object
        self.scene.camera = self.camera
        for engine in (self.scene.cycles, getattr(self.scene, "dualcone", None)):
            set_known(
                engine,
                max_bounces=4,
                diffuse_bounces=4,
                glossy_bounces=4,
                transmission_bounces=8,
                transparent_max_bounces=8,
            )

    def add_lamp(self, kind: str, location: tuple[float, float, float], **values: Any) -> Any:
        """Add a lamp that points at the middle of the stage."""
        data = bpy.data.lights.new("Lamp", kind)
        lamp: Any = bpy.data.objects.new("Lamp", data)
        self.scene.collection.objects.link(lamp)
        lamp.location = location
        lamp.rotation_euler = (-Vector(location)).to_track_quat("-Z", "Y").to_euler()
        for name, value in values.items():
            setattr(data, name, value)
        return lamp

    def only(self, kind: str, **values: Any) -> Any:
        """Put a lamp of another kind in the place of the lamp, and the sky out."""
        self.scene.world = sky((0.0, 0.0, 0.0))
        location = tuple(self.lamp.location)
        bpy.data.objects.remove(self.lamp)
        self.lamp = self.add_lamp(kind, location, **values)
        return self.lamp

    def clear(self) -> None:
        """Take cube and ball away."""
        for thing in (self.cube, self.ball):
            bpy.data.objects.remove(thing)


def set_known(owner: Any, **values: Any) -> None:
    """Set those of the values whose names the owner knows."""
    for name, value in values.items():
        if hasattr(owner, name):
            setattr(owner, name, value)


def plane(size: float) -> Any:
    bpy.ops.mesh.primitive_plane_add(size=size)
    return bpy.context.object


def give(thing: Any, material: Any) -> None:
    """Make `material` the only one."""
    thing.data.materials.clear()
    thing.data.materials.append(material)


def node_tree(owner: Any) -> Any:
    """The node tree of a new material, world or light, cleared but for its output."""
    if bpy.app.version < (5, 0, 0) or isinstance(owner, bpy.types.Light):
        owner.use_nodes = True
    tree = owner.node_tree
    for node in [n for n in tree.nodes if "Output" not in n.bl_idname]:
        tree.nodes.remove(node)
    return tree


def output(tree: Any) -> Any:
    return next(n for n in tree.nodes if "Output" in n.bl_idname)


def add_node(tree: Any, kind: str, /, **values: Any) -> Any:
    """A node whose inputs, or else properties, have these values; a socket becomes a link.

    Inputs go by their name or, where two share it, by their identifier.
    """
    node = tree.nodes.new(kind)
    # Properties first: some of them decide which inputs there are.
    for name, value in values.items():
        if name in node.bl_rna.properties:
            setattr(node, name, value)
    for name, value in values.items():
        if name in node.bl_rna.properties:
            continue
        socket = find_socket(node, name)
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node


def find_socket(node: Any, name: str) -> Any:
    """The enabled input of this name or identifier."""
    enabled = [s for s in node.inputs if s.enabled and name in (s.name, s.identifier)]
    if not enabled:
        raise KeyError(f"{node.bl_idname} has no input '{name}'")
    return enabled[0]


def shade(owner: Any, kind: str, /, **values: Any) -> Any:
    """Make one shader node the surface of a new material, world or light."""
    tree = node_tree(owner)
    shader = add_node(tree, kind, **values)
    tree.links.new(shader.outputs[0], output(tree).inputs["Surface"])
    return owner


def matt(color: tuple[float, float, float]) -> Any:
    return shade(bpy.data.materials.new("Matt"), "ShaderNodeBsdfDiffuse", Color=(*color, 1.0))


def sky(color: tuple[float, float, float]) -> Any:
    return shade(bpy.data.worlds.new("Sky"), "ShaderNodeBackground", Color=(*color, 1.0))
