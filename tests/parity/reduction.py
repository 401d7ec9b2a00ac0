"""Taking out of a scene whatever it can do without, and telling what is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import bpy

from .chance import NO_CHOICES

Socket = Any
Node = Any


@dataclass(frozen=True)
class Step:
    """Something that can be taken out of a scene, and put back."""

    out: Callable[[], None]
    back: Callable[[], None]


def steps_of(scene: Any) -> list[Step]:
    """Everything that a scene can do without: things, then links of materials."""
    things = [thing for thing in scene.objects if thing.type != "CAMERA"]
    steps = [
        Step(
            partial(setattr, thing, "hide_render", True),
            partial(setattr, thing, "hide_render", False),
        )
        for thing in things
    ]
    trees = [material.node_tree for material in bpy.data.materials]
    for tree in trees:
        for link in tree.links:
            ends = link.from_socket, link.to_socket
            steps.append(Step(partial(unlink, tree, *ends), partial(tree.links.new, *ends)))
    settings = [setting for tree in trees for node in tree.nodes for setting in settings_of(node)]
    steps += [Step(s.forget, partial(s.set, s.value)) for s in settings if s.value != s.default]
    return steps


@dataclass(frozen=True)
class Setting:
    """A choice of a node, or the value of one of its sockets."""

    owner: Any
    name: str
    label: str
    value: Any
    default: Any

    def set(self, value: Any) -> None:
        setattr(self.owner, self.name, value)

    def forget(self) -> None:
        """Set it to what it is in a new node."""
        self.set(self.default)


def settings_of(node: Node) -> list[Setting]:
    """All of a node's, choices first."""
    tree = bpy.data.materials.new("Scratch") if node.bl_idname not in FRESH else None
    if tree is not None:
        if bpy.app.version < (5, 0, 0):
            tree.use_nodes = True  # type: ignore[attr-defined]
        fresh: Any = tree.node_tree.nodes.new(node.bl_idname)  # type: ignore[union-attr]
        FRESH[node.bl_idname] = values_of(fresh)
        bpy.data.materials.remove(tree)
    fresh_values = FRESH[node.bl_idname]
    return [
        Setting(owner, name, label, value, fresh_values[at][3])
        for at, (owner, name, label, value) in enumerate(values_of(node))
    ]


FRESH: dict[str, list[tuple[Any, str, str, Any]]] = {}


def values_of(node: Node) -> list[tuple[Any, str, str, Any]]:
    """Owner, name, label and value of each setting, always in the same order."""
    found: list[tuple[Any, str, str, Any]] = []
    for prop in node.bl_rna.properties:
        own = prop.identifier not in bpy.types.Node.bl_rna.properties
        is_choice = prop.type in ("ENUM", "BOOLEAN") and prop.identifier not in NO_CHOICES
        if own and is_choice and not prop.is_readonly:
            name = prop.identifier
            found.append((node, name, name, getattr(node, name)))
    for socket in node.inputs:
        if hasattr(socket, "default_value"):
            value = socket.default_value
            value = value if isinstance(value, (int, float, str)) else tuple(value)
            found.append((socket, "default_value", socket.name, value))
    return found


def unlink(tree: Any, start: Socket, end: Socket) -> None:
    """Take out the link between two sockets."""
    for link in list(tree.links):
        if link.from_socket == start and link.to_socket == end:
            tree.links.remove(link)


def reduce(scene: Any, differs: Callable[[], bool]) -> None:
    """Take out of a scene whatever leaves it different (delta debugging, Zeller 1999)."""
    steps = steps_of(scene)
    size = max(1, len(steps) // 2)
    while steps:
        kept: list[Step] = []
        for first in range(0, len(steps), size):
            part = steps[first : first + size]
            for step in part:
                step.out()
            if not differs():
                for step in reversed(part):
                    step.back()
                kept += part
        if size == 1 and len(kept) == len(steps):
            return
        steps, size = kept, max(1, size // 2)


def description(scene: Any) -> str:
    """What is left of a scene, a line for each thing that is seen."""
    lines = []
    for thing in scene.objects:
        if thing.hide_render or thing.type == "CAMERA":
            continue
        lines.append(
            f"{thing.name}: " + "; ".join(look(slot.material) for slot in thing.material_slots)
        )
    return "\n    ".join(lines)


def look(material: Any) -> str:
    """The nodes that reach a material's output."""
    tree = material.node_tree
    todo = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL"]
    parts: list[str] = []
    seen = set()
    while todo:
        node = todo.pop()
        if node.name in seen:
            continue
        seen.add(node.name)
        parts.append(f"{node.name}({', '.join(choices_of(node))})")
        todo += [link.from_node for socket in node.inputs for link in socket.links]
    return " ".join(reversed(parts))


def choices_of(node: Node) -> list[str]:
    """What feeds a node, and what it has that a new one has not."""
    linked = [socket for socket in node.inputs if socket.links]
    links = [(socket.name, socket.links[0]) for socket in linked]
    texts = [f"{name}<-{link.from_node.name}.{link.from_socket.name}" for name, link in links]
    changed = [s for s in settings_of(node) if s.value != s.default and s.owner not in linked]
    return texts + [f"{setting.label}={short(setting.value)}" for setting in changed]


def short(value: Any) -> str:
    if isinstance(value, tuple):
        return ",".join(short(number) for number in value)
    return f"{value:.3g}" if isinstance(value, float) else str(value)
