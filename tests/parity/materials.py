"""Shaders and textures, on the ball."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .rows import table
from .stage import Stage, add_node, give, node_tree, output, plane, set_known, shade

PRINCIPLED = "ShaderNodeBsdfPrincipled"
ORANGE = (0.8, 0.35, 0.1, 1.0)


def shader(stage: Stage, kind: str, **values: Any) -> None:
    """One shader node, on ball and cube."""
    material = shade(bpy.data.materials.new("Row"), kind, **values)
    give(stage.ball, material)
    give(stage.cube, material)


def bare(stage: Stage) -> None:
    """No material at all, which Blender versions show differently."""
    for thing in (stage.ball, stage.cube, stage.floor):
        thing.data.materials.clear()


def principled(stage: Stage, **values: Any) -> None:
    shader(stage, PRINCIPLED, **{"Base Color": ORANGE} | values)


def see_through(stage: Stage, kind: str, **values: Any) -> None:
    """One shader node that light passes, on ball and cube.

    The cube stands off the floor: of two faces in one plane chance says which a ray meets first.
    """
    shader(stage, kind, **values)
    stage.cube.location.z += 0.1


def sheets(stage: Stage, count: int, limit: int = 8) -> None:
    """Panes above all else that shine a little, between it and camera and lamp."""
    for engine in (stage.scene.cycles, getattr(stage.scene, "dualcone", None)):
        set_known(engine, transparent_max_bounces=limit)
    tree = node_tree(bpy.data.materials.new("Row"))
    passing = add_node(tree, "ShaderNodeBsdfTransparent", Color=(0.9, 0.8, 0.7, 1.0))
    shining = add_node(tree, "ShaderNodeEmission", Color=(0.1, 0.2, 0.3, 1.0), Strength=1.0)
    both = add_node(tree, "ShaderNodeAddShader")
    for node, socket in zip((passing, shining), both.inputs, strict=True):
        tree.links.new(node.outputs[0], socket)
    tree.links.new(both.outputs[0], output(tree).inputs["Surface"])
    for layer in range(count):
        pane = plane(4.0)
        pane.location = (0.0, 0.0, 2.1 + 0.1 * layer)
        give(pane, bpy.data.materials["Row"])


def colour(stage: Stage, kind: str, mixed: bool, **values: Any) -> None:
    """A colour in the place of a shader."""
    tree = node_tree(bpy.data.materials.new("Row"))
    node = add_node(tree, kind, **values)
    if mixed:
        both = add_node(tree, "ShaderNodeMixShader", Fac=0.3)
        tree.links.new(add_node(tree, "ShaderNodeBsdfDiffuse").outputs[0], both.inputs[1])
        tree.links.new(node.outputs[0], both.inputs[2])
        node = both
    finish(stage, tree, node)


def not_a_surface(stage: Stage) -> None:
    """A volume's shader added to a surface's."""
    tree = node_tree(bpy.data.materials.new("Row"))
    diffuse = add_node(tree, "ShaderNodeBsdfDiffuse", Color=ORANGE)
    volume = add_node(tree, "ShaderNodeVolumeAbsorption", Density=1.0)
    both = add_node(tree, "ShaderNodeAddShader")
    for node, socket in zip((diffuse, volume), both.inputs, strict=True):
        tree.links.new(node.outputs[0], socket)
    finish(stage, tree, both)


def told_apart(stage: Stage) -> None:
    """Objects, and instances of one of them, that differ by Object Info's Random.

    Few and apart: of many on a ball Blender itself hands out other numbers each time.
    """
    tree = node_tree(bpy.data.materials.new("Row"))
    info = tree.nodes.new("ShaderNodeObjectInfo")
    finish(stage, tree, add_node(tree, "ShaderNodeBsdfDiffuse", Color=info.outputs["Random"]))
    stage.ball.name, stage.cube.name = "Ball", "Würfel"
    corners = plane(3.0)
    corners.location = (0.0, 0.0, 2.4)
    corners.instance_type = "VERTS"
    bpy.ops.mesh.primitive_cube_add(size=0.6)
    leaf = bpy.context.object
    leaf.parent = corners
    give(leaf, bpy.data.materials["Row"])


def opaque_to_lamps(stage: Stage, kind: str, **values: Any) -> None:
    """What lets light pass, but for rays that look for a lamp."""
    see_through(stage, kind, **values)
    for thing in (stage.ball, stage.cube):
        thing.data.materials[0].use_transparent_shadow = False


def glass(stage: Stage, kind: str, **values: Any) -> None:
    """Something that refracts, in light from a large lamp: small ones make caustics of noise."""
    see_through(stage, kind, **values)
    stage.lamp.data.size, stage.lamp.data.energy = 5.0, 500.0


def two_shaders(stage: Stage, kind: str, **values: Any) -> None:
    """Diffuse and glossy, mixed or added."""
    tree = node_tree(bpy.data.materials.new("Row"))
    diffuse = add_node(tree, "ShaderNodeBsdfDiffuse", Color=(0.4, 0.1, 0.1, 1.0))
    glossy = add_node(tree, "ShaderNodeBsdfAnisotropic", Color=(0.4, 0.4, 0.5, 1.0), Roughness=0.3)
    both = add_node(tree, kind, **values)
    for node, socket in zip((diffuse, glossy), both.inputs[-2:], strict=True):
        tree.links.new(node.outputs[0], socket)
    finish(stage, tree, both)


def layered(stage: Stage, kind: str, first: dict[str, Any], second: dict[str, Any]) -> None:
    """Two nodes of one kind, mixed."""
    tree = node_tree(bpy.data.materials.new("Row"))
    both = add_node(tree, "ShaderNodeMixShader", Fac=0.4)
    for values, socket in zip((first, second), both.inputs[1:], strict=True):
        tree.links.new(add_node(tree, kind, **values).outputs[0], socket)
    finish(stage, tree, both)


def turned_normal(stage: Stage, kind: str, corrected: bool = True, **values: Any) -> None:
    """A normal in world space, which most faces turn away from.

    The cube stands off the floor: of two faces in one plane chance says which a ray meets first.
    """
    stage.cube.location.z += 0.1
    tree = node_tree(bpy.data.materials.new("Row"))
    bent = add_node(tree, "ShaderNodeNormalMap", space="WORLD", Color=(0.6, 0.1, 0.8, 1.0))
    finish(stage, tree, add_node(tree, kind, Normal=bent.outputs[0], **values))
    bpy.data.materials["Row"].cycles.use_bump_map_correction = corrected


def uncorrected_bump(stage: Stage) -> None:
    """Steep bumps with Bump Map Correction switched off."""
    fine_bump(stage, Strength=1.0)
    for material in bpy.data.materials:
        material.cycles.use_bump_map_correction = False


def finish(stage: Stage, tree: Any, shader_node: Any) -> None:
    """Make a shader the surface, and give the material to ball, cube and floor."""
    tree.links.new(shader_node.outputs[0], output(tree).inputs["Surface"])
    material = next(m for m in bpy.data.materials if m.node_tree == tree)
    for thing in (stage.ball, stage.cube, stage.floor):
        give(thing, material)


def texture(
    stage: Stage, kind: str, place: str = "Generated", out: int | str = 0, **values: Any
) -> None:
    """A texture as the colour of a diffuse surface."""
    tree = node_tree(bpy.data.materials.new("Row"))
    where = add_node(tree, "ShaderNodeTexCoord").outputs[place]
    node = add_node(tree, kind, Vector=where, **values)
    diffuse = add_node(tree, "ShaderNodeBsdfDiffuse", Color=node.outputs[out])
    finish(stage, tree, diffuse)


def chart() -> bpy.types.Image:
    """Blocks of colours with alpha, 16 x 16."""
    v, u = np.mgrid[0:16, 0:16] / 16.0
    pixels = np.stack([u, v, 1.0 - u, 0.25 + 0.75 * (u > v)], axis=-1).astype(np.float32)
    image = bpy.data.images.new("Chart", 16, 16, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def image(stage: Stage, place: str = "UV", space: str = "sRGB", **values: Any) -> None:
    picture = chart()
    picture.colorspace_settings.name = space
    texture(stage, "ShaderNodeTexImage", place=place, image=picture, **values)


def image_in(stage: Stage, socket: str, out: str = "Color", **values: Any) -> None:
    """An image in one input of Principled."""
    tree = node_tree(bpy.data.materials.new("Row"))
    picture = add_node(tree, "ShaderNodeTexImage", image=chart())
    node = add_node(tree, PRINCIPLED, **{socket: picture.outputs[out]}, **values)
    finish(stage, tree, node)


def bump(stage: Stage, kind: str, **values: Any) -> None:
    """A normal bent by noise (Bump) or by an image (Normal Map)."""
    tree = node_tree(bpy.data.materials.new("Row"))
    if kind == "ShaderNodeBump":
        place = add_node(tree, "ShaderNodeTexCoord").outputs["Object"]
        height = add_node(tree, "ShaderNodeTexNoise", Vector=place, Scale=3.0).outputs[0]
        bent = add_node(tree, kind, Height=height, **values)
    else:
        picture = add_node(tree, "ShaderNodeTexImage", image=chart())
        picture.image.colorspace_settings.name = "Non-Color"
        bent = add_node(tree, kind, Color=picture.outputs["Color"], **values)
    diffuse = add_node(tree, "ShaderNodeBsdfDiffuse", Color=ORANGE, Normal=bent.outputs[0])
    finish(stage, tree, diffuse)


def steep(stage: Stage, kind: str, has_map: bool = True, **values: Any) -> None:
    """A shader whose normal leans by 55 degrees: a mirror there would often look below the surface."""
    for thing in (stage.ball, stage.cube, stage.floor):
        if not has_map:
            thing.data.uv_layers.remove(thing.data.uv_layers[0])
    tree = node_tree(bpy.data.materials.new("Row"))
    bent = add_node(tree, "ShaderNodeNormalMap", Color=(1.0, 0.0, 1.0, 1.0))
    finish(stage, tree, add_node(tree, kind, Normal=bent.outputs[0], **values))


def fine_bump(stage: Stage, **values: Any) -> None:
    """A floor alone, its normal bent by noise far finer than a pixel."""
    stage.clear()
    tree = node_tree(bpy.data.materials.new("Row"))
    place = add_node(tree, "ShaderNodeTexCoord").outputs["Object"]
    noise = add_node(tree, "ShaderNodeTexNoise", Vector=place, Scale=20.0, Detail=9.0)
    bent = add_node(tree, "ShaderNodeBump", Height=noise.outputs[0], Distance=0.1, **values)
    diffuse = add_node(tree, "ShaderNodeBsdfDiffuse", Normal=bent.outputs[0])
    tree.links.new(diffuse.outputs[0], output(tree).inputs["Surface"])
    give(stage.floor, next(m for m in bpy.data.materials if m.node_tree == tree))


def value_in(stage: Stage, kind: str, out: int | str = 0, **values: Any) -> None:
    """A node without coordinates as the colour of a diffuse surface."""
    tree = node_tree(bpy.data.materials.new("Row"))
    node = add_node(tree, kind, **values)
    finish(stage, tree, add_node(tree, "ShaderNodeBsdfDiffuse", Color=node.outputs[out]))


def particle_in(stage: Stage, out: str, scale: float = 1.0) -> None:
    """What Particle Info tells, as light of balls that the ball sends out."""
    modifier = stage.ball.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings: Any = modifier.particle_system.settings
    settings.count, settings.emit_from, settings.use_emit_random = 60, "VERT", False
    settings.frame_start, settings.frame_end, settings.lifetime = 1.0, 10.0, 40.0
    settings.lifetime_random, settings.size_random = 0.5, 0.5
    settings.render_type, settings.particle_size, settings.instance_object = (
        "OBJECT",
        0.12,
        stage.cube,
    )
    stage.cube.location.x -= 1.0
    tree = node_tree(bpy.data.materials.new("Row"))
    info = tree.nodes.new("ShaderNodeParticleInfo")
    length = add_node(tree, "ShaderNodeVectorMath", operation="ABSOLUTE", Vector=info.outputs[out])
    light = add_node(tree, "ShaderNodeEmission", Color=length.outputs[0], Strength=scale)
    tree.links.new(light.outputs[0], output(tree).inputs["Surface"])
    give(stage.cube, bpy.data.materials["Row"])
    stage.scene.frame_end = 12
    bpy.ops.ptcache.bake_all(bake=True)
    stage.scene.frame_set(12)


def occlusion_in(stage: Stage, socket: str, strength: float = 0.0, **values: Any) -> None:
    """What is near, as the colour or the light of a surface."""
    tree = node_tree(bpy.data.materials.new("Row"))
    node = add_node(tree, "ShaderNodeAmbientOcclusion", **values)
    inputs = {socket: node.outputs["Color"], "Emission Strength": strength}
    finish(stage, tree, add_node(tree, PRINCIPLED, **inputs))


def bevelled(stage: Stage, kind: str, **values: Any) -> None:
    """Rounded edges of a cube that stands nearer, and of a cylinder."""
    tree = node_tree(bpy.data.materials.new("Row"))
    bevel = add_node(tree, "ShaderNodeBevel", **values)
    inputs = {"Color": ORANGE, "Normal": bevel.outputs["Normal"]}
    finish(stage, tree, add_node(tree, kind, **inputs))
    stage.cube.location.y -= 1.5
    bpy.data.objects.remove(stage.ball)
    bpy.ops.mesh.primitive_cylinder_add(vertices=12, location=(1.3, -1.0, 1.0))
    stage.ball = bpy.context.object
    give(stage.ball, stage.cube.data.materials[0])


def on_image(stage: Stage, kind: str, socket: str = "Color", out: int = 0, **values: Any) -> None:
    """A node that changes the colours of an image."""
    tree = node_tree(bpy.data.materials.new("Row"))
    picture = add_node(tree, "ShaderNodeTexImage", image=chart())
    node = add_node(tree, kind, **{socket: picture.outputs["Color"]}, **values)
    finish(stage, tree, add_node(tree, "ShaderNodeBsdfDiffuse", Color=node.outputs[out]))


LAYERS = {
    "Base Color": ORANGE,
    "Metallic": 0.3,
    "Transmission Weight": 0.2,
    "Coat Weight": 0.7,
    "Sheen Weight": 0.4,
    "Diffuse Roughness": 0.3,
    "Roughness": 0.4,
}
OTHER_LAYERS = LAYERS | {
    "Base Color": (0.2, 0.3, 0.8, 1.0),
    "Roughness": 0.7,
    "Coat Roughness": 0.2,
}

SHADERS = table(
    "shader",
    ("None", bare),
    ("Principled", principled),
    ("Principled, roughness 0.1", principled, {"Roughness": 0.1}),
    ("Principled, roughness 1", principled, {"Roughness": 1.0}),
    ("Principled, IOR 2", principled, {"IOR": 2.0, "Roughness": 0.3}),
    ("Principled, specular 0", principled, {"Specular IOR Level": 0.0}),
    ("Principled, specular tint", principled, {"Specular Tint": (0.2, 0.9, 0.3, 1.0), "Roughness": 0.3}),
    ("Principled, metal 0.3", principled, {"Metallic": 1.0, "Roughness": 0.3}),
    ("Principled, metal 0.7", principled, {"Metallic": 1.0, "Roughness": 0.7}),
    ("Principled, metal, edge tint", principled, {"Metallic": 1.0, "Specular Tint": (0.2, 0.9, 0.3, 1.0)}),
    ("Principled, half metal", principled, {"Metallic": 0.5, "Roughness": 0.4}),
    ("Principled, anisotropic", principled, {"Metallic": 1.0, "Roughness": 0.4, "Anisotropic": 0.8}),
    ("Principled, coat", principled, {"Coat Weight": 1.0, "Coat Roughness": 0.1}),
    ("Principled, tinted coat", principled, {"Coat Weight": 1.0, "Coat Roughness": 0.3, "Coat Tint": (0.9, 0.5, 0.2, 1.0)}),
    ("Principled, light below a coat", principled, {"Coat Weight": 1.0, "Coat Roughness": 0.2, "Coat Tint": (0.9, 0.5, 0.2, 1.0), "Emission Color": (1.0, 1.0, 1.0, 1.0), "Emission Strength": 1.0}),
    ("Principled, light below sheen and coat", principled, {"Sheen Weight": 0.8, "Sheen Roughness": 0.4, "Sheen Tint": ORANGE, "Coat Weight": 0.5, "Emission Color": (1.0, 1.0, 1.0, 1.0), "Emission Strength": 1.0}),
    ("Principled, sheen", principled, {"Sheen Weight": 1.0, "Sheen Roughness": 0.4}),
    ("Principled, subsurface", principled, {"Subsurface Weight": 1.0, "Subsurface Radius": (0.3, 0.1, 0.05)}),
    ("Principled, subsurface, wide", principled, {"Subsurface Weight": 1.0, "Subsurface Scale": 1.0}),
    ("Principled, subsurface, half, rough", principled, {"Subsurface Weight": 0.5, "Subsurface Scale": 1.0, "Roughness": 1.0}),
    ("Principled, subsurface, anisotropy 0.7", principled, {"Subsurface Weight": 1.0, "Subsurface Scale": 1.0, "Subsurface Anisotropy": 0.7}),
    ("Principled, subsurface, skin", principled, {"Subsurface Weight": 1.0, "Subsurface Scale": 0.5, "subsurface_method": "RANDOM_WALK_SKIN"}),
    # Light leaves the cube on its lower side, too: it stands off the floor.
    ("Principled, subsurface, Burley", see_through, {"kind": PRINCIPLED, "Base Color": ORANGE, "Subsurface Weight": 1.0, "Subsurface Radius": (0.3, 0.1, 0.05), "subsurface_method": "BURLEY"}),
    ("Principled, subsurface, Burley, wide", see_through, {"kind": PRINCIPLED, "Base Color": ORANGE, "Subsurface Weight": 1.0, "Subsurface Scale": 1.0, "subsurface_method": "BURLEY"}),
    ("Principled, subsurface, Burley, half, very wide", see_through, {"kind": PRINCIPLED, "Base Color": ORANGE, "Subsurface Weight": 0.5, "Subsurface Scale": 4.0, "Roughness": 1.0, "subsurface_method": "BURLEY"}),
    ("Principled, alpha 0.4", see_through, {"kind": PRINCIPLED, "Base Color": ORANGE, "Alpha": 0.4}),
    ("Principled, emission", principled, {"Emission Color": ORANGE, "Emission Strength": 2.0}),
    ("Principled, thin film", principled, {"Metallic": 1.0, "Roughness": 0.3, "Thin Film Thickness": 500.0}),
    ("Principled, thin film, smooth metal, edge tint", principled, {"Metallic": 1.0, "Roughness": 0.0, "Thin Film Thickness": 300.0, "Thin Film IOR": 1.8, "Specular Tint": (0.2, 0.9, 0.3, 1.0)}),
    ("Principled, thin film over a colour", principled, {"Roughness": 0.2, "Thin Film Thickness": 400.0, "Thin Film IOR": 2.0}),
    ("Principled, thin film over a colour, rough, tinted", principled, {"Roughness": 0.6, "Thin Film Thickness": 250.0, "Thin Film IOR": 1.8, "Specular Tint": (0.2, 0.9, 0.3, 1.0), "Specular IOR Level": 1.0}),
    ("Principled, thin film over half metal below a coat", principled, {"Metallic": 0.5, "Roughness": 0.4, "Thin Film Thickness": 600.0, "Thin Film IOR": 1.6, "Coat Weight": 0.5}),
    ("Principled, thin film, transmission", glass, {"kind": PRINCIPLED, "Transmission Weight": 1.0, "Roughness": 0.1, "Base Color": ORANGE, "Thin Film Thickness": 450.0, "Thin Film IOR": 2.0}),
    ("Principled, IOR 0.6", principled, {"IOR": 0.6, "Roughness": 0.3}),
    ("Principled, two of many layers", layered, {"kind": PRINCIPLED, "first": LAYERS, "second": OTHER_LAYERS}),
    ("Principled, rough diffuse", principled, {"Diffuse Roughness": 0.8}),
    ("Principled, transmission", glass, {"kind": PRINCIPLED, "Transmission Weight": 1.0, "Roughness": 0.0}),
    ("Principled, rough transmission", glass, {"kind": PRINCIPLED, "Transmission Weight": 1.0, "Roughness": 0.4, "Base Color": ORANGE}),
    ("Diffuse, rough", shader, {"kind": "ShaderNodeBsdfDiffuse", "Color": ORANGE, "Roughness": 0.8}),
    ("Glossy, roughness 0", shader, {"kind": "ShaderNodeBsdfAnisotropic", "Color": ORANGE, "Roughness": 0.0}),
    ("Glossy, roughness 0.3", shader, {"kind": "ShaderNodeBsdfAnisotropic", "Color": ORANGE, "Roughness": 0.3}),
    ("Glossy, GGX alone", shader, {"kind": "ShaderNodeBsdfAnisotropic", "distribution": "GGX", "Roughness": 0.8}),
    ("Glossy, Beckmann", shader, {"kind": "ShaderNodeBsdfAnisotropic", "distribution": "BECKMANN", "Roughness": 0.4}),
    ("Glossy, Beckmann, anisotropic", shader, {"kind": "ShaderNodeBsdfAnisotropic", "distribution": "BECKMANN", "Roughness": 0.5, "Anisotropy": 0.6}),
    ("Glossy, anisotropic", shader, {"kind": "ShaderNodeBsdfAnisotropic", "Roughness": 0.4, "Anisotropy": 0.7}),
    ("Glass", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.0, "IOR": 1.45}),
    ("Glass, rough", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.3, "IOR": 1.45}),
    ("Glass, roughness 0.8", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.8, "IOR": 1.45}),
    ("Glass, GGX alone", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.8, "distribution": "GGX"}),
    ("Glass, Beckmann", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.5, "distribution": "BECKMANN"}),
    ("Glass, thin film", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.0, "IOR": 1.45, "Thin Film Thickness": 350.0, "Thin Film IOR": 2.0}),
    ("Glass, thin film, rough", glass, {"kind": "ShaderNodeBsdfGlass", "Roughness": 0.4, "IOR": 1.45, "Thin Film Thickness": 550.0, "Thin Film IOR": 1.8}),
    ("Refraction, GGX", glass, {"kind": "ShaderNodeBsdfRefraction", "Roughness": 0.2, "IOR": 1.3, "distribution": "GGX"}),
    ("Refraction", glass, {"kind": "ShaderNodeBsdfRefraction", "Roughness": 0.2, "IOR": 1.3}),
    ("Translucent", see_through, {"kind": "ShaderNodeBsdfTranslucent", "Color": ORANGE}),
    ("Transparent", see_through, {"kind": "ShaderNodeBsdfTransparent", "Color": (0.8, 0.4, 0.6, 1.0)}),
    ("Transparent, opaque shadow", opaque_to_lamps, {"kind": "ShaderNodeBsdfTransparent", "Color": (0.8, 0.4, 0.6, 1.0)}),
    ("Principled, alpha 0.4, opaque shadow", opaque_to_lamps, {"kind": PRINCIPLED, "Base Color": ORANGE, "Alpha": 0.4}),
    ("Emission", shader, {"kind": "ShaderNodeEmission", "Color": ORANGE, "Strength": 3.0}),
    ("Sheen", shader, {"kind": "ShaderNodeBsdfSheen", "Color": ORANGE, "Roughness": 0.4}),
    ("Sheen, Ashikhmin", shader, {"kind": "ShaderNodeBsdfSheen", "distribution": "ASHIKHMIN", "Color": ORANGE, "Roughness": 0.4}),
    ("Sheen, Ashikhmin, rough", shader, {"kind": "ShaderNodeBsdfSheen", "distribution": "ASHIKHMIN", "Color": ORANGE, "Roughness": 0.9}),
    ("Toon", shader, {"kind": "ShaderNodeBsdfToon", "Color": ORANGE, "Size": 0.5, "Smooth": 0.2}),
    ("Toon, hard", shader, {"kind": "ShaderNodeBsdfToon", "Color": ORANGE, "Size": 0.7, "Smooth": 0.0}),
    ("Toon, glossy", shader, {"kind": "ShaderNodeBsdfToon", "component": "GLOSSY", "Size": 0.3, "Smooth": 0.1}),
    ("Metallic", shader, {"kind": "ShaderNodeBsdfMetallic", "Roughness": 0.3}),
    ("Metallic, conductor", shader, {"kind": "ShaderNodeBsdfMetallic", "fresnel_type": "PHYSICAL_CONDUCTOR", "Roughness": 0.3, "IOR": (0.2, 1.0, 2.0), "Extinction": (3.0, 2.0, 1.0)}),
    ("Metallic, Beckmann", shader, {"kind": "ShaderNodeBsdfMetallic", "distribution": "BECKMANN", "Roughness": 0.4, "Anisotropy": 0.5}),
    ("Metallic, thin film", shader, {"kind": "ShaderNodeBsdfMetallic", "Roughness": 0.2, "Thin Film Thickness": 500.0, "Thin Film IOR": 1.6}),
    ("Metallic, thin film, conductor", shader, {"kind": "ShaderNodeBsdfMetallic", "fresnel_type": "PHYSICAL_CONDUCTOR", "Roughness": 0.2, "IOR": (0.2, 1.0, 2.0), "Extinction": (3.0, 2.0, 1.0), "Thin Film Thickness": 350.0, "Thin Film IOR": 1.5}),
    ("Subsurface Scattering", shader, {"kind": "ShaderNodeSubsurfaceScattering", "Scale": 0.1}),
    ("Subsurface Scattering, wide", shader, {"kind": "ShaderNodeSubsurfaceScattering", "Scale": 1.0}),
    ("Subsurface Scattering, skin", shader, {"kind": "ShaderNodeSubsurfaceScattering", "Scale": 0.3, "falloff": "RANDOM_WALK_SKIN"}),
    ("Subsurface Scattering, Burley", see_through, {"kind": "ShaderNodeSubsurfaceScattering", "Scale": 1.0, "falloff": "BURLEY"}),
    ("Subsurface Scattering, two", layered, {"kind": "ShaderNodeSubsurfaceScattering", "first": {"Color": ORANGE, "Scale": 0.1}, "second": {"Color": (0.2, 0.7, 0.9, 1.0), "Scale": 0.6, "falloff": "RANDOM_WALK_SKIN"}}),
    ("Emission, below zero", shader, {"kind": "ShaderNodeEmission", "Color": ORANGE, "Strength": -0.1}),
    ("Diffuse, turned normal", turned_normal, {"kind": "ShaderNodeBsdfDiffuse"}),
    ("Translucent, turned normal", turned_normal, {"kind": "ShaderNodeBsdfTranslucent"}),
    ("Glossy, turned normal", turned_normal, {"kind": "ShaderNodeBsdfAnisotropic", "Roughness": 0.4}),
    ("Principled, turned normal", turned_normal, {"kind": PRINCIPLED}),
    ("Principled, turned normal, no correction", turned_normal, {"kind": PRINCIPLED, "corrected": False}),
    ("bumps without correction", uncorrected_bump),
    ("Holdout", shader, {"kind": "ShaderNodeHoldout"}),
    ("Mix Shader", two_shaders, {"kind": "ShaderNodeMixShader", "Fac": 0.4}),
    ("Add Shader", two_shaders, {"kind": "ShaderNodeAddShader"}),
    ("a colour as shader", colour, {"kind": "ShaderNodeRGB", "mixed": False}),
    ("a texture as shader, mixed", colour, {"kind": "ShaderNodeTexChecker", "mixed": True, "Scale": 6.0}),
    ("a volume shader as surface", not_a_surface, {}),
    ("sheets, 5", sheets, {"count": 5}),
    ("sheets, 5, limit 5", sheets, {"count": 5, "limit": 5}),
    ("sheets, 5, limit 10", sheets, {"count": 5, "limit": 10}),
    ("sheets, 5, limit 3", sheets, {"count": 5, "limit": 3}),
)  # fmt: skip

TEXTURES = table(
    "texture",
    ("Image", image),
    ("Image, Closest", image, {"interpolation": "Closest"}),
    ("Image, Cubic", image, {"interpolation": "Cubic"}),
    ("Image, Non-Color", image, {"space": "Non-Color"}),
    ("Image, Generated", image, {"place": "Generated"}),
    ("Image, Extend", image, {"place": "Object", "extension": "EXTEND"}),
    ("Image, Clip", image, {"place": "Object", "extension": "CLIP"}),
    ("Image, Mirror", image, {"place": "Object", "extension": "MIRROR"}),
    ("Image, box", image, {"place": "Generated", "projection": "BOX", "projection_blend": 0.3}),
    ("Image, sphere", image, {"place": "Object", "projection": "SPHERE"}),
    ("Image in Base Color", image_in, {"socket": "Base Color"}),
    ("Image in Roughness", image_in, {"socket": "Roughness", "Metallic": 1.0}),
    ("Image in Metallic", image_in, {"socket": "Metallic"}),
    ("Image in Alpha", image_in, {"socket": "Alpha", "out": "Alpha"}),
    ("Image in Emission", image_in, {"socket": "Emission Color", "Emission Strength": 1.0}),
    ("Normal Map", bump, {"kind": "ShaderNodeNormalMap", "Strength": 0.5}),
    ("Normal Map, steep, glossy", steep, {"kind": "ShaderNodeBsdfAnisotropic", "Roughness": 0.4}),
    ("Normal Map, steep, subsurface", steep, {"kind": "ShaderNodeSubsurfaceScattering", "Scale": 0.1}),
    ("Normal Map, steep, without UV map", steep, {"kind": "ShaderNodeBsdfDiffuse", "has_map": False}),
    ("Bump", bump, {"kind": "ShaderNodeBump", "Strength": 0.5}),
    ("Bump, finer than a pixel", fine_bump, {"Filter Width": 0.1}),
    ("Bump, finer than a pixel, Filter Width 1", fine_bump, {"Filter Width": 1.0}),
    ("Noise", texture, {"kind": "ShaderNodeTexNoise", "Scale": 4.0, "out": "Color"}),
    ("Noise, Object", texture, {"kind": "ShaderNodeTexNoise", "Scale": 2.0, "Distortion": 0.5, "place": "Object"}),
    ("Voronoi", texture, {"kind": "ShaderNodeTexVoronoi", "Scale": 5.0, "out": "Color"}),
    ("Wave", texture, {"kind": "ShaderNodeTexWave", "Scale": 3.0, "Distortion": 2.0}),
    ("Magic", texture, {"kind": "ShaderNodeTexMagic", "Scale": 3.0}),
    ("Checker", texture, {"kind": "ShaderNodeTexChecker", "Scale": 6.0}),
    ("Brick", texture, {"kind": "ShaderNodeTexBrick", "Scale": 4.0}),
    ("Gradient", texture, {"kind": "ShaderNodeTexGradient"}),
    ("White Noise", texture, {"kind": "ShaderNodeTexWhiteNoise", "out": "Color"}),
    ("White Noise without a vector", value_in, {"kind": "ShaderNodeTexWhiteNoise", "out": "Color"}),
    ("Fresnel", value_in, {"kind": "ShaderNodeFresnel", "IOR": 1.45}),
    ("Layer Weight", value_in, {"kind": "ShaderNodeLayerWeight", "out": "Facing", "Blend": 0.4}),
    ("Normal", value_in, {"kind": "ShaderNodeNewGeometry", "out": "Normal"}),
    ("Object Info, Location", value_in, {"kind": "ShaderNodeObjectInfo", "out": "Location"}),
    ("Object Info, Random", told_apart, {}),
    ("Camera Data", value_in, {"kind": "ShaderNodeCameraData", "out": "View Vector"}),
    ("Blackbody", value_in, {"kind": "ShaderNodeBlackbody", "Temperature": 3000.0}),
    ("Ambient Occlusion", occlusion_in, {"socket": "Base Color", "Color": ORANGE}),
    ("Ambient Occlusion, inside", occlusion_in, {"socket": "Base Color", "inside": True, "Distance": 0.5}),
    ("Ambient Occlusion, only local", occlusion_in, {"socket": "Base Color", "only_local": True, "inside": True, "Distance": 1.0}),
    ("Ambient Occlusion, emission", occlusion_in, {"socket": "Emission Color", "strength": 1.0, "Distance": 2.0}),
    ("Bevel", bevelled, {"kind": "ShaderNodeBsdfDiffuse", "Radius": 0.3}),
    ("Bevel, many samples", bevelled, {"kind": "ShaderNodeBsdfDiffuse", "Radius": 0.5, "samples": 16}),
    ("Bevel, glossy", bevelled, {"kind": "ShaderNodeBsdfAnisotropic", "Radius": 0.3}),
    ("Wireframe", value_in, {"kind": "ShaderNodeWireframe", "Size": 0.1}),
    ("Wireframe, pixels", value_in, {"kind": "ShaderNodeWireframe", "use_pixel_size": True, "Size": 1.5}),
    ("Particle Info, index", particle_in, {"out": "Index", "scale": 0.02}),
    ("Particle Info, random", particle_in, {"out": "Random"}),
    ("Particle Info, age", particle_in, {"out": "Age", "scale": 0.1}),
    ("Particle Info, velocity", particle_in, {"out": "Velocity", "scale": 0.3}),
    ("Hue/Saturation", on_image, {"kind": "ShaderNodeHueSaturation", "Hue": 0.7, "Saturation": 0.5}),
    ("Gamma", on_image, {"kind": "ShaderNodeGamma", "Gamma": 2.0}),
    ("Invert", on_image, {"kind": "ShaderNodeInvert"}),
    ("Bright/Contrast", on_image, {"kind": "ShaderNodeBrightContrast", "Bright": 0.1, "Contrast": 0.5}),
    ("Color Ramp", on_image, {"kind": "ShaderNodeValToRGB", "socket": "Fac"}),
    ("Math", on_image, {"kind": "ShaderNodeMath", "socket": "Value", "operation": "SINE"}),
    ("Map Range", on_image, {"kind": "ShaderNodeMapRange", "socket": "Value", "From Max": 0.5}),
)  # fmt: skip

ROWS = SHADERS + TEXTURES
