"""Materials: node trees to closures, and a warning for whatever they leave out."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import add_camera, add_material, add_mesh, add_object, export_now, scene

PRINCIPLED, DIFFUSE, GLOSSY, EMISSION, TRANSPARENT = range(5)


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


def closures_of(build: Any, name: str = "Wood") -> tuple[list[dict[str, Any]], list[str]]:
    """Export one object with the material that `build(tree)` makes: its closures and warnings."""
    owner = add_mesh()
    owner.data.materials.append(add_material(name, build))
    frame = export_now()
    arrays = frame.arrays
    (material,) = arrays["slot_materials"]
    first, count = arrays["material_closures"][material]
    names = [key for key in arrays if key.startswith("closure_")]
    rows = range(first, first + count)
    return [{key[8:]: arrays[key][row].tolist() for key in names} for row in rows], frame.warnings


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

    (closure,), warnings = closures_of(build)
    assert warnings == []
    assert closure["kind"] == PRINCIPLED
    assert closure["weight"] == 1.0
    assert np.allclose(closure["color"], (0.1, 0.2, 0.3))
    assert closure["emission"] == [2.0, 4.0, 1.0]
    expected = {"metallic": 0.25, "roughness": 0.75, "ior": 1.25, "specular": 0.125, "alpha": 0.5}
    assert {key: closure[key] for key in expected} == expected
    assert [closure[f"{key}_image"] for key in ("color", "roughness", "alpha")] == [-1, -1, -1]


def test_the_simple_shaders() -> None:
    cases = {
        DIFFUSE: ("ShaderNodeBsdfDiffuse", {"Color": (0.5, 0.25, 0, 1)}),
        GLOSSY: ("ShaderNodeBsdfAnisotropic", {"Color": (0.5, 0.25, 0, 1), "Roughness": 0.25}),
        EMISSION: ("ShaderNodeEmission", {"Color": (0.5, 0.25, 0, 1), "Strength": 2.0}),
        TRANSPARENT: ("ShaderNodeBsdfTransparent", {"Color": (0.5, 0.25, 0, 1)}),
    }
    for kind, (name, inputs) in cases.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        add_camera()
        (closure,), warnings = closures_of(
            lambda tree, name=name, inputs=inputs: node(tree, name, **inputs).outputs[0]
        )
        assert warnings == []
        assert closure["kind"] == kind
        color = [0.0, 0.0, 0.0] if kind == EMISSION else [0.5, 0.25, 0.0]
        assert closure["color"] == color
        assert closure["emission"] == ([1.0, 0.5, 0.0] if kind == EMISSION else [0.0] * 3)
        assert kind != GLOSSY or closure["roughness"] == 0.25


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
    assert closure["kind"] == GLOSSY
    assert closure["color"] == [0.25, 0.5, 1.0]
    assert closure["roughness"] == 0.125


LEFT_OUT = [
    ("Subsurface Weight", "Subsurface"),
    ("Transmission Weight", "Transmission"),
    ("Coat Weight", "Coat"),
    ("Sheen Weight", "Sheen"),
    ("Anisotropic", "Anisotropic"),
    ("Thin Film Thickness", "Thin Film"),
]


@pytest.mark.parametrize(("identifier", "what"), LEFT_OUT)
def test_what_principled_does_beyond_is_named_once(identifier: str, what: str) -> None:
    def build(tree: Any) -> Any:
        shader = node(tree, "ShaderNodeBsdfPrincipled")
        socket_of(shader, identifier.replace(" ", "_")).default_value = 0.5
        return shader.outputs[0]

    _, warnings = closures_of(build, "Glass Panel")
    assert warnings == [f"'Glass Panel': {what} is not rendered yet"]
    twin = add_mesh("Twin")
    twin.data.materials.append(bpy.data.materials["Glass Panel"])
    assert export_now().warnings == warnings


def test_normals_volumes_and_displacement_are_named() -> None:
    def build(tree: Any) -> Any:
        bump = node(tree, "ShaderNodeBump")
        shader = node(tree, "ShaderNodeBsdfPrincipled", Normal=bump.outputs[0])
        output = tree.nodes["Material Output"]
        for kind, name in (
            ("ShaderNodeVolumeScatter", "Volume"),
            ("ShaderNodeDisplacement", "Displacement"),
        ):
            tree.links.new(node(tree, kind).outputs[0], output.inputs[name])
        return shader.outputs[0]

    _, warnings = closures_of(build)
    assert warnings == [
        "'Wood': Volume is not rendered yet",
        "'Wood': Displacement is not rendered yet",
        "'Wood': Bump is not rendered yet",
    ]


def test_textures_without_pixels_are_named_and_default() -> None:
    def build(tree: Any) -> Any:
        noise = node(tree, "ShaderNodeTexNoise")
        return node(tree, "ShaderNodeBsdfPrincipled", Base_Color=noise.outputs["Color"]).outputs[0]

    (closure,), warnings = closures_of(build)
    assert np.allclose(closure["color"], 0.8)
    assert warnings == [
        "'Wood': Noise Texture in Base Color is not rendered yet (its default value is used)"
    ]


def test_an_unknown_shader_is_named_and_stands_in_as_diffuse() -> None:
    def build(tree: Any) -> Any:
        return node(tree, "ShaderNodeBsdfGlass", Color=(1, 0.5, 0.25, 1)).outputs[0]

    (closure,), warnings = closures_of(build)
    assert (closure["kind"], closure["color"]) == (DIFFUSE, [1.0, 0.5, 0.25])
    assert warnings == ["'Wood': Glass BSDF is not rendered yet (a diffuse surface is shown)"]


def test_details_of_diffuse_and_glossy_are_named() -> None:
    def build(tree: Any) -> Any:
        rough = node(tree, "ShaderNodeBsdfDiffuse", Roughness=0.5)
        brushed = node(tree, "ShaderNodeBsdfAnisotropic", Anisotropy=0.5)
        brushed.distribution = "BECKMANN"
        return node(
            tree, "ShaderNodeAddShader", Shader=rough.outputs[0], Shader_001=brushed.outputs[0]
        ).outputs[0]

    _, warnings = closures_of(build)
    assert warnings == [
        "'Wood': Roughness of Diffuse BSDF is not rendered yet",
        "'Wood': Anisotropy is not rendered yet",
        "'Wood': Beckmann distribution is not rendered yet (GGX is used)",
    ]


def test_no_material_and_no_surface() -> None:
    add_mesh("Bare")
    empty = add_mesh("Black", size=2.0)
    empty.data.materials.append(add_material("Black", lambda tree: diffuse(tree, 1, 1, 1)))
    tree = empty.data.materials[0].node_tree
    tree.links.clear()
    arrays = export_now().arrays
    assert arrays["material_closures"].tolist() == [[0, 1], [1, 0]]
    assert arrays["closure_kind"].tolist() == [DIFFUSE]
    assert np.allclose(arrays["closure_color"], 0.8)


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
    arrays = frame.arrays
    assert len(frame.meshes) == 1
    assert frame.meshes[0].material_slots.tolist() == [0, 0, 1]
    colors = []
    for first, count in arrays["instance_slots"]:
        rows = arrays["material_closures"][arrays["slot_materials"][first : first + count], 0]
        colors.append(np.round(arrays["closure_color"][rows], 3).tolist())
    assert np.allclose(sorted(colors), [[[0, 0, 1], [0.8] * 3], [[1, 0, 0], [0.8] * 3]])


def test_a_view_layers_material_override_wins() -> None:
    owner = add_mesh()
    owner.data.materials.append(add_material("Red", lambda tree: diffuse(tree, 1, 0, 0)))
    layer = scene().view_layers[0]
    layer.material_override = add_material("Blue", lambda tree: diffuse(tree, 0, 0, 1))
    assert export_now().arrays["closure_color"].tolist() == [[0.0, 0.0, 1.0]]


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
        assert export_now().arrays["closure_color"].tolist() == [[value] * 3]


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="materials always use nodes from 5.0 on")
def test_a_material_without_nodes_shows_its_viewport_colour() -> None:
    owner = add_mesh()
    material: Any = bpy.data.materials.new("Plain")
    material.diffuse_color = (0.25, 0.5, 1, 1)
    owner.data.materials.append(material)
    arrays = export_now().arrays
    assert arrays["closure_kind"].tolist() == [DIFFUSE]
    assert arrays["closure_color"].tolist() == [[0.25, 0.5, 1.0]]


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
            Alpha=made.outputs["Alpha"],
        ).outputs[0]

    (closure,), warnings = closures_of(build)
    assert warnings == []
    images = export_now().images
    assert closure["color_image"] == closure["alpha_image"]
    color, roughness = images[closure["color_image"]], images[closure["roughness_image"]]
    assert (color.extension, color.interpolation) == ("CLIP", "Closest")
    assert color.pixels.tolist() == [[[1.0, 0.5, 0.25, 0.5], [0.0, 0.5, 0.75, 1.0]]]
    assert roughness.pixels.tolist() == [[[0.5] * 4, [0.5] * 4]]


def test_an_image_where_only_a_number_is_taken_is_averaged() -> None:
    image = add_image()

    def build(tree: Any) -> Any:
        made = texture(tree, image)
        separate = node(tree, "ShaderNodeSeparateColor", Color=made.outputs["Color"])
        return node(
            tree,
            "ShaderNodeBsdfPrincipled",
            Metallic=separate.outputs[2],
            Emission_Color=made.outputs["Color"],
            Emission_Strength=2.0,
        ).outputs[0]

    (closure,), warnings = closures_of(build)
    assert closure["metallic"] == 0.5
    assert closure["emission"] == [1.0, 1.0, 1.0]
    assert warnings == [
        "'Wood': Separate Color in Metallic is not rendered yet (its average is used)",
        "'Wood': Image Texture in Emission Color is not rendered yet (its average is used)",
    ]


def test_texture_coordinates_beyond_the_active_uv_map_are_named() -> None:
    image = add_image()

    def build(tree: Any) -> Any:
        mapping = node(tree, "ShaderNodeMapping")
        made = texture(tree, image, projection="BOX", extension="MIRROR", interpolation="Cubic")
        tree.links.new(mapping.outputs[0], made.inputs[0])
        return node(tree, "ShaderNodeBsdfDiffuse", Color=made.outputs["Color"]).outputs[0]

    _, warnings = closures_of(build)
    assert warnings == [
        "'Wood': Box projection of 'Image' is not rendered yet",
        "'Wood': Mirror extension of 'Image' is not rendered yet",
        "'Wood': Cubic interpolation of 'Image' is not rendered yet (Linear is used)",
        "'Wood': Mapping of 'Image' is not rendered yet (the active UV map is used)",
    ]


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
    expected = ["'Mesh': UV map 'Other' is not the active one, which is used"]
    assert export_now().warnings == (expected if name == "Other" else [])
