"""What fills bodies and the world."""

from __future__ import annotations

from typing import Any

import bpy

from .rows import table
from .stage import Stage, add_node, give, node_tree, output, set_known

GREEN = (0.3, 0.8, 0.4, 1.0)


def limit(stage: Stage, bounces: int) -> None:
    """Let light bounce in volumes, beyond the first time."""
    for engine in (stage.scene.cycles, getattr(stage.scene, "dualcone", None)):
        set_known(engine, volume_bounces=bounces)


def body(stage: Stage, kind: str, bounces: int = 0, surface: str = "", **values: Any) -> None:
    """A volume in ball and cube, behind a surface or bare."""
    limit(stage, bounces)
    tree = node_tree(bpy.data.materials.new("Row"))
    volume = add_node(tree, kind, **values)
    tree.links.new(volume.outputs[0], output(tree).inputs["Volume"])
    if surface:
        shader = add_node(tree, surface, Roughness=0.0, IOR=1.3)
        tree.links.new(shader.outputs[0], output(tree).inputs["Surface"])
        stage.lamp.data.size, stage.lamp.data.energy = 5.0, 500.0
    material = next(m for m in bpy.data.materials if m.node_tree == tree)
    give(stage.ball, material)
    give(stage.cube, material)
    # Of two faces in one plane chance says which a ray meets first.
    stage.cube.location.z += 0.1
    stage.ball.location.z += 0.1


def fog(stage: Stage, kind: str, bounces: int = 0, **values: Any) -> None:
    """A volume in the world."""
    limit(stage, bounces)
    tree: Any = stage.scene.world.node_tree
    volume = add_node(tree, kind, **values)
    tree.links.new(volume.outputs[0], output(tree).inputs["Volume"])


def both(stage: Stage) -> None:
    """Scattering and absorption, added, within a fog."""
    body(stage, "ShaderNodeVolumeScatter", Density=1.0)
    tree: Any = stage.ball.active_material.node_tree
    scatter = output(tree).inputs["Volume"].links[0].from_node
    absorb = add_node(tree, "ShaderNodeVolumeAbsorption", Color=GREEN, Density=1.0)
    added = add_node(tree, "ShaderNodeAddShader")
    for node, socket in zip((scatter, absorb), added.inputs, strict=True):
        tree.links.new(node.outputs[0], socket)
    tree.links.new(added.outputs[0], output(tree).inputs["Volume"])
    fog(stage, "ShaderNodeVolumeScatter", Density=0.02)


ROWS = table(
    "volume",
    ("Absorption", body, {"kind": "ShaderNodeVolumeAbsorption", "Color": GREEN, "Density": 1.0}),
    ("Absorption in glass", body, {"kind": "ShaderNodeVolumeAbsorption", "Color": GREEN, "Density": 1.0, "surface": "ShaderNodeBsdfGlass"}),
    ("Scatter", body, {"kind": "ShaderNodeVolumeScatter", "Color": GREEN, "Density": 1.0}),
    ("Scatter, anisotropy 0.6", body, {"kind": "ShaderNodeVolumeScatter", "Density": 1.0, "Anisotropy": 0.6}),
    ("Scatter, 4 bounces", body, {"kind": "ShaderNodeVolumeScatter", "Color": GREEN, "Density": 2.0, "bounces": 4}),
    ("Principled", body, {"kind": "ShaderNodeVolumePrincipled", "Color": GREEN, "Density": 1.0}),
    ("Principled, emission", body, {"kind": "ShaderNodeVolumePrincipled", "Density": 0.5, "Emission Color": GREEN, "Emission Strength": 1.0}),
    ("Scatter and Absorption in fog", both),
    ("world, Scatter", fog, {"kind": "ShaderNodeVolumeScatter", "Density": 0.03}),
    ("world, Absorption", fog, {"kind": "ShaderNodeVolumeAbsorption", "Color": GREEN, "Density": 0.1}),
    ("world, Principled, 2 bounces", fog, {"kind": "ShaderNodeVolumePrincipled", "Density": 0.05, "Anisotropy": 0.3, "bounces": 2}),
)  # fmt: skip
