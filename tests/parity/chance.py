"""Scenes that chance makes: meshes with materials of random nodes, lamps, a world and settings."""

from __future__ import annotations

import math
import random
from typing import Any

import bpy

Socket = Any
Node = Any

# How deep a graph may get below its shader.
DEPTH = 3
SHADERS = (
    "ShaderNodeBsdfPrincipled",
    "ShaderNodeBsdfDiffuse",
    "ShaderNodeBsdfAnisotropic",
    "ShaderNodeBsdfMetallic",
    "ShaderNodeBsdfGlass",
    "ShaderNodeBsdfRefraction",
    "ShaderNodeBsdfTranslucent",
    "ShaderNodeBsdfTransparent",
    "ShaderNodeBsdfSheen",
    "ShaderNodeBsdfToon",
    "ShaderNodeSubsurfaceScattering",
    "ShaderNodeEmission",
)
# What may give a value or a colour, and what a vector; None is for coordinates.
TEXTURES = (
    "ShaderNodeTexNoise",
    "ShaderNodeTexVoronoi",
    "ShaderNodeTexWave",
    "ShaderNodeTexMagic",
    "ShaderNodeTexChecker",
    "ShaderNodeTexBrick",
    "ShaderNodeTexGradient",
    "ShaderNodeTexWhiteNoise",
)
INPUTS = (
    "ShaderNodeNewGeometry",
    "ShaderNodeTexCoord",
    "ShaderNodeObjectInfo",
    "ShaderNodeLayerWeight",
    "ShaderNodeFresnel",
    "ShaderNodeLightPath",
    "ShaderNodeCameraData",
    "ShaderNodeVertexColor",
    "ShaderNodeWireframe",
    "ShaderNodeTangent",
    "ShaderNodeUVMap",
    "ShaderNodeBlackbody",
    "ShaderNodeWavelength",
)
CONVERTERS = (
    "ShaderNodeMath",
    "ShaderNodeVectorMath",
    "ShaderNodeMix",
    "ShaderNodeMapRange",
    "ShaderNodeClamp",
    "ShaderNodeValToRGB",
    "ShaderNodeRGBCurve",
    "ShaderNodeVectorCurve",
    "ShaderNodeFloatCurve",
    "ShaderNodeHueSaturation",
    "ShaderNodeBrightContrast",
    "ShaderNodeGamma",
    "ShaderNodeInvert",
    "ShaderNodeSeparateColor",
    "ShaderNodeCombineColor",
    "ShaderNodeSeparateXYZ",
    "ShaderNodeCombineXYZ",
    "ShaderNodeRGBToBW",
    "ShaderNodeMapping",
    "ShaderNodeVectorRotate",
    "ShaderNodeVectorTransform",
    "ShaderNodeNormal",
    "ShaderNodeBump",
    "ShaderNodeNormalMap",
)
# What is a node's own but changes no picture.
NO_CHOICES = {"color_tag", "warning_propagation", "from_instancer", "bl_icon", "is_active_output"}
# Between these a number is drawn whose socket has the name.
RANGES = {
    "Scale": (0.5, 6.0),
    "Detail": (0.0, 4.0),
    "Roughness": (0.0, 1.0),
    "Coat Roughness": (0.0, 1.0),
    "Lacunarity": (1.5, 3.0),
    "Distortion": (0.0, 2.0),
    "IOR": (1.05, 2.2),
    "Coat IOR": (1.05, 2.2),
    "Strength": (0.0, 1.5),
    "Emission Strength": (0.0, 0.5),
    "Temperature": (1500.0, 9000.0),
    "Wavelength": (400.0, 700.0),
    "Gamma": (0.5, 2.0),
    "Thin Film Thickness": (0.0, 900.0),
    "Thin Film IOR": (1.05, 2.2),
    "Subsurface IOR": (1.05, 2.2),
    "Size": (0.0, 0.5),
    "Subsurface Scale": (0.05, 0.5),
    "Distance": (0.05, 0.5),
}


class Maker:
    """Makes a scene from a seed."""

    def __init__(self, seed: int, links: float) -> None:
        self.chance = random.Random(seed)
        self.links = links

    def build(self) -> Any:
        """Return a new scene, in place of whatever was open."""
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene: Any = bpy.context.scene
        self._floor()
        for _ in range(self.chance.randint(1, 3)):
            self._thing()
        for _ in range(self.chance.randint(1, 2)):
            self._lamp(scene)
        self._world(scene)
        self._camera(scene)
        self._settings(scene)
        return scene

    def _maybe(self, share: float = 0.07) -> bool:
        return self.chance.random() < share

    def _settings(self, scene: Any) -> None:
        """What scene, camera, things and lamps may have beside their defaults, now and then."""
        chance, cycles, render = self.chance, scene.cycles, scene.render
        render.film_transparent = self._maybe()
        for name in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
            if self._maybe():
                setattr(cycles, f"{name}_bounces", chance.randint(0, 3))
        data = scene.camera.data
        data.type, data.ortho_scale = "ORTHO" if self._maybe() else "PERSP", 6.0
        data.dof.use_dof = self._maybe()
        data.dof.focus_distance, data.dof.aperture_fstop = 7.0, 0.3
        render.use_border = self._maybe()
        render.border_min_x, render.border_max_y = 0.3, 0.8
        cycles.film_exposure = 2.0 if self._maybe() else 1.0
        for thing in scene.objects:
            self._flags(scene, thing)

    def _flags(self, scene: Any, thing: Any) -> None:
        """Which rays see a thing, and what else it does."""
        for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
            if self._maybe(0.02):
                setattr(thing, f"visible_{ray}", False)
        if thing.type == "MESH":
            thing.is_holdout, thing.is_shadow_catcher = self._maybe(0.03), self._maybe(0.03)
            self._move(scene, thing)
        elif thing.type == "LIGHT":
            thing.data.use_shadow = not self._maybe(0.04)
            thing.data.cycles.max_bounces = self.chance.randint(0, 2) if self._maybe() else 1024

    def _move(self, scene: Any, thing: Any) -> None:
        """Mirror a thing, copy it, or let it move while the shutter is open."""
        if self._maybe(0.05):
            thing.scale.x *= -1.0
        if self._maybe(0.05):
            copies = thing.modifiers.new("Array", "ARRAY")
            copies.count, copies.relative_offset_displace = 2, (0.5, 0.9, 0.3)
        if self._maybe(0.05):
            scene.render.use_motion_blur = True
            for frame in (0, 2):
                thing.location.x += 0.2 * frame
                thing.keyframe_insert("location", frame=frame)

    def _floor(self) -> None:
        bpy.ops.mesh.primitive_plane_add(size=8.0)
        self._dress(bpy.context.object)

    def _thing(self) -> None:
        chance, ops = self.chance, bpy.ops.mesh
        where = (chance.uniform(-1.6, 1.6), chance.uniform(-1.6, 1.6), chance.uniform(0.5, 1.3))
        turn = tuple(chance.uniform(0.0, 6.0) for _ in range(3))
        kind = chance.choice(("cube", "uv_sphere", "torus", "cylinder", "monkey", "ico_sphere"))
        getattr(ops, f"primitive_{kind}_add")(location=where, rotation=turn)
        thing: Any = bpy.context.object
        thing.scale = tuple(chance.uniform(0.4, 0.9) for _ in range(3))
        if kind == "cube":
            self._colors(thing)
        if chance.random() < 0.5:
            bpy.ops.object.shade_smooth()
        if chance.random() < 0.3:
            thing.modifiers.new("Subdivision", "SUBSURF").levels = 1
        self._dress(thing)

    def _colors(self, thing: Any) -> None:
        colors = thing.data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
        for item in colors.data:
            item.color = (*(self.chance.random() for _ in range(3)), 1.0)

    def _dress(self, thing: Any) -> None:
        material: Any = bpy.data.materials.new(thing.name)
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        out = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(self._shader(tree, 0).outputs[0], out.inputs["Surface"])
        if self.chance.random() < 0.1:
            bump = tree.nodes.new("ShaderNodeDisplacement")
            bump.inputs["Scale"].default_value = 0.1
            self._feed(tree, bump.inputs["Height"], 1, always=True)
            tree.links.new(bump.outputs[0], out.inputs["Displacement"])
        thing.data.materials.append(material)

    def _shader(self, tree: Any, depth: int) -> Node:
        roll = self.chance.random()
        if depth < 2 and roll < 0.25:
            node = self._new(
                tree, self.chance.choice(("ShaderNodeMixShader", "ShaderNodeAddShader"))
            )
            shaders = [socket for socket in node.inputs if socket.type == "SHADER"]
            for socket in shaders:
                tree.links.new(self._shader(tree, depth + 1).outputs[0], socket)
            if node.bl_idname == "ShaderNodeMixShader":
                node.inputs[0].default_value = self.chance.random()
                self._feed(tree, node.inputs[0], 1)
            return node
        kinds = [name for name in SHADERS if hasattr(bpy.types, name)]
        kind = kinds[0] if self.chance.random() < 0.5 else self.chance.choice(kinds)
        return self._filled(tree, kind, 0)

    def _new(self, tree: Any, kind: str) -> Node:
        return tree.nodes.new(kind)

    def _filled(self, tree: Any, kind: str, depth: int) -> Node:
        node = self._new(tree, kind)
        self._choose(node)
        for socket in list(node.inputs):
            if socket.enabled and socket.type != "SHADER":
                self._feed(tree, socket, depth + 1)
        return node

    def _choose(self, node: Node) -> None:
        """Set the node's own choices."""
        for prop in node.bl_rna.properties:
            own = prop.identifier not in bpy.types.Node.bl_rna.properties
            if prop.is_readonly or not own or prop.identifier in NO_CHOICES:
                continue
            if self.chance.random() < 0.5:
                continue
            try:
                if prop.type == "ENUM":
                    items = [item.identifier for item in prop.enum_items]
                    value = self.chance.choice(items)
                    setattr(node, prop.identifier, value)
                elif prop.type == "BOOLEAN":
                    setattr(node, prop.identifier, self.chance.random() < 0.5)
            except (TypeError, AttributeError):
                pass  # a choice that this Blender does not offer here
        for curve in getattr(getattr(node, "mapping", None), "curves", ()):
            curve.points.new(0.4, self.chance.random())
        if hasattr(getattr(node, "mapping", None), "update"):
            node.mapping.update()

    def _feed(self, tree: Any, socket: Socket, depth: int, always: bool = False) -> None:
        """Give a socket a value or a node."""
        chance = self.chance
        is_normal = socket.name in ("Normal", "Coat Normal", "Tangent")
        likely = 0.5 * self.links if is_normal else self.links
        if depth <= DEPTH and (always or chance.random() < likely):
            self._link(tree, socket, depth, is_normal)
        elif not socket.hide_value and chance.random() < 0.6:
            self._set(socket)

    def _link(self, tree: Any, socket: Socket, depth: int, is_normal: bool) -> None:
        if is_normal:
            kinds: tuple[str, ...] = ("ShaderNodeBump", "ShaderNodeNormalMap")
        else:
            kinds = self.chance.choice((TEXTURES, TEXTURES, INPUTS, CONVERTERS))
        kinds = tuple(kind for kind in kinds if hasattr(bpy.types, kind))
        node = self._filled(tree, self.chance.choice(kinds), depth)
        outputs = [out for out in node.outputs if out.enabled and out.type != "SHADER"]
        if outputs:
            out = self.chance.choice(outputs)
            tree.links.new(out, socket)

    def _set(self, socket: Socket) -> None:
        chance = self.chance
        if socket.type == "RGBA":
            socket.default_value = (*(chance.random() for _ in range(3)), 1.0)
        elif socket.type == "VECTOR":
            values = [chance.uniform(0.0, 2.0) for _ in socket.default_value]
            socket.default_value = values
        elif socket.type == "VALUE":
            prop = socket.bl_rna.properties["default_value"]
            low, high = RANGES.get(socket.name, (max(prop.soft_min, -2.0), min(prop.soft_max, 2.0)))
            if socket.name not in RANGES and socket.bl_idname.endswith("Factor"):
                low, high = 0.0, 1.0
            socket.default_value = chance.uniform(low, high)

    def _lamp(self, scene: Any) -> None:
        chance = self.chance
        kind = chance.choice(("POINT", "SUN", "SPOT", "AREA"))
        data: Any = bpy.data.lights.new(kind, kind)
        data.energy = chance.uniform(1.0, 4.0) * (1.0 if kind == "SUN" else 100.0)
        data.color = tuple(chance.uniform(0.5, 1.0) for _ in range(3))
        if kind == "SUN":
            data.angle = chance.uniform(0.0, 0.3)
        elif kind == "AREA":
            data.shape = chance.choice(("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"))
            data.size, data.size_y = chance.uniform(0.3, 2.0), chance.uniform(0.3, 2.0)
            data.spread = chance.choice((math.pi, chance.uniform(0.5, 3.0)))
        else:
            data.shadow_soft_size = chance.choice((0.0, chance.uniform(0.05, 0.5)))
        if kind == "SPOT":
            data.spot_size, data.spot_blend = chance.uniform(0.5, 2.0), chance.random()
        lamp: Any = bpy.data.objects.new(kind, data)
        lamp.location = (chance.uniform(-3, 3), chance.uniform(-3, 3), chance.uniform(2.5, 4.0))
        lamp.rotation_euler = (chance.uniform(-0.6, 0.6), chance.uniform(-0.6, 0.6), 0.0)
        scene.collection.objects.link(lamp)

    def _world(self, scene: Any) -> None:
        world: Any = bpy.data.worlds.new("World")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        background = world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*(self.chance.random() for _ in range(3)), 1.0)
        background.inputs["Strength"].default_value = self.chance.choice((0.0, 0.4, 1.0))
        scene.world = world

    def _camera(self, scene: Any) -> None:
        camera: Any = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.location = (0.0, -7.0, 4.0)
        camera.rotation_euler = (1.08, 0.0, 0.0)
        scene.collection.objects.link(camera)
        scene.camera = camera
