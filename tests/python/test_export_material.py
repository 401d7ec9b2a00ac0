"""Materials: node trees to closures, and a warning for whatever they leave out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import add_camera, add_material, add_mesh, add_object, export_now, scene

import dualcone


@pytest.fixture(autouse=True)
def camera() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_camera()


def node(tree: Any, kind: str, **inputs: Any) -> Any:
    """Add a node with values for its inputs, by identifier with underscores for spaces."""
    made = tree.nodes.new(kind)
    for name, value in inputs.items():
        socket = socket_of(made, name)
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return made


def socket_of(made: Any, identifier: str) -> Any:
    return next(s for s in made.inputs if s.identifier.replace(" ", "_") == identifier)


NUMBER = r"-?[\d.]+(?:e-?\d+)?"


@dataclass
class Closure:
    """What the renderer prints of a closure."""

    kind: str
    values: dict[str, Any]

    @classmethod
    def parse(cls, text: str) -> Closure:
        """Read Rust's debug output: numbers, and vectors of three."""
        values: dict[str, Any] = {}
        vector = rf"Vec3A\(({NUMBER}), ({NUMBER}), ({NUMBER})\)"
        for match in re.finditer(rf"(\w+): (?:{vector}|({NUMBER}))", text):
            name, *xyz, number = match.groups()
            values[name] = float(number) if number else [float(x) for x in xyz]
        for name, word in re.findall(r"(\w+): (true|false)", text):
            values[name] = word == "true"
        values |= re.findall(r"(\w*method): (\w+)", text)
        plain = re.fullmatch(rf"\w+\({vector}\)", text)
        if plain:
            values["color"] = [float(x) for x in plain.groups()]
        return cls(re.split(r"\W", text, maxsplit=1)[0], values)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]


class Core:
    """The renderer itself."""

    Mesh, Image = dualcone.Mesh, dualcone.Image
    operations = staticmethod(dualcone.operations)


def computed(frame: Any, material: int, uv: tuple[float, float]) -> list[Closure]:
    """The closures of a material at a texture coordinate."""
    made = dualcone.SceneFrame(1, frame.meshes, frame.images, frame.arrays)
    return [Closure.parse(text) for text in made.closures(material, uv)]


def closures_of(
    build: Any, name: str = "Wood", uv: tuple[float, float] = (0.25, 0.5)
) -> tuple[list[Closure], list[str]]:
    """Export one object with the material that `build(tree)` makes: its closures and warnings."""
    owner = add_mesh()
    owner.data.materials.append(add_material(name, build))
    frame = export_now(core=Core())
    (material,) = frame.arrays["slot_materials"]
    return computed(frame, material, uv), frame.warnings


def colors_of(frame: Any) -> list[list[float]]:
    """The colour of the one closure of each material."""
    count = len(frame.arrays["material_programs"])
    closures = [computed(frame, row, (0.0, 0.0))[0].values for row in range(count)]
    return [values["color" if "color" in values else "base_color"] for values in closures]


def diffuse(tree: Any, *color: float) -> Any:
    return node(tree, "ShaderNodeBsdfDiffuse", Color=(*color, 1.0)).outputs[0]


def test_principled_reads_all_it_can() -> None:
    def build(tree: Any) -> Any:
        return node(
            tree,
            "ShaderNodeBsdfPrincipled",
            Base_Color=(0.1, 0.2, 0.3, 1),
            Metallic=0.25,
            Roughness=0.75,
            IOR=1.25,
            Specular_IOR_Level=0.125,
            Alpha=0.5,
            Emission_Color=(0.5, 1, 0.25, 1),
            Emission_Strength=4.0,
        ).outputs[0]

    (closure, light, passing), warnings = closures_of(build)
    assert warnings == []
    assert closure.kind == "Principled"
    assert np.allclose(closure["base_color"], (0.1, 0.2, 0.3))
    expected = {"metallic": 0.25, "roughness": 0.75, "ior": 1.25, "specular_ior_level": 0.125}
    assert {key: closure[key] for key in expected} == expected
    assert closure["weight"] == 0.5
    assert (light.kind, light["color"]) == ("Emission", [1.0, 2.0, 0.5])
    assert (passing.kind, passing["color"]) == ("Transparent", [0.5, 0.5, 0.5])


def test_the_simple_shaders() -> None:
    cases = {
        "Diffuse": ("ShaderNodeBsdfDiffuse", {"Color": (0.5, 0.25, 0, 1)}),
        "Glossy": ("ShaderNodeBsdfAnisotropic", {"Color": (0.5, 0.25, 0, 1), "Roughness": 0.25}),
        "Emission": ("ShaderNodeEmission", {"Color": (0.5, 0.25, 0, 1), "Strength": 2.0}),
        "Transparent": ("ShaderNodeBsdfTransparent", {"Color": (0.5, 0.25, 0, 1)}),
    }
    for kind, (name, inputs) in cases.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        add_camera()
        (closure,), warnings = closures_of(
            lambda tree, name=name, inputs=inputs: node(tree, name, **inputs).outputs[0]
        )
        assert warnings == []
        assert closure.kind == kind
        assert closure["color"] == ([1.0, 0.5, 0.0] if kind == "Emission" else [0.5, 0.25, 0.0])
        assert kind != "Glossy" or closure["roughness"] == 0.25


def test_weights_multiply_through_mix_and_add() -> None:
    def build(tree: Any) -> Any:
        inner = node(
            tree,
            "ShaderNodeMixShader",
            Fac=0.25,
            Shader=diffuse(tree, 1, 0, 0),
            Shader_001=diffuse(tree, 0, 1, 0),
        )
        added = node(
            tree, "ShaderNodeAddShader", Shader=inner.outputs[0], Shader_001=diffuse(tree, 0, 0, 1)
        )
        factor = node(tree, "ShaderNodeValue")
        factor.outputs[0].default_value = 0.5
        outer = node(
            tree,
            "ShaderNodeMixShader",
            Fac=factor.outputs[0],
            Shader_001=added.outputs[0],
        )
        return outer.outputs[0]

    closures, warnings = closures_of(build)
    assert warnings == []
    weights = {tuple(closure["color"]): closure["weight"] for closure in closures}
    assert weights == {(1, 0, 0): 0.375, (0, 1, 0): 0.125, (0, 0, 1): 0.5}


def test_links_are_followed_through_groups_reroutes_and_mutes() -> None:
    def build(tree: Any) -> Any:
        group: Any = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Rough", in_out="INPUT", socket_type="NodeSocketFloat")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        inside, outside = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        glossy = node(
            group,
            "ShaderNodeBsdfAnisotropic",
            Color=inside.outputs["Tint"],
            Roughness=inside.outputs["Rough"],
        )
        group.links.new(glossy.outputs[0], outside.inputs[0])
        instance = tree.nodes.new("ShaderNodeGroup")
        instance.node_tree = group
        instance.inputs["Rough"].default_value = 0.125
        rgb, reroute = node(tree, "ShaderNodeRGB"), tree.nodes.new("NodeReroute")
        rgb.outputs[0].default_value = (0.25, 0.5, 1, 1)
        muted = tree.nodes.new("ShaderNodeInvert")
        muted.mute = True
        tree.links.new(rgb.outputs[0], muted.inputs["Color"])
        tree.links.new(muted.outputs[0], reroute.inputs[0])
        tree.links.new(reroute.outputs[0], instance.inputs["Tint"])
        return instance.outputs[0]

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert closure.kind == "Glossy"
    assert closure["color"] == [0.25, 0.5, 1.0]
    assert closure["roughness"] == 0.125


NO_GLASS_FILM = pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="films of Blender 5.0")


@pytest.mark.parametrize(
    "kind",
    [
        "ShaderNodeBsdfPrincipled",
        pytest.param("ShaderNodeBsdfGlass", marks=NO_GLASS_FILM),
        pytest.param("ShaderNodeBsdfMetallic", marks=NO_GLASS_FILM),
    ],
)
def test_films_lie_on_metals_since_blender_5(kind: str) -> None:
    def build(tree: Any) -> Any:
        return node(tree, kind, Thin_Film_Thickness=300.0, Thin_Film_IOR=1.5).outputs[0]

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert (closure["thin_film_thickness"], closure["thin_film_ior"]) == (300.0, 1.5)
    if "Principled" in kind:
        assert closure["has_filmed_metal"] == (bpy.app.version >= (5, 0, 0))


def test_displacement_bends_normals_or_moves_vertices_and_volumes_are_no_surface() -> None:
    def build(tree: Any) -> Any:
        output = tree.nodes["Material Output"]
        wave = node(tree, "ShaderNodeTexWave")
        moved = node(tree, "ShaderNodeDisplacement", Height=wave.outputs["Fac"])
        tree.links.new(moved.outputs[0], output.inputs["Displacement"])
        volume = node(tree, "ShaderNodeVolumeScatter")
        tree.links.new(volume.outputs[0], output.inputs["Volume"])
        return diffuse(tree, 1, 1, 1)

    (own, closure), warnings = closures_of(build)
    assert warnings == []
    assert own.kind == "Normal"
    assert closure["normal"] != [0.0, 0.0, 0.0]
    for method, kinds in (("DISPLACEMENT", ["Diffuse"]), ("BOTH", ["Normal", "Diffuse"])):
        bpy.data.materials["Wood"].displacement_method = method
        frame = export_now(core=Core())
        assert frame.warnings == []
        (material,) = frame.arrays["slot_materials"]
        assert [closure.kind for closure in computed(frame, material, (0.2, 0.5))] == kinds


def test_a_texture_without_an_image_is_magenta_and_numbers_stay_finite() -> None:
    def build(tree: Any) -> Any:
        missing = tree.nodes.new("ShaderNodeTexImage")
        huge = node(tree, "ShaderNodeValue")
        huge.outputs[0].default_value = float("nan")
        return node(
            tree,
            "ShaderNodeBsdfPrincipled",
            Base_Color=missing.outputs["Color"],
            Roughness=huge.outputs[0],
        ).outputs[0]

    (closure,), warnings = closures_of(build)
    assert closure["base_color"] == [1.0, 0.0, 1.0]
    assert closure["roughness"] == 0.0
    assert warnings == ["'Wood': an Image Texture has no image, magenta is shown"]


def test_nodes_of_unknown_type_are_named_and_default() -> None:
    def build(tree: Any) -> Any:
        point = node(tree, "ShaderNodePointInfo")
        return node(tree, "ShaderNodeBsdfPrincipled", Base_Color=point.outputs["Random"]).outputs[0]

    (closure,), warnings = closures_of(build)
    assert np.allclose(closure["base_color"], 0.8)
    assert warnings == [
        "'Wood': Point Info in Base Color is not rendered yet (its default value is used)"
    ]


def test_an_unknown_shader_is_named_and_stands_in_as_diffuse() -> None:
    def build(tree: Any) -> Any:
        return node(tree, "ShaderNodeBsdfRayPortal", Color=(1, 0.5, 0.25, 1)).outputs[0]

    (closure,), warnings = closures_of(build)
    assert (closure.kind, closure["color"]) == ("Diffuse", [1.0, 0.5, 0.25])
    assert warnings == ["'Wood': Ray Portal BSDF is not rendered yet (a diffuse surface is shown)"]


def test_a_colour_in_a_shaders_place_glows() -> None:
    """As in Cycles, which puts an Emission in between."""

    def image(tree: Any) -> Any:
        return node(tree, "ShaderNodeTexGradient").outputs[0]

    def constant(tree: Any) -> Any:
        made = tree.nodes.new("ShaderNodeRGB")
        made.outputs[0].default_value = (0.5, 0.25, 0.125, 1.0)
        return made.outputs[0]

    def mixed(tree: Any) -> Any:
        both = node(tree, "ShaderNodeMixShader", Fac=0.25)
        tree.links.new(constant(tree), both.inputs[2])
        return both.outputs[0]

    half = [0.5, 0.25, 0.125]
    cases = {image: [0.25] * 3, constant: half, mixed: [0.25 * x for x in half]}
    for build, expected in cases.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        add_camera()
        (light,), warnings = closures_of(build)
        assert (light.kind, light["color"], warnings) == ("Emission", expected, [])


def test_a_volumes_shader_does_nothing_to_a_surface() -> None:
    def build(tree: Any) -> Any:
        both = node(tree, "ShaderNodeAddShader")
        tree.links.new(diffuse(tree, 0.5, 0.25, 0.0), both.inputs[0])
        tree.links.new(node(tree, "ShaderNodeVolumeAbsorption").outputs[0], both.inputs[1])
        return both.outputs[0]

    (closure,), warnings = closures_of(build)
    assert (closure.kind, warnings) == ("Diffuse", [])


def test_shadows_are_as_transparent_as_the_material_says() -> None:
    def build(tree: Any) -> Any:
        return node(tree, "ShaderNodeBsdfTransparent").outputs[0]

    owner = add_mesh()
    opaque, fog, clear = (add_material(name, build) for name in ("Opaque", "Fog", "Clear"))
    with_volume(fog.node_tree, node(fog.node_tree, "ShaderNodeVolumeScatter"))
    fog.node_tree.links.remove(fog.node_tree.get_output_node("ALL").inputs["Surface"].links[0])
    for material in (opaque, fog, clear):
        owner.data.materials.append(material)
        material.use_transparent_shadow = material is clear
    arrays = export_now(core=Core()).arrays
    said = arrays["material_transparent_shadow"][arrays["slot_materials"]]
    assert said.tolist() == [0, 1, 1]


def test_distributions_beyond_are_named() -> None:
    def build(tree: Any) -> Any:
        brushed = node(tree, "ShaderNodeBsdfAnisotropic", Anisotropy=0.5)
        brushed.distribution = "ASHIKHMIN_SHIRLEY"
        cloth = node(tree, "ShaderNodeBsdfSheen")
        cloth.distribution = "ASHIKHMIN"  # known: said by the closure
        return node(
            tree, "ShaderNodeAddShader", Shader=brushed.outputs[0], Shader_001=cloth.outputs[0]
        ).outputs[0]

    (glossy, cloth), warnings = closures_of(build)
    assert glossy["anisotropy"] == 0.5
    assert cloth["is_velvet"] is True
    assert warnings == ["'Wood': Ashikhmin-Shirley distribution is not rendered yet (GGX is used)"]


@pytest.mark.skipif(bpy.app.version < (4, 3, 0), reason="Metallic BSDF came with Blender 4.3")
@pytest.mark.parametrize("known_by", ["PHYSICAL_CONDUCTOR", "F82"])
def test_a_metal_is_known_by_its_index_or_by_its_colours(known_by: str) -> None:
    def build(tree: Any) -> Any:
        metal = node(
            tree,
            "ShaderNodeBsdfMetallic",
            IOR=(0.25, 1.0, 2.0),
            Extinction=(3.0, 2.0, 1.0),
            Base_Color=(0.5, 0.25, 0.125, 1.0),
            Edge_Tint=(1.0, 0.5, 0.25, 1.0),
        )
        metal.fresnel_type, metal.distribution = known_by, "BECKMANN"
        return metal.outputs[0]

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert closure.kind == "Metallic"
    colors = {"base": [0.5, 0.25, 0.125], "edge_tint": [1.0, 0.5, 0.25]}
    indices = {"index": [0.25, 1.0, 2.0], "extinction": [3.0, 2.0, 1.0]}
    expected, other = (colors, indices) if known_by == "F82" else (indices, colors)
    assert {key: closure[key] for key in expected} == expected
    assert closure.values.keys().isdisjoint(other)


def test_a_grain_without_a_tangent_runs_around_the_objects_axis() -> None:
    def build(tree: Any) -> Any:
        return node(tree, "ShaderNodeBsdfPrincipled", Anisotropic=0.5).outputs[0]

    (closure,), _ = closures_of(build, uv=(0.75, 0.5))
    assert np.allclose(closure["tangent"], (0.0, 1.0, 0.0))


def test_no_material_and_no_surface() -> None:
    add_mesh("Bare")
    empty = add_mesh("Black", size=2.0)
    empty.data.materials.append(add_material("Black", lambda tree: diffuse(tree, 1, 1, 1)))
    tree = empty.data.materials[0].node_tree
    tree.links.clear()
    frame = export_now(core=Core())
    assert computed(frame, 1, (0.0, 0.0)) == []
    (bare,) = computed(frame, 0, (0.0, 0.0))
    assert bare.kind == ("Principled" if bpy.app.version >= (5, 0, 0) else "Diffuse")
    assert np.allclose(bare["base_color" if bare.kind == "Principled" else "color"], 0.8)


def test_slots_of_mesh_and_object() -> None:
    red = add_material("Red", lambda tree: diffuse(tree, 1, 0, 0))
    blue = add_material("Blue", lambda tree: diffuse(tree, 0, 0, 1))
    owner = add_mesh()
    for material in (red, None):
        owner.data.materials.append(material)
    owner.data.polygons[1].material_index = 1
    twin = add_object("Twin", owner.data)
    twin.material_slots[0].link = "OBJECT"
    twin.material_slots[0].material = blue
    frame = export_now()
    assert len(frame.meshes) == 1
    assert frame.meshes[0].material_slots.tolist() == [0, 0, 1]
    frame = export_now(core=Core())
    colors, arrays = colors_of(frame), frame.arrays
    found = [
        [colors[row] for row in arrays["slot_materials"][first : first + count]]
        for first, count in arrays["instance_slots"]
    ]
    assert np.allclose(sorted(found), [[[0, 0, 1], [0.8] * 3], [[1, 0, 0], [0.8] * 3]])


def test_a_view_layers_material_override_wins() -> None:
    owner = add_mesh()
    owner.data.materials.append(add_material("Red", lambda tree: diffuse(tree, 1, 0, 0)))
    layer = scene().view_layers[0]
    layer.material_override = add_material("Blue", lambda tree: diffuse(tree, 0, 0, 1))
    assert colors_of(export_now(core=Core())) == [[0.0, 0.0, 1.0]]


def test_keyed_values_are_those_of_the_frame() -> None:
    owner = add_mesh()
    owner.data.materials.append(add_material("Red", lambda tree: diffuse(tree, 1, 0, 0)))
    tree = owner.data.materials[0].node_tree
    socket = next(n for n in tree.nodes if "Diffuse" in n.bl_idname).inputs["Color"]
    for frame, value in ((1, 0.0), (5, 1.0)):
        socket.default_value = (value, value, value, 1)
        socket.keyframe_insert("default_value", frame=frame)
    for frame, value in ((1, 0.0), (5, 1.0)):
        scene().frame_set(frame)
        assert colors_of(export_now(core=Core())) == [[value] * 3]


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="materials always use nodes from 5.0 on")
def test_a_material_without_nodes_shows_its_viewport_colour() -> None:
    owner = add_mesh()
    material: Any = bpy.data.materials.new("Plain")
    material.diffuse_color = (0.25, 0.5, 1, 1)
    owner.data.materials.append(material)
    assert colors_of(export_now(core=Core())) == [[0.25, 0.5, 1.0]]


def add_image(name: str = "Image") -> Any:
    image: Any = bpy.data.images.new(name, 2, 1, alpha=True, float_buffer=True)
    image.pixels[:] = (1.0, 0.5, 0.25, 0.5, 0.0, 0.5, 0.75, 1.0)
    image.alpha_mode = "CHANNEL_PACKED"
    return image


def texture(tree: Any, image: Any, **properties: Any) -> Any:
    made = tree.nodes.new("ShaderNodeTexImage")
    made.image = image
    for key, value in properties.items():
        setattr(made, key, value)
    return made


def test_images_of_colour_roughness_and_alpha() -> None:
    image = add_image()

    def build(tree: Any) -> Any:
        made = texture(tree, image, extension="CLIP", interpolation="Closest")
        separate = node(tree, "ShaderNodeSeparateColor", Color=made.outputs["Color"])
        return node(
            tree,
            "ShaderNodeBsdfPrincipled",
            Base_Color=made.outputs["Color"],
            Roughness=separate.outputs[1],
            Metallic=separate.outputs[2],
            Emission_Color=made.outputs["Color"],
            Emission_Strength=2.0,
            Alpha=made.outputs["Alpha"],
        ).outputs[0]

    (closure, light, passing), warnings = closures_of(build)
    assert warnings == []
    assert len(export_now().images) == 1
    assert closure["base_color"] == [1.0, 0.5, 0.25]
    assert (closure["roughness"], closure["metallic"]) == (0.5, 0.25)
    assert closure["weight"] == 0.5
    assert light["color"] == [1.0, 0.5, 0.25]
    assert passing["color"] == [0.5] * 3


def test_smart_interpolation_is_cubic_as_in_cycles() -> None:
    image = add_image()

    def build(tree: Any) -> Any:
        made = texture(tree, image, projection="BOX", extension="MIRROR", interpolation="Smart")
        return node(tree, "ShaderNodeBsdfDiffuse", Color=made.outputs["Color"]).outputs[0]

    _, warnings = closures_of(build)
    assert warnings == []
    (made,) = export_now().images
    assert (made.extension, made.interpolation) == ("MIRROR", "Cubic")


def test_a_group_that_contains_itself_is_named() -> None:
    """Blender refuses to make one, files may hold one: the walk is tested without a file."""
    tree: Any = bpy.data.node_groups.new("Loop", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    if group.node_tree is None:
        pytest.skip("this version of Blender does not let groups contain themselves")
    inside = tree.nodes.new("NodeGroupOutput")
    tree.links.new(group.outputs[0], inside.inputs[0])

    def build(material: Any) -> Any:
        instance = material.nodes.new("ShaderNodeGroup")
        instance.node_tree = tree
        return instance.outputs[0]

    closures, warnings = closures_of(build)
    assert closures == []
    assert warnings == ["'Wood': the node group 'Loop' contains itself, it is shown in black"]


@pytest.mark.parametrize("name", ["", "Active", "Other"])
def test_a_uv_map_by_name(name: str) -> None:
    image = add_image()

    def build(tree: Any) -> Any:
        made, uv = texture(tree, image), tree.nodes.new("ShaderNodeUVMap")
        uv.uv_map = name
        tree.links.new(uv.outputs[0], made.inputs[0])
        return node(tree, "ShaderNodeBsdfDiffuse", Color=made.outputs["Color"]).outputs[0]

    owner = add_mesh()
    owner.data.uv_layers.new(name="Other")
    owner.data.uv_layers.new(name="Active").active_render = True
    owner.data.materials.append(add_material("Wood", build))
    frame = export_now()
    assert frame.warnings == []
    assert len(frame.meshes[0].layer_keys) == (1 if name else 0)


METHODS = {"RANDOM_WALK": "Plain", "RANDOM_WALK_SKIN": "Skin", "BURLEY": "Burley"}


@pytest.mark.parametrize("method", METHODS)
def test_subsurface_scattering_is_handed_over(method: str) -> None:
    def build(tree: Any) -> Any:
        shader = node(tree, "ShaderNodeSubsurfaceScattering")
        shader.falloff = method
        socket_of(shader, "Scale").default_value = 0.25
        return shader.outputs[0]

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert closure.kind == "Subsurface"
    assert closure["scale"] == 0.25
    assert closure["method"] == METHODS[method]


@pytest.mark.parametrize("method", METHODS)
def test_principled_says_how_light_scatters_below(method: str) -> None:
    def build(tree: Any) -> Any:
        shader = node(tree, "ShaderNodeBsdfPrincipled", Subsurface_Weight=0.5)
        shader.subsurface_method = method
        return shader.outputs[0]

    (closure, *_), warnings = closures_of(build)
    assert warnings == []
    assert closure["subsurface_method"] == METHODS[method]


def with_volume(tree: Any, volume: Any) -> None:
    """Make a node the volume of a material without a surface."""
    tree.links.new(volume.outputs[0], tree.nodes["Material Output"].inputs["Volume"])


def test_a_bare_volume_lets_light_pass() -> None:
    def build(tree: Any) -> None:
        with_volume(tree, node(tree, "ShaderNodeVolumeAbsorption", Density=2.0))

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert closure.kind == "Transparent"


@pytest.mark.parametrize(
    ("kind", "output"),
    [
        ("ShaderNodeTexWave", "Fac"),
        ("ShaderNodeLayerWeight", "Facing"),
        ("ShaderNodeVolumeInfo", "Density"),
        ("ShaderNodeAttribute", "Fac"),
    ],
)
def test_volumes_have_textures_and_ask_meshes_for_no_layers(kind: str, output: str) -> None:
    def build(tree: Any) -> None:
        factor = node(tree, kind).outputs[output]
        with_volume(tree, node(tree, "ShaderNodeVolumeScatter", Density=factor))

    _, warnings = closures_of(build)
    assert warnings == []


def test_a_volume_without_grids_is_what_its_numbers_say() -> None:
    """Principled Volume names a grid of density: the product of the numbers is taken before."""

    def build(tree: Any) -> None:
        values = {"Density": 3.0, "Color": (0.1, 0.2, 0.3, 1.0)}
        volume = node(tree, "ShaderNodeVolumePrincipled")
        for name, value in values.items():
            volume.inputs[name].default_value = value
        with_volume(tree, volume)

    owner = add_mesh()
    owner.data.materials.append(add_material("Smoke", build))
    frame = export_now()
    first = frame.arrays["program_constants"][0]
    assert first == pytest.approx([0.3, 0.6, 0.9])
    assert frame.meshes[0].grids == {}


def test_a_value_in_a_volume_may_go_many_ways() -> None:
    """Each sum reads the one before twice: two to the power of forty ways lead to the first."""

    def build(tree: Any) -> None:
        value = node(tree, "ShaderNodeValToRGB").outputs["Color"]
        for _ in range(40):
            sums = node(tree, "ShaderNodeMath")
            tree.links.new(value, sums.inputs[0])
            tree.links.new(value, sums.inputs[1])
            value = sums.outputs[0]
        with_volume(tree, node(tree, "ShaderNodeVolumeScatter", Density=value))

    _, warnings = closures_of(build)
    assert warnings == []
