"""Follows the links of a node tree as a renderer sees them: through reroutes, groups and mutes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy

Color = tuple[float, float, float]

# Longer than any chain made by hand; a tree that links in a circle ends here.
MAX_LINKS = 256

# Rec. 709 weights, which Cycles uses where a colour feeds a number.
LUMINANCE = (0.2126, 0.7152, 0.0722)


class RecursiveGroup(Exception):
    """A node group contains itself; the argument is its name."""


CONSTANT_NODES = ("ShaderNodeRGB", "ShaderNodeValue")


@dataclass(frozen=True)
class Constant:
    """A socket whose value the user typed: an input without a link, or an RGB or Value node."""

    socket: bpy.types.NodeSocket
    # Types of the sockets of groups that the value passes on its way.
    through: tuple[str, ...] = ()

    def color(self) -> Color:
        """The value as a colour; a number becomes a grey."""
        value = self.socket.default_value
        if isinstance(value, (int, float)):
            return (float(value), float(value), float(value))
        return (float(value[0]), float(value[1]), float(value[2]))

    def number(self) -> float:
        """The value as a number; a colour becomes its luminance."""
        return sum(
            weight * channel for weight, channel in zip(LUMINANCE, self.color(), strict=True)
        )


@dataclass(frozen=True)
class Source:
    """An output of a node that computes something, or a node without outputs."""

    node: bpy.types.Node
    output: bpy.types.NodeSocket | None
    groups: tuple[bpy.types.Node, ...]
    # Types of the sockets of groups that the value passes on its way.
    through: tuple[str, ...] = ()

    def key(self) -> tuple:
        """Tells this output from all others, groups in other places included."""
        nodes = (node.as_pointer() for node in (self.node, *self.groups))
        return (self.output.identifier, *nodes)

    @property
    def label(self) -> str:
        """The node's type as Blender's Add menu calls it."""
        return self.node.bl_label

    def input(self, identifier: str) -> Input | None:
        return find_input(self.node, identifier, self.groups)


@dataclass(frozen=True)
class Input:
    """An input socket, and the group nodes one entered to reach it, outermost first."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()

    def follow(self) -> Source | Constant:
        """What this input gets its value from.

        Raises RecursiveGroup where a group contains itself.
        """
        here = self
        through: list[str] = []
        for _ in range(MAX_LINKS):
            step = here._step()
            if step is None:
                break
            if not isinstance(step, Input):
                return replace(step, through=tuple(reversed(through)))
            if len(step.groups) != len(here.groups):
                through.append(step.socket.type)
            here = step
        return Constant(here.socket, tuple(reversed(through)))

    def shader(self) -> Source | Constant | None:
        """The shader linked to this socket, or the colour in its place; None without either.

        Raises RecursiveGroup where a group contains itself.
        """
        end = self.follow()
        is_empty = isinstance(end, Constant) and end.socket.type == "SHADER"
        return None if is_empty else end

    def _step(self) -> Source | Constant | Input | None:
        """What the link leads to; None where nothing is linked."""
        link = next(
            (link for link in self.socket.links if link.is_valid and not link.is_muted), None
        )
        if link is None:
            return None
        node, output = link.from_node, link.from_socket
        if node.mute:
            passed = (link.from_socket for link in node.internal_links if link.to_socket == output)
            return next((Input(socket, self.groups) for socket in passed), None)
        if node.bl_idname == "NodeReroute":
            return Input(node.inputs[0], self.groups)
        if node.bl_idname == "NodeGroupInput" and self.groups:
            return find_input(self.groups[-1], output.identifier, self.groups[:-1])
        if node.bl_idname == "ShaderNodeGroup":
            if any(group.node_tree == node.node_tree for group in self.groups):
                raise RecursiveGroup(node.node_tree.name)
            inside = _group_output(node)
            return inside and find_input(inside, output.identifier, (*self.groups, node))
        if node.bl_idname in CONSTANT_NODES:
            return Constant(output)
        return Source(node, output, self.groups)


def find_input(
    node: bpy.types.Node, identifier: str, groups: tuple[bpy.types.Node, ...] = ()
) -> Input | None:
    """The input with this identifier; None in versions of Blender that do not have it."""
    for socket in node.inputs:
        if socket.identifier == identifier:
            return Input(socket, groups)
    return None


def active_output(tree: bpy.types.NodeTree | None) -> bpy.types.Node | None:
    """The output node that Cycles would render: the active one for Cycles or for all engines."""
    return tree.get_output_node("CYCLES") if tree else None


def linked_shader(
    node: bpy.types.Node | None,
    identifier: str,
    groups: tuple[bpy.types.Node, ...] = (),
) -> Source | Constant | None:
    """The shader linked to an input of a node, or the colour in its place.

    Raises RecursiveGroup where a group contains itself.
    """
    socket = node and find_input(node, identifier, groups)
    return socket.shader() if socket else None


def surface(tree: bpy.types.NodeTree | None) -> Source | Constant | None:
    """The shader linked to the Surface of the tree's active output, or the colour in its place."""
    return linked_shader(active_output(tree), "Surface")


def nodes_of(
    tree: bpy.types.NodeTree | None, kind: str, groups: tuple[bpy.types.Node, ...] = ()
) -> Iterator[Source]:
    """The nodes of a type in a tree and in its groups, but for muted ones.

    Raises RecursiveGroup where a group contains itself.
    """
    for node in tree.nodes if tree else ():
        if node.mute:
            continue
        if node.bl_idname == kind:
            yield Source(node, None, groups)
        elif node.bl_idname == "ShaderNodeGroup":
            if any(group.node_tree == node.node_tree for group in groups):
                raise RecursiveGroup(node.node_tree.name)
            yield from nodes_of(node.node_tree, kind, (*groups, node))


def _group_output(group: bpy.types.Node) -> bpy.types.Node | None:
    tree = group.node_tree
    outputs = [n for n in tree.nodes if n.bl_idname == "NodeGroupOutput"] if tree else []
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
