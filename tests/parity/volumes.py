"""What fills bodies and the world."""

from __future__ import annotations

import importlib
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .rows import table
from .stage import Stage, add_node, find_socket, give, node_tree, output, set_known, shade, sky

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


def light_in_fog(stage: Stage, light: str, density: float = 0.05, anisotropy: float = 0.0) -> None:
    """A light in a fog, and nothing else."""
    stage.clear()
    for thing in (stage.floor, stage.lamp):
        bpy.data.objects.remove(thing)
    stage.scene.world = sky((0.0, 0.0, 0.0))
    fog(stage, "ShaderNodeVolumeScatter", Density=density, Anisotropy=anisotropy)
    if light in ("POINT", "AREA", "SPOT"):
        stage.add_lamp(light, location=(0.0, 0.0, 1.5), energy=100.0)
        return
    add = {
        "panel": bpy.ops.mesh.primitive_plane_add,
        "cube": bpy.ops.mesh.primitive_cube_add,
        "text": bpy.ops.object.text_add,
    }
    add[light](location=(0.0, 0.0, 1.0), rotation=(1.3, 0.0, 0.0))
    glow = shade(bpy.data.materials.new("Row"), "ShaderNodeEmission", Strength=10.0)
    give(bpy.context.object, glow)


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


def texture(
    tree: Any, kind: str, output: str, space: str, low: float, high: float, **values: Any
) -> Any:
    """A texture in these coordinates, stretched from 0 and 1 to these values; its socket."""
    place = add_node(tree, "ShaderNodeTexCoord").outputs[space]
    found = add_node(tree, kind, Vector=place, **values).outputs[output]
    stretched = add_node(tree, "ShaderNodeMapRange", Value=found)
    for name, value in (("To Min", low), ("To Max", high)):
        find_socket(stretched, name).default_value = value
    return stretched.outputs[0]


def textured(
    stage: Stage, kind: str, socket: str, pattern: dict[str, Any], bounces: int = 0, **values: Any
) -> None:
    """A volume in ball and cube with one input that differs from place to place."""
    body(stage, kind, bounces, **values)
    tree: Any = stage.ball.active_material.node_tree
    volume = output(tree).inputs["Volume"].links[0].from_node
    tree.links.new(texture(tree, **pattern), find_socket(volume, socket))


def textured_fog(
    stage: Stage, kind: str, socket: str, pattern: dict[str, Any], **values: Any
) -> None:
    """The same in the world."""
    fog(stage, kind, **values)
    tree: Any = stage.scene.world.node_tree
    volume = output(tree).inputs["Volume"].links[0].from_node
    tree.links.new(texture(tree, **pattern), find_socket(volume, socket))


def flame(stage: Stage) -> None:
    """A Principled Volume that glows by its temperature."""
    volume = "ShaderNodeVolumePrincipled"
    pattern = {
        "kind": "ShaderNodeTexGradient",
        "output": "Fac",
        "space": "Generated",
        "low": 600.0,
        "high": 2400.0,
    }
    textured(stage, volume, "Temperature", pattern, **{"Density": 0.5, "Blackbody Intensity": 1.0})


def openvdb() -> Any:
    """Blender's module for OpenVDB."""
    bpy.utils.expose_bundled_modules()
    return importlib.import_module("openvdb")


def cloud_file() -> str:
    """Write an OpenVDB file with a ball of smoke, hot inside, two metres wide."""
    vdb, points = openvdb(), np.linspace(-1.0, 1.0, 25)
    x, y, z = np.meshgrid(points, points, points, indexing="ij")
    depth = np.clip(1.0 - np.sqrt(x**2 + y**2 + z**2), 0.0, 1.0)
    density, heat = depth * (1.5 + np.sin(6.0 * x)), 2.0 * depth
    color = np.stack([0.5 + 0.5 * z, 0.5 + 0.0 * z, 0.5 - 0.5 * z], axis=-1)
    grids = []
    for kind, name, values in (
        (vdb.FloatGrid, "density", density),
        (vdb.FloatGrid, "temperature", heat),
        (vdb.Vec3SGrid, "color", color),
    ):
        grid = kind()
        grid.copyFromArray(np.ascontiguousarray(values, np.float32))
        grid.name = name
        grid.transform = vdb.createLinearTransform(voxelSize=1.0 / 12.0)
        grid.transform.postTranslate((-1.0, -1.0, -1.0))
        grids.append(grid)
    path = str(Path(tempfile.mkdtemp()) / "cloud.vdb")
    vdb.write(path, grids=grids)
    return path


def volume_object(stage: Stage, shade: str, space: str = "WORLD", scale: float = 1.0) -> None:
    """An OpenVDB file in the place of the ball."""
    data: Any = bpy.data.volumes.new("Cloud")
    data.filepath = cloud_file()
    data.render.space, data.render.precision, data.render.clipping = space, "FULL", 0.0
    cloud = bpy.data.objects.new("Cloud", data)
    stage.scene.collection.objects.link(cloud)
    cloud.location, cloud.scale = stage.ball.location, (scale, scale, scale)
    bpy.data.objects.remove(stage.ball)
    if shade == "default":
        return
    tree = node_tree(bpy.data.materials.new("Row"))
    values: dict[str, Any] = {"Density": 4.0}
    if shade == "fire":
        values |= {"Color Attribute": "color", "Blackbody Intensity": 1.0, "Temperature": 1000.0}
    volume = add_node(tree, "ShaderNodeVolumePrincipled", **values)
    if shade == "attribute":
        info = add_node(tree, "ShaderNodeVolumeInfo")
        color = add_node(tree, "ShaderNodeAttribute", attribute_name="color")
        volume = add_node(
            tree,
            "ShaderNodeVolumeScatter",
            Density=info.outputs["Density"],
            Color=color.outputs["Color"],
        )
    tree.links.new(volume.outputs[0], output(tree).inputs["Volume"])
    give(cloud, next(m for m in bpy.data.materials if m.node_tree == tree))


def mesh_to_volume(stage: Stage) -> None:
    """The cube as a volume that a modifier makes."""
    data = bpy.data.volumes.new("Cloud")
    cloud = bpy.data.objects.new("Cloud", data)
    stage.scene.collection.objects.link(cloud)
    modifier: Any = cloud.modifiers.new("Fill", "MESH_TO_VOLUME")
    modifier.object, modifier.density = stage.cube, 1.5
    stage.cube.hide_render = True


GRADIENT = {
    "kind": "ShaderNodeTexGradient",
    "output": "Fac",
    "space": "Object",
    "low": 0.2,
    "high": 3.0,
}
NOISE = {
    "kind": "ShaderNodeTexNoise",
    "output": "Fac",
    "space": "Object",
    "low": -3.0,
    "high": 5.0,
    "Scale": 2.0,
}
HEIGHT = {
    "kind": "ShaderNodeTexGradient",
    "output": "Fac",
    "space": "Generated",
    "low": 0.05,
    "high": 0.0,
}

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
    ("world, Scatter, a point lamp alone", light_in_fog, {"light": "POINT"}),
    ("world, Scatter, a square lamp alone", light_in_fog, {"light": "AREA"}),
    ("world, Scatter, a glowing panel alone", light_in_fog, {"light": "panel"}),
    ("world, Scatter, a glowing cube alone", light_in_fog, {"light": "cube", "density": 0.5}),
    ("world, Scatter, a glowing text alone", light_in_fog, {"light": "text", "anisotropy": 0.6}),
    ("Scatter, density by a gradient", textured, {"kind": "ShaderNodeVolumeScatter", "socket": "Density", "pattern": GRADIENT}),
    ("Absorption, density by noise", textured, {"kind": "ShaderNodeVolumeAbsorption", "socket": "Density", "pattern": NOISE, "Color": GREEN}),
    ("Principled, density by noise, 4 bounces", textured, {"kind": "ShaderNodeVolumePrincipled", "socket": "Density", "pattern": NOISE, "bounces": 4, "Color": GREEN}),
    ("Emission by a gradient", textured, {"kind": "ShaderNodeEmission", "socket": "Strength", "pattern": GRADIENT | {"space": "Generated", "low": 0.0, "high": 1.0}, "Color": GREEN}),
    ("Principled, blackbody by a gradient", flame),
    ("OpenVDB, default material", volume_object, {"shade": "default"}),
    ("OpenVDB, blackbody", volume_object, {"shade": "fire"}),
    ("OpenVDB, Volume Info and Attribute", volume_object, {"shade": "attribute"}),
    ("OpenVDB, scaled, object space", volume_object, {"shade": "principled", "space": "OBJECT", "scale": 0.5}),
    ("Mesh to Volume", mesh_to_volume),
    ("world, Scatter by noise", textured_fog, {"kind": "ShaderNodeVolumeScatter", "socket": "Density", "pattern": NOISE | {"space": "Generated", "low": -0.1, "high": 0.2, "Scale": 0.5}}),
    ("world, Absorption by height", textured_fog, {"kind": "ShaderNodeVolumeAbsorption", "socket": "Density", "pattern": HEIGHT, "Color": GREEN}),
    ("world, Principled, 2 bounces", fog, {"kind": "ShaderNodeVolumePrincipled", "Density": 0.05, "Anisotropy": 0.3, "bounces": 2}),
)  # fmt: skip
