"""Shaders of hair, on hair and on what is none."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .geometry import hair_curves, hair_particles
from .rows import table
from .stage import Stage, add_node, give, node_tree, output, shade

PRINCIPLED = "ShaderNodeBsdfHairPrincipled"
SIMPLE = "ShaderNodeBsdfHair"
BLOND, BLACK = (0.8, 0.5, 0.2, 1.0), (0.01, 0.01, 0.01, 1.0)


def tufts(stage: Stage, kind: str, shape: str = "THICK", **values: Any) -> None:
    """One shader node on hair curves."""
    hair_curves(stage, shape)
    give(bpy.data.objects["Thing"], shade(bpy.data.materials.new("Row"), kind, **values))


def sunlit(stage: Stage, kind: str, **values: Any) -> None:
    """The same in the light of a sun behind the hair."""
    tufts(stage, kind, **values)
    sun = stage.only("SUN", energy=4.0, angle=0.2)
    sun.rotation_euler = (-1.1, 0.3, 0.0)


def ball(stage: Stage, kind: str, **values: Any) -> None:
    """One shader node on ball and cube."""
    for thing in (stage.ball, stage.cube):
        give(thing, shade(bpy.data.materials.new("Row"), kind, **values))


def particles(stage: Stage, kind: str, **values: Any) -> None:
    """One shader node on the hair of the ball."""
    hair_particles(stage)
    stage.ball.data.materials.append(shade(bpy.data.materials.new("Row"), kind, **values))
    stage.ball.particle_systems[0].settings.material = 2


def told(stage: Stage, name: str, scale: float = 1.0, is_grown: bool = False) -> None:
    """What an output of Hair Info tells, as light."""
    hair_particles(stage) if is_grown else hair_curves(stage, "THICK")
    thing = stage.ball if is_grown else bpy.data.objects["Thing"]
    if not is_grown:
        lengths = np.repeat(np.linspace(0.6, 1.2, 60, dtype=np.float32), 8)
        positions = np.empty(60 * 8 * 3, np.float32)
        points: Any = thing.data.attributes["position"].data
        points.foreach_get("vector", positions)
        positions.reshape(-1, 3)[:, 2] *= lengths
        points.foreach_set("vector", positions)
    tree = node_tree(bpy.data.materials.new("Row"))
    info = tree.nodes.new("ShaderNodeHairInfo")
    # Directions have signs, colours have none.
    low, width = ((0.5,) * 3, (0.5,) * 3) if name == "Tangent Normal" else ((0.0,) * 3, (1.0,) * 3)
    color = add_node(
        tree,
        "ShaderNodeVectorMath",
        operation="MULTIPLY_ADD",
        Vector=info.outputs[name],
        Vector_001=width,
        Vector_002=low,
    )
    light = add_node(tree, "ShaderNodeEmission", Color=color.outputs[0], Strength=scale)
    tree.links.new(light.outputs[0], output(tree).inputs["Surface"])
    give(thing, bpy.data.materials["Row"])


ROWS = table(
    "hair",
    ("principled, colour", tufts, {"kind": PRINCIPLED, "Color": BLOND}),
    ("principled, colour, ribbons", tufts, {"kind": PRINCIPLED, "shape": "RIBBONS", "Color": BLOND}),
    ("principled, black", tufts, {"kind": PRINCIPLED, "Color": BLACK}),
    ("principled, melanin", tufts, {"kind": PRINCIPLED, "parametrization": "MELANIN", "Melanin": 0.5, "Melanin Redness": 0.4}),
    ("principled, melanin and tint", tufts, {"kind": PRINCIPLED, "parametrization": "MELANIN", "Melanin": 0.2, "Tint": (0.2, 0.4, 0.8, 1.0)}),
    ("principled, absorption", tufts, {"kind": PRINCIPLED, "parametrization": "ABSORPTION", "Absorption Coefficient": (0.2, 0.6, 1.5)}),
    ("principled, rough", tufts, {"kind": PRINCIPLED, "Color": BLOND, "Roughness": 0.8, "Radial Roughness": 0.9}),
    ("principled, smooth with a coat", tufts, {"kind": PRINCIPLED, "Color": BLOND, "Roughness": 0.2, "Coat": 0.5, "samples": 256}),
    ("principled, IOR and offset", tufts, {"kind": PRINCIPLED, "Color": BLOND, "IOR": 1.8, "Offset": 0.25}),
    ("principled, random", tufts, {"kind": PRINCIPLED, "parametrization": "MELANIN", "Melanin": 0.4, "Random Color": 0.8, "Random Roughness": 0.5}),
    ("principled, sun behind", sunlit, {"kind": PRINCIPLED, "Color": BLOND, "samples": 512}),
    ("principled, particles", particles, {"kind": PRINCIPLED, "Color": BLOND}),
    ("principled, on a mesh", ball, {"kind": PRINCIPLED, "Color": BLOND}),
    ("reflection", tufts, {"kind": SIMPLE, "Color": BLOND, "RoughnessU": 0.3, "RoughnessV": 0.4}),
    ("reflection, offset", sunlit, {"kind": SIMPLE, "Color": BLOND, "RoughnessU": 0.3, "RoughnessV": 0.4, "Offset": 0.2}),
    ("transmission", sunlit, {"kind": SIMPLE, "component": "Transmission", "Color": BLOND, "RoughnessU": 0.3, "RoughnessV": 0.1, "samples": 128}),
    ("transmission, wide", sunlit, {"kind": SIMPLE, "component": "Transmission", "Color": BLOND, "RoughnessU": 0.3, "RoughnessV": 0.4, "samples": 256}),
    ("reflection, on a mesh", ball, {"kind": SIMPLE, "Color": BLOND, "RoughnessU": 0.3, "RoughnessV": 0.4}),
    ("Is Strand", told, {"name": "Is Strand"}),
    ("Intercept", told, {"name": "Intercept"}),
    ("Length", told, {"name": "Length", "scale": 0.5}),
    ("Thickness", told, {"name": "Thickness", "scale": 10.0}),
    ("Tangent Normal", told, {"name": "Tangent Normal"}),
    ("Random", told, {"name": "Random"}),
    ("Random of particles", told, {"name": "Random", "is_grown": True, "samples": 256}),
    ("Intercept of particles", told, {"name": "Intercept", "is_grown": True}),
)  # fmt: skip
