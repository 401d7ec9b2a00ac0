"""Shader nodes against Cycles: one plate per node, all in one picture, compared pixel by pixel.

Each plate is a square that emits what its node computes, so that a pixel shows the value itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from export_oracle import add_material, add_object, render_with_cycles, scene

# Pixels along the side of a plate, and plates along the side of the picture.
PLATE, GRID = 12, 17


@dataclass(frozen=True)
class Case:
    """A node with its settings, the input that the coordinate goes to, and the output shown."""

    node: str
    output: str
    coordinate: str = ""
    properties: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, Any] = field(default_factory=dict)
    # Mean difference allowed, of values mapped to 0 to 1.
    tolerance: float = 4e-4
    # Done to the node before it is used.
    prepare: Callable[[Any], None] | None = None

    def __str__(self) -> str:
        details = [str(value) for value in (*self.properties.values(), *self.inputs.values())]
        return "-".join([self.node.removeprefix("ShaderNode"), self.output, *details])


def enum(node: str, name: str) -> list[str]:
    """What a property may be in this version of Blender."""
    items = getattr(bpy.types, node).bl_rna.properties[name].enum_items
    return [item.identifier for item in items]


def math_cases() -> list[Case]:
    numbers = {"Value_001": 0.37, "Value_002": 0.21}
    vectors = {"Vector_001": (0.3, -0.6, 0.45), "Vector_002": (0.2, 0.7, -0.4), "Scale": 0.7}
    numeric = {"DOT_PRODUCT", "DISTANCE", "LENGTH"}
    return [
        Case("ShaderNodeMath", "Value", "Value", {"operation": operation}, numbers)
        for operation in enum("ShaderNodeMath", "operation")
    ] + [
        Case(
            "ShaderNodeVectorMath",
            "Value" if operation in numeric else "Vector",
            "Vector",
            {"operation": operation},
            vectors,
        )
        for operation in enum("ShaderNodeVectorMath", "operation")
    ]


def color_cases() -> list[Case]:
    other = {"B_Color": (0.2, 0.7, 0.4, 1.0), "Factor_Float": 0.6}
    cases = [
        Case(
            "ShaderNodeMix",
            "Result_Color",
            "A_Color",
            {"data_type": "RGBA", "blend_type": b},
            other,
        )
        for b in enum("ShaderNodeMix", "blend_type")
    ]
    cases += [
        Case(f"ShaderNode{kind}Color", output, name, {"mode": mode}, inputs)
        for mode in ("RGB", "HSV", "HSL")
        for kind, name, outputs, inputs in (
            ("Separate", "Color", ("Red", "Green", "Blue"), {}),
            ("Combine", "Red", ("Color",), {"Green": 0.6, "Blue": 0.3}),
        )
        for output in outputs
    ]
    return [
        *cases,
        Case("ShaderNodeMixRGB", "Color", "Color1", {"blend_type": "SCREEN"}, {"Fac": 0.3}),
        Case("ShaderNodeMix", "Result_Float", "A_Float", {}, {"Factor_Float": 0.3}),
        Case("ShaderNodeMix", "Result_Vector", "A_Vector", {"data_type": "VECTOR"}),
        Case(
            "ShaderNodeMix",
            "Result_Vector",
            "Factor_Vector",
            {"data_type": "VECTOR", "factor_mode": "NON_UNIFORM"},
            {"B_Vector": (1.0, 0.5, 0.2)},
        ),
        Case("ShaderNodeHueSaturation", "Color", "Color", {}, {"Hue": 0.3, "Saturation": 1.4}),
        Case("ShaderNodeBrightContrast", "Color", "Color", {}, {"Bright": 0.1, "Contrast": 0.4}),
        Case("ShaderNodeGamma", "Color", "Color", {}, {"Gamma": 2.2}),
        Case("ShaderNodeInvert", "Color", "Color", {}, {"Fac": 0.7}),
        Case("ShaderNodeRGBToBW", "Val", "Color"),
        Case("ShaderNodeValToRGB", "Color", "Fac", prepare=colorful_ramp),
        Case("ShaderNodeValToRGB", "Alpha", "Fac", prepare=stepped_ramp),
        Case("ShaderNodeRGBCurve", "Color", "Color", {}, {"Fac": 0.8}, prepare=bent_curves),
        Case("ShaderNodeVectorCurve", "Vector", "Vector", prepare=bent_curves),
        Case("ShaderNodeFloatCurve", "Value", "Value", prepare=bent_curves),
        Case("ShaderNodeBlackbody", "Color", "", {}, {"Temperature": 2700.0}, 5e-3),
        Case("ShaderNodeBlackbody", "Color", "", {}, {"Temperature": 6500.0}, 5e-3),
        Case("ShaderNodeWavelength", "Color", "", {}, {"Wavelength": 560.0}, 1e-3),
    ]


def colorful_ramp(node: Any) -> None:
    node.color_ramp.interpolation = "B_SPLINE"
    node.color_ramp.elements.new(0.4).color = (0.9, 0.1, 0.3, 0.5)


def stepped_ramp(node: Any) -> None:
    node.color_ramp.interpolation = "CONSTANT"
    node.color_ramp.elements.new(0.4).color = (0.9, 0.1, 0.3, 0.5)


def bent_curves(node: Any) -> None:
    curve = node.mapping.curves[0]
    curve.points.new(0.3, 0.7)
    node.mapping.curves[-1].points.new(0.6, 0.4)
    node.mapping.update()


def vector_cases() -> list[Case]:
    mapping = {"Location": (0.1, 0.2, 0.3), "Rotation": (0.4, 0.5, 0.6), "Scale": (1.2, 0.7, 2.0)}
    rotation = {"Center": (0.1, 0.2, 0.3), "Angle": 0.7, "Rotation": (0.4, 0.5, 0.6)}
    ranges = {"From Min": 0.2, "From Max": 0.7, "To Min": 0.9, "To Max": 0.3, "Steps": 3.0}
    vectors = {f"{k.replace(' ', '_')}_FLOAT3": (v, v, v) for k, v in ranges.items()}
    return [
        *(
            Case("ShaderNodeMapping", "Vector", "Vector", {"vector_type": kind}, mapping)
            for kind in enum("ShaderNodeMapping", "vector_type")
        ),
        *(
            Case("ShaderNodeVectorRotate", "Vector", "Vector", {"rotation_type": kind}, rotation)
            for kind in enum("ShaderNodeVectorRotate", "rotation_type")
        ),
        *(
            Case(
                "ShaderNodeVectorTransform",
                "Vector",
                "Vector",
                {"vector_type": kind, "convert_from": a, "convert_to": b},
            )
            for kind in ("POINT", "VECTOR", "NORMAL")
            for a, b in (("WORLD", "OBJECT"), ("OBJECT", "CAMERA"), ("CAMERA", "WORLD"))
        ),
        *(
            Case("ShaderNodeMapRange", "Result", "Value", {"interpolation_type": kind}, ranges)
            for kind in enum("ShaderNodeMapRange", "interpolation_type")
        ),
        *(
            Case(
                "ShaderNodeMapRange",
                "Vector",
                "Vector",
                {"data_type": "FLOAT_VECTOR", "interpolation_type": kind},
                vectors,
            )
            for kind in enum("ShaderNodeMapRange", "interpolation_type")
        ),
        Case(
            "ShaderNodeClamp", "Result", "Value", {"clamp_type": "RANGE"}, {"Min": 0.8, "Max": 0.3}
        ),
        Case("ShaderNodeCombineXYZ", "Vector", "Y", {}, {"X": 0.5}),
        Case("ShaderNodeSeparateXYZ", "Z", "Vector"),
        Case("ShaderNodeNormal", "Dot", "Normal"),
    ]


def noise_cases() -> list[Case]:
    details = {"Scale": 3.0, "W": 0.4, "Detail": 2.5, "Roughness": 0.6, "Distortion": 0.3}
    cells = {"Scale": 4.0, "W": 0.4, "Randomness": 0.8, "Smoothness": 0.7}
    noises = [
        Case(
            "ShaderNodeTexNoise",
            output,
            "Vector",
            {"noise_dimensions": dimensions, "noise_type": kind},
            details,
            1e-3,
        )
        for dimensions, output in (
            ("1D", "Color"),
            ("2D", "Color"),
            ("3D", "Color"),
            ("4D", "Color"),
        )
        for kind in enum("ShaderNodeTexNoise", "noise_type")
        if dimensions == "3D" or kind == "FBM"
    ]
    features = [("F1", "Distance"), ("F2", "Color"), ("SMOOTH_F1", "Position")]
    features += [("DISTANCE_TO_EDGE", "Distance"), ("N_SPHERE_RADIUS", "Radius")]
    voronoi = [
        Case(
            "ShaderNodeTexVoronoi",
            "W" if (dimensions, output) == ("1D", "Position") else output,
            "Vector",
            {"voronoi_dimensions": dimensions, "feature": feature, "normalize": normalize},
            {**cells, "Detail": detail},
            3e-3,
        )
        for dimensions in ("1D", "2D", "3D", "4D")
        for feature, output in features
        for detail, normalize in ((0.0, False), (1.5, True))
        if detail == 0.0 or dimensions == "3D"
    ]
    metrics = [
        Case("ShaderNodeTexVoronoi", "Distance", "Vector", {"distance": metric}, cells, 2e-3)
        for metric in enum("ShaderNodeTexVoronoi", "distance")
    ]
    white = [
        Case("ShaderNodeTexWhiteNoise", output, "SNAPPED", {"noise_dimensions": dimensions})
        for dimensions in ("1D", "2D", "3D", "4D")
        for output in ("Value", "Color")
    ]
    return [*noises, *voronoi, *metrics, *white]


def pattern_cases() -> list[Case]:
    wave = {"Scale": 2.0, "Distortion": 1.5, "Detail": 2.0, "Phase Offset": 0.5}
    brick = {"Scale": 6.0, "Mortar Smooth": 0.3, "Bias": 0.1}
    return [
        *(
            Case(
                "ShaderNodeTexWave",
                "Color",
                "Vector",
                {
                    "wave_type": kind,
                    f"{kind.lower()}_direction": direction,
                    "wave_profile": profile,
                },
                wave,
                2e-3,
            )
            for kind, direction, profile in (
                ("BANDS", "X", "SIN"),
                ("BANDS", "DIAGONAL", "SAW"),
                ("RINGS", "Y", "TRI"),
                ("RINGS", "SPHERICAL", "SIN"),
            )
        ),
        *(
            Case("ShaderNodeTexMagic", "Color", "Vector", {"turbulence_depth": depth}, {}, 4e-3)
            for depth in (0, 2, 5, 10)
        ),
        Case("ShaderNodeTexChecker", "Color", "Vector", {}, {"Scale": 4.0}),
        Case("ShaderNodeTexBrick", "Color", "Vector", {"squash": 0.7}, brick, 1e-3),
        Case("ShaderNodeTexBrick", "Fac", "Vector", {"offset": 0.3}, brick, 4e-3),
        *(
            Case("ShaderNodeTexGradient", "Color", "Vector", {"gradient_type": kind})
            for kind in enum("ShaderNodeTexGradient", "gradient_type")
        ),
    ]


def input_cases() -> list[Case]:
    geometry = ("Position", "Normal", "True Normal", "Incoming", "Backfacing")
    coordinates = ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
    objects = ("Location", "Color", "Alpha", "Object Index", "Material Index")
    paths = ("Is Camera Ray", "Is Diffuse Ray", "Is Shadow Ray", "Ray Depth", "Ray Length")
    cameras = ("View Vector", "View Z Depth", "View Distance")
    return [
        *(Case("ShaderNodeNewGeometry", output) for output in geometry),
        *(Case("ShaderNodeTexCoord", output) for output in coordinates),
        *(Case("ShaderNodeObjectInfo", output) for output in objects),
        *(Case("ShaderNodeLightPath", output) for output in paths),
        *(Case("ShaderNodeCameraData", output) for output in cameras),
        Case("ShaderNodeLayerWeight", "Fresnel"),
        Case("ShaderNodeLayerWeight", "Facing", inputs={"Blend": 0.3}),
        Case("ShaderNodeFresnel", "Fac"),
        Case("ShaderNodeWireframe", "Fac", inputs={"Size": 0.37}),
        Case("ShaderNodeUVMap", "UV", properties={"uv_map": "Second"}),
        Case("ShaderNodeAttribute", "Color", properties={"attribute_name": "Tint"}),
        Case("ShaderNodeAttribute", "Fac", properties={"attribute_name": "Height"}),
        Case("ShaderNodeVertexColor", "Color", properties={"layer_name": "Tint"}),
        Case("ShaderNodeVertexColor", "Alpha", properties={"layer_name": "Tint"}),
        Case("ShaderNodeTangent", "Tangent", properties={"direction_type": "UV_MAP"}),
        Case("ShaderNodeTangent", "Tangent"),
        *(
            Case("ShaderNodeNormalMap", "Normal", "Color", {"space": space}, {"Strength": 0.6})
            for space in enum("ShaderNodeNormalMap", "space")
        ),
        Case("ShaderNodeBump", "Normal", "Height", {}, {"Strength": 0.8}, 2e-3),
    ]


def image_cases() -> list[Case]:
    return [
        Case("ShaderNodeTexImage", "Color", "SCALED", {"extension": extension}, prepare=texture)
        for extension in ("REPEAT", "EXTEND", "CLIP", "MIRROR")
    ] + [
        Case("ShaderNodeTexImage", "Color", "", {"interpolation": "Closest"}, prepare=texture),
        Case("ShaderNodeTexImage", "Alpha", prepare=texture),
        *(
            Case("ShaderNodeTexImage", "Color", "Vector", {"projection": kind}, prepare=texture)
            for kind in ("BOX", "SPHERE", "TUBE")
        ),
        Case(
            "ShaderNodeTexImage",
            "Color",
            "Vector",
            {"projection": "BOX", "projection_blend": 0.8},
            prepare=texture,
        ),
    ]


def texture(node: Any) -> None:
    image = bpy.data.images.get("Texels")
    if image is None:
        image = bpy.data.images.new("Texels", 4, 4, alpha=True, float_buffer=True)
        values = np.random.default_rng(7).random((16, 4), np.float32)
        image.pixels.foreach_set(values.reshape(-1))
        image.alpha_mode = "CHANNEL_PACKED"
    node.image = image


def all_cases() -> list[Case]:
    return [
        *math_cases(),
        *color_cases(),
        *vector_cases(),
        *noise_cases(),
        *pattern_cases(),
        *input_cases(),
        *image_cases(),
    ]


CASES = all_cases()


def emitted(tree: Any, case: Case) -> Any:
    """Build the nodes of a case; their value goes to an emission, mapped into 0 to 1."""
    made = tree.nodes.new(case.node)
    if case.prepare:
        case.prepare(made)
    for name, value in case.properties.items():
        setattr(made, name, value)
    for name, value in case.inputs.items():
        socket(made.inputs, name).default_value = value
    if case.coordinate:
        link_coordinate(tree, made, case.coordinate)
    shader = tree.nodes.new("ShaderNodeEmission")
    # A wide range in a small one: x / (1 + |x|), so that no plate outshines the others.
    size = tree.nodes.new("ShaderNodeVectorMath")
    size.operation = "ABSOLUTE"
    more = tree.nodes.new("ShaderNodeVectorMath")
    more.inputs[1].default_value = (1.0, 1.0, 1.0)
    divide = tree.nodes.new("ShaderNodeVectorMath")
    divide.operation = "DIVIDE"
    half = tree.nodes.new("ShaderNodeVectorMath")
    half.operation = "MULTIPLY_ADD"
    half.inputs[1].default_value = half.inputs[2].default_value = (0.5, 0.5, 0.5)
    value = socket(made.outputs, case.output)
    tree.links.new(value, size.inputs[0])
    tree.links.new(size.outputs[0], more.inputs[0])
    tree.links.new(value, divide.inputs[0])
    tree.links.new(more.outputs[0], divide.inputs[1])
    tree.links.new(divide.outputs[0], half.inputs[0])
    tree.links.new(half.outputs[0], shader.inputs["Color"])
    return shader.outputs[0]


def link_coordinate(tree: Any, made: Any, name: str) -> None:
    """Position on the plate, turned so that all three components vary."""
    coordinate = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.3, 0.7, 0.2)
    mapping.inputs["Scale"].default_value = (1.3, 1.1, 0.9)
    source = coordinate.outputs["UV" if name == "SCALED" else "Object"]
    tree.links.new(source, mapping.inputs[0])
    result = mapping.outputs[0]
    if name == "SCALED":
        mapping.inputs["Rotation"].default_value = (0.0, 0.0, 0.4)
        mapping.inputs["Scale"].default_value = (2.3, 2.1, 1.0)
        mapping.inputs["Location"].default_value = (-0.5, -0.7, 0.0)
    if name == "SNAPPED":
        # White noise tells any two floats apart: give it the same ones.
        snap = tree.nodes.new("ShaderNodeVectorMath")
        snap.operation = "SNAP"
        snap.inputs[1].default_value = (0.25, 0.25, 0.25)
        tree.links.new(result, snap.inputs[0])
        result = snap.outputs[0]
    inputs = {"SNAPPED": ("Vector", "W"), "SCALED": ("Vector",)}.get(name, (name,))
    for identifier in inputs:
        tree.links.new(result, socket(made.inputs, identifier))


def socket(sockets: Any, identifier: str) -> Any:
    return next(s for s in sockets if s.identifier == identifier)


def add_plate(row: int, case: Case) -> None:
    """A curved square in its place of the grid, with layers of every kind."""
    x, y = np.divmod(row, GRID)
    mesh: Any = bpy.data.meshes.new("Plate")
    corners = [(-1, -1, 0.2), (1, -1, 0), (1, 1, 0.3), (-1, 1, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2), (0, 2, 3)])
    mesh.shade_smooth()
    flat = np.array([0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1], np.float32)
    mesh.uv_layers.new(name="First").uv.foreach_set("vector", flat)
    mesh.uv_layers.new(name="Second").uv.foreach_set("vector", 1.0 - 0.5 * flat)
    mesh.uv_layers["First"].active_render = True
    tint = mesh.color_attributes.new("Tint", "FLOAT_COLOR", "CORNER")
    tint.data.foreach_set("color", np.linspace(0.1, 0.9, 24, dtype=np.float32))
    height = mesh.attributes.new("Height", "FLOAT", "POINT")
    height.data.foreach_set("value", np.array([0.1, 0.9, 0.4, 0.6], np.float32))
    material = add_material(f"{row}", lambda tree: emitted(tree, case))
    material.pass_index = 3
    mesh.materials.append(material)
    half = 0.5 * GRID - 0.5
    plate = add_object(f"{row}", mesh, location=(x - half, y - half, 0.0), scale=(0.5, 0.5, 0.5))
    plate.pass_index, plate.color = 2, (0.2, 0.4, 0.6, 0.8)


def add_plates() -> None:
    """The plates of all cases, seen from far away, so that angles hardly differ."""
    assert len(CASES) <= GRID * GRID, len(CASES)
    for row, case in enumerate(CASES):
        add_plate(row, case)
    camera: Any = bpy.data.cameras.new("Camera")
    scene().camera = add_object("Camera", camera, location=(0, 0, 10.0 * GRID))
    camera.sensor_width, camera.lens = 1.0, 10.0


def render_with_us() -> np.ndarray:
    """The same picture by the renderer under test, from the pixels' middles."""
    from addon.engine import passes

    scene().render.engine = "DUALCONE"
    settings = scene().dualcone
    settings.method, settings.samples, settings.max_bounces = "PATH", 1, 0
    settings.filter, settings.filter_width = "BLACKMAN_HARRIS", 0.01
    pixels: list[np.ndarray] = []
    write = passes.Canvas.write
    passes.Canvas.write = lambda _canvas, result: pixels.append(result["Combined"])
    try:
        bpy.ops.render.render()
    finally:
        passes.Canvas.write = write
    return pixels[0]


def plates(picture: np.ndarray) -> np.ndarray:
    rows = picture[..., :3].reshape(GRID, PLATE, GRID, PLATE, 3)
    return rows.transpose(2, 0, 1, 3, 4).reshape(GRID * GRID, PLATE, PLATE, 3)


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Mean over a plate without its border, where pixels are half off it, and without the twentieth
    of the pixels that differ most: there edges of the texture fall on one side or the other."""
    inside = slice(1, -1)
    values = np.abs(ours - theirs)[inside, inside].max(axis=-1).ravel()
    return float(np.sort(values)[: int(0.95 * values.size)].mean())


def test_nodes_are_those_of_cycles(tmp_path: Path) -> None:
    """All cases of the table."""
    add_plates()
    theirs = plates(render_with_cycles(tmp_path, GRID * PLATE, 1))
    ours = plates(render_with_us())
    found = [difference(*pair) for pair in zip(ours, theirs, strict=True)]
    wrong = [
        f"{case}: {value:.1e} above {case.tolerance:.0e}"
        for case, value in zip(CASES, found, strict=False)
        if not value <= case.tolerance
    ]
    assert not wrong, "\n".join(wrong)
