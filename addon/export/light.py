"""Lights as rows of the `light_*` arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from math import pi, sin

import bpy
import numpy as np
from mathutils import Matrix

from .linking import EVERYTHING, NO_GROUP, LightGroups, LinkSets
from .material import MaterialTable
from .nodes import Color, Constant, RecursiveGroup, surface
from .report import Warnings
from .transform import axis_scale, matrix_3x4, without_scale
from .visibility import SHADOW, bits

WHITE: Color = (1.0, 1.0, 1.0)


class Kind(IntEnum):
    """`light_kind` of the contract."""

    SUN = 0
    POINT = 1
    SPOT = 2
    RECTANGLE = 3
    ELLIPSE = 4


@dataclass(frozen=True)
class Light:
    """One row of the light arrays."""

    kind: Kind
    key: int
    placement: np.ndarray
    power: Color
    scale: tuple[float, float, float]
    # Row of the material whose emission is a factor on the light; -1 for none.
    material: int
    size: tuple[float, float]
    spot: tuple[float, float]
    spread: float
    soft_falloff: bool
    visibility: int
    max_bounces: int
    # Numbers of the sets that it lights and that stop its light, and of its light group.
    links: tuple[int, int, int]


@dataclass
class LightTable:
    """The lights of one frame."""

    warnings: Warnings
    materials: MaterialTable
    lights: list[Light] = field(default_factory=list)
    receivers: LinkSets = field(default_factory=LinkSets)
    blockers: LinkSets = field(default_factory=LinkSets)
    groups: LightGroups = field(default_factory=dict)

    def add(self, owner: bpy.types.Object, world_from_object: Matrix, key: int) -> None:
        """Append an evaluated light object, or warn why it is left out."""
        placement = without_scale(world_from_object)
        if placement is None:
            self.warnings.add(owner.name, "has a scale of zero and is left out")
            return
        data = owner.data
        if data.type == "AREA" and data.cycles.is_portal:
            return  # It only tells Cycles where to look for the world.
        kind = light_kind(data)
        size = light_size(data, world_from_object)
        factor = _unnormalised(data, kind, size)
        strength = node_strength(data)
        color = light_color(data)
        light = Light(
            kind,
            key,
            matrix_3x4(placement),
            tuple(c * s * factor for c, s in zip(color, strength or WHITE, strict=True)),
            tuple(axis_scale(world_from_object)),
            -1 if strength else self.materials.index_of_light(data),
            size,
            (data.spot_size, data.spot_blend) if kind == Kind.SPOT else (0.0, 0.0),
            data.spread if data.type == "AREA" else pi,
            kind in (Kind.POINT, Kind.SPOT) and data.use_soft_falloff,
            light_visibility(owner, data),
            data.cycles.max_bounces,
            self.links(owner),
        )
        self.lights.append(light)

    def links(self, owner: bpy.types.Object) -> tuple[int, int, int]:
        """Numbers of what a lamp or glowing thing lights, what stops its light, and its group."""
        linking = owner.light_linking
        receivers = self.receivers.number(linking.receiver_collection)
        blockers = self.blockers.number(linking.blocker_collection)
        if receivers is None or blockers is None:
            self.warnings.add(owner.name, "more than 63 light linking sets, it lights everything")
        group = self.groups.get(owner.lightgroup, NO_GROUP)
        return (receivers or EVERYTHING, blockers or EVERYTHING, group)

    def arrays(self) -> dict[str, np.ndarray]:
        """The `light_*` arrays and `world_from_light` of the contract."""

        def column(name: str, dtype: type, *shape: int) -> np.ndarray:
            values = [getattr(light, name) for light in self.lights]
            return np.array(values, dtype).reshape(len(values), *shape)

        return {
            "light_kind": column("kind", np.uint32),
            "light_key": column("key", np.uint64),
            "world_from_light": column("placement", np.float32, 3, 4),
            "light_power": column("power", np.float32, 3),
            "light_scale": column("scale", np.float32, 3),
            "light_material": column("material", np.int32),
            "light_size": column("size", np.float32, 2),
            "light_spot": column("spot", np.float32, 2),
            "light_spread": column("spread", np.float32),
            "light_soft_falloff": column("soft_falloff", np.uint32),
            "light_visibility": column("visibility", np.uint32),
            "light_max_bounces": column("max_bounces", np.uint32),
            "light_links": column("links", np.uint32, 3),
        }


def light_kind(data: bpy.types.Light) -> Kind:
    if data.type == "AREA":
        return Kind.ELLIPSE if data.shape in ("DISK", "ELLIPSE") else Kind.RECTANGLE
    return Kind[data.type]


def light_visibility(owner: bpy.types.Object, data: bpy.types.Light) -> int:
    """The rays that see the lamp; that of shadow rays means that things can stop its light."""
    seen = bits(owner) & ~SHADOW
    return seen | SHADOW if data.use_shadow else seen


def light_color(data: bpy.types.Light) -> Color:
    """Colour times energy times 2^exposure [W, of a sun W/m^2]."""
    energy = data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    tint = data.temperature_color if getattr(data, "use_temperature", False) else (1.0, 1.0, 1.0)
    red, green, blue = (c * t * energy for c, t in zip(data.color, tint, strict=True))
    return (red, green, blue)


def light_size(data: bpy.types.Light, world_from_object: Matrix) -> tuple[float, float]:
    """`light_size` of the contract. An area light grows with its object."""
    if data.type == "SUN":
        return (data.angle, 0.0)
    if data.type != "AREA":
        return (data.shadow_soft_size, 0.0)
    scale = axis_scale(world_from_object)
    side_y = data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size
    return (data.size * scale.x, side_y * scale.y)


def _unnormalised(data: bpy.types.Light, kind: Kind, size: tuple[float, float]) -> float:
    """Factor on the power if Normalize is off: then a larger light shines more.

    It is the light's area, of a sun its projected solid angle; found by renders with Cycles 5.0,
    also the one of a point without size.
    """
    if getattr(data, "normalize", True):
        return 1.0
    if kind == Kind.SUN:
        return pi * sin(size[0] / 2.0) ** 2
    if kind == Kind.RECTANGLE:
        return size[0] * size[1]
    if kind == Kind.ELLIPSE:
        return pi / 4.0 * size[0] * size[1]
    return 4.0 * pi * size[0] ** 2 if size[0] > 0.0 else 4.0


def node_strength(data: bpy.types.Light) -> Color | None:
    """The factor from the light's node tree if it is a constant: colour times strength."""
    if not data.use_nodes or data.node_tree is None:
        return WHITE
    try:
        shader = surface(data.node_tree)
        if shader is None:
            return (0.0, 0.0, 0.0)
        if isinstance(shader, Constant) or shader.node.bl_idname != "ShaderNodeEmission":
            return None
        color, strength = (shader.input(name).follow() for name in ("Color", "Strength"))
    except RecursiveGroup:
        return None  # The compiler tells the user.
    if not (isinstance(color, Constant) and isinstance(strength, Constant)):
        return None
    red, green, blue = (max(channel * strength.number(), 0.0) for channel in color.color())
    return (red, green, blue)
