"""What each type of node computes: one line in a table, or one small function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..ies import EVEN, file_text, intensity_grid
from ..image import ImageUse, Timing
from ..nodes import Color, Constant, Source
from .compiler import ONE, ZERO, Compiler
from .layers import PARTICLE
from .program import TABLE_SIZE, Operand

# Until Blender 4.5 bumps looked a pixel around, then as far as Filter Width says; Cycles' bumps by
# displacement keep to its first value.
HAS_FILTER_WIDTH = bpy.app.version >= (4, 5, 0)
DISPLACED_WIDTH: Color = (0.1, 0.1, 0.1)

# Stands in for the identifier of the output that is asked for.
OUTPUT = "OUTPUT"


@dataclass(frozen=True)
class Rule:
    """A node that one operation computes.

    Inputs are called as the operation calls them: sockets by identifier, else properties. Modes are
    the values of properties; after an equals sign they are given.
    """

    operation: str
    modes: tuple[str, ...] = ()
    # Identifiers of the sockets, where they are not those of the operation.
    inputs: tuple[str, ...] = ()
    # Modes of outputs, where they are not their identifiers.
    outputs: dict[str, str] = field(default_factory=dict)

    def __call__(self, compiler: Compiler, source: Source) -> Operand:
        names = self.inputs or compiler.operations[self.operation].inputs
        operands = [_operand(compiler, source, name) for name in names]
        if not self.modes:
            return compiler.emit(self.operation, *operands)
        modes = [self._mode(source, mode) for mode in self.modes]
        return compiler.emit_with_modes(source, self.operation, operands, modes)

    def _mode(self, source: Source, mode: str) -> str:
        if mode == OUTPUT:
            identifier = source.output.identifier
            return self.outputs.get(identifier, identifier)
        return mode[1:] if mode.startswith("=") else str(getattr(source.node, mode))


def _operand(compiler: Compiler, source: Source, name: str) -> Operand:
    if source.input(name) is None and hasattr(source.node, name):
        number = float(getattr(source.node, name))
        return (number, number, number)
    return compiler.input(source, name)


XYZ = {"X": "Red", "Y": "Green", "Z": "Blue"}
RGB = {"R": "Red", "G": "Green", "B": "Blue"}
HSV = {"H": "Red", "S": "Green", "V": "Blue"}


def mix(compiler: Compiler, source: Source) -> Operand:
    """The Mix node: its sockets are named by type."""
    node = source.node
    if node.data_type == "RGBA":
        operands = [compiler.input(source, name) for name in ("Factor_Float", "A_Color", "B_Color")]
        modes = (node.blend_type, str(node.clamp_factor), str(node.clamp_result))
        return compiler.emit_with_modes(source, "mix_color", operands, modes)
    kind = "Float" if node.data_type == "FLOAT" else "Vector"
    per_axis = kind == "Vector" and node.factor_mode == "NON_UNIFORM"
    factor = "Factor_Vector" if per_axis else "Factor_Float"
    operands = [compiler.input(source, name) for name in (factor, f"A_{kind}", f"B_{kind}")]
    return compiler.emit_with_modes(source, "mix", operands, (str(node.clamp_factor),))


def map_range(compiler: Compiler, source: Source) -> Operand:
    """The Map Range node: numbers and vectors have sockets of their own."""
    names = ("From_Min", "From_Max", "To_Min", "To_Max", "Steps")
    if source.node.data_type == "FLOAT":
        inputs = ("Value", *(name.replace("_", " ") for name in names))
    else:
        inputs = ("Vector", *(f"{name}_FLOAT3" for name in names))
    return Rule("map_range", ("interpolation_type", "clamp", "data_type"), inputs)(compiler, source)


def combine_color(mode: str, letters: dict[str, str]) -> Rule:
    """A Combine node of before 3.3 or for vectors."""
    return Rule("combine", (f"={mode}",), tuple(letters))


def separate_color(mode: str, letters: dict[str, str], name: str) -> Rule:
    """A Separate node of before 3.3 or for vectors."""
    return Rule("separate", (f"={mode}", OUTPUT), (name,), letters)


def image(compiler: Compiler, source: Source) -> Operand:
    """The Image Texture node."""
    node = source.node
    what = "alpha" if source.output.identifier == "Alpha" else "color"
    if node.image is None:
        compiler.warn("an Image Texture has no image, magenta is shown")
        return ONE if what == "alpha" else (1.0, 0.0, 1.0)
    use = ImageUse(
        node.image,
        node.extension,
        "Cubic" if node.interpolation == "Smart" else node.interpolation,  # as in Cycles
        Timing.of(node.image, node.image_user),
        multiply_alpha=not node.outputs["Alpha"].is_linked,
    )
    row = compiler.program.image(use)
    vector = compiler.input(source, "Vector")
    if node.projection == "BOX":
        blend = _operand(compiler, source, "projection_blend")
        return compiler.emit(f"image_box_{what}", vector, blend, parameter=row)
    if node.projection in ("SPHERE", "TUBE"):
        vector = compiler.emit(f"{node.projection.lower()}_uv", vector)
    return compiler.emit(f"image_{what}", vector, parameter=row)


def ies(compiler: Compiler, source: Source) -> Operand:
    """The IES Texture node; as in Cycles a lamp shines evenly where the file cannot be read."""
    strength = compiler.input(source, "Strength")
    try:
        grid = intensity_grid(file_text(source.node))
    except (OSError, ValueError) as problem:
        compiler.warn(f"the IES file of a texture cannot be read ({problem}), its light is even")
        return compiler.times((EVEN, EVEN, EVEN), strength)
    vector = source.input("Vector")
    if vector is not None and isinstance(vector.follow(), Source):
        direction = compiler.input(source, "Vector")
    else:
        away = compiler.emit_with_modes(source, "geometry", (), ("Incoming",))
        modes = ("NORMAL", "WORLD", "OBJECT")
        direction = compiler.emit_with_modes(source, "vector_transform", (away,), modes)
    found = compiler.emit("ies", direction, parameter=compiler.program.pixels(grid))
    return compiler.times(found, strength)


def ambient_occlusion(compiler: Compiler, source: Source) -> Operand:
    """The Ambient Occlusion node."""
    share = Rule("ambient_occlusion", ("inside", "only_local"))(compiler, source)
    if source.output.identifier == "AO":
        return share
    return compiler.times(compiler.input(source, "Color"), share)


def texture_coordinate(compiler: Compiler, source: Source) -> Operand:
    """The Texture Coordinate node."""
    node, output = source.node, source.output.identifier
    if node.from_instancer and output in ("Generated", "UV"):
        compiler.missing("From Instancer of Texture Coordinate", "the instance's own is used")
    if output == "UV":
        return compiler.uv()
    if output == "Generated":
        return compiler.generated()
    if output == "Object" and node.object is not None:
        columns = list(node.object.matrix_world.inverted_safe().transposed())
        axes: list[Operand] = [(c[0], c[1], c[2]) for c in columns]
        position = compiler.emit_with_modes(source, "geometry", (), ("Position",))
        return compiler.emit("transform", position, *axes)
    return compiler.emit_with_modes(source, "coordinate", (), (output,))


def uv_map(compiler: Compiler, source: Source) -> Operand:
    """The UV Map node."""
    if source.node.from_instancer:
        compiler.missing("From Instancer of UV Map", "the instance's own is used")
    return compiler.uv(source.node.uv_map)


def attribute(compiler: Compiler, source: Source) -> Operand:
    """The Attribute node, for attributes of the mesh."""
    node = source.node
    if node.attribute_type != "GEOMETRY":
        compiler.missing(
            f"{node.attribute_type.title()} attribute '{node.attribute_name}'", "zero is used"
        )
        return ZERO
    return _layer(compiler, source, f"attribute:{node.attribute_name}")


def volume_info(compiler: Compiler, source: Source) -> Operand:
    """The Volume Info node; surfaces have nothing to tell."""
    if not compiler.is_inside:
        return ZERO
    return compiler.layer(f"attribute:{source.output.identifier.lower()}")


def color_attribute(compiler: Compiler, source: Source) -> Operand:
    """The Color Attribute node."""
    return _layer(compiler, source, f"color:{source.node.layer_name}")


def _layer(compiler: Compiler, source: Source, name: str) -> Operand:
    if source.output.identifier == "Alpha":
        return compiler.layer(name, "attribute_alpha")
    value = compiler.layer(name)
    return compiler.emit("average", value) if source.output.identifier == "Fac" else value


def ramp(compiler: Compiler, source: Source) -> Operand:
    """The Color Ramp node."""
    ramp = source.node.color_ramp
    rows = [ramp.evaluate(i / (TABLE_SIZE - 1)) for i in range(TABLE_SIZE)]
    what = "alpha" if source.output.identifier == "Alpha" else "color"
    stepped = "_stepped" if ramp.interpolation == "CONSTANT" else ""
    table = compiler.program.table(np.array([tuple(row) for row in rows]))
    return compiler.emit(f"ramp_{what}{stepped}", compiler.input(source, "Fac"), parameter=table)


def curves(compiler: Compiler, source: Source) -> Operand:
    """RGB Curves, Vector Curves and Float Curve, sampled between the ends of their points."""
    mapping = source.node.mapping
    mapping.initialize()
    curves = list(mapping.curves)
    channels = _curve_channels(curves)
    ends = [point.location[0] for curve in curves for point in curve.points]
    low, high = min(0.0, *ends), max(1.0, *ends)
    rows = np.zeros((TABLE_SIZE, 4), np.float32)
    for row, x in enumerate(np.linspace(low, high, TABLE_SIZE).tolist()):
        rows[row, :3] = [channel(mapping, x) for channel in channels]
    extends = float(mapping.extend == "EXTRAPOLATED")
    factor, value = list(source.node.inputs)[:2]
    return compiler.emit(
        "curves",
        compiler.input(source, factor.identifier),
        compiler.input(source, value.identifier),
        (low, high, extends),
        parameter=compiler.program.table(rows),
    )


Channel = Callable[[bpy.types.CurveMapping, float], float]


def _curve_channels(curves: list[bpy.types.CurveMap]) -> list[Channel]:
    """The function of each channel. The fourth curve of colours comes before the others."""
    if len(curves) == 4:
        return [lambda m, x, c=c: m.evaluate(c, m.evaluate(curves[3], x)) for c in curves[:3]]
    return [lambda m, x, c=c: m.evaluate(c, x) for c in (curves * 3)[:3]]


def normal_vector(compiler: Compiler, source: Source) -> Operand:
    """The Normal node: a direction, or its cosine with another."""
    x, y, z = source.node.outputs["Normal"].default_value
    if source.output.identifier == "Normal":
        return (x, y, z)
    normalize = compiler.operations["vector_math"].parameter(("NORMALIZE",)) or 0
    dot = compiler.operations["vector_math"].parameter(("DOT_PRODUCT",)) or 0
    given = compiler.emit(
        "vector_math", compiler.input(source, "Normal"), ZERO, ZERO, ZERO, parameter=normalize
    )
    return compiler.emit("vector_math", (x, y, z), given, ZERO, ZERO, parameter=dot)


def normal_map(compiler: Compiler, source: Source) -> Operand:
    """The Normal Map node; its tangents come with the mesh."""
    node = source.node
    tangent, sign = ZERO, ONE
    if node.space == "TANGENT":
        name = f"tangent:{node.uv_map}"
        tangent, sign = compiler.layer(name), compiler.layer(name, "attribute_alpha")
    operands = [compiler.input(source, "Strength"), compiler.input(source, "Color"), tangent, sign]
    return compiler.emit_with_modes(source, "normal_map", operands, (node.space,))


def bump(compiler: Compiler, source: Source) -> Operand:
    """The Bump node: the height here and at two neighbours."""
    operands = [compiler.input(source, name) for name in ("Strength", "Distance", "Normal")]
    for point in range(3):
        with compiler.at(point):
            operands.append(compiler.input(source, "Height"))
    operands.append(_filter_width(compiler, source))
    return compiler.emit_with_modes(source, "bump", operands, (str(source.node.invert), "False"))


def _filter_width(compiler: Compiler, source: Source) -> Color:
    """How many pixels a Bump node looks around, the same in all of a material."""
    socket = source.input("Filter Width")
    end = socket and socket.follow()
    width = end.color() if isinstance(end, Constant) else ONE
    if isinstance(end, Source) or compiler.filter_width not in (None, width):
        compiler.missing("Bump nodes of different Filter Width", "that of the last one is used")
    compiler.filter_width = width
    return width


def displaced_normal(compiler: Compiler, displacement: Source, is_moved: bool) -> Operand:
    """The normal of a surface displaced by a known node, by bump mapping.

    Where its vertices are moved as well, heights count from where they were, as in Cycles.
    """
    heights: list[Operand] = []
    for point in range(3):
        with compiler.at(point):
            moved = compiler.output(displacement) or ZERO
            heights.append(compiler.emit("height", moved))
    modes = compiler.operations["bump"].parameter((str(False), str(is_moved))) or 0
    width = compiler.filter_width or (DISPLACED_WIDTH if HAS_FILTER_WIDTH else ONE)
    return compiler.emit("bump", ONE, ONE, ZERO, *heights, width, parameter=modes)


def vector_displacement(compiler: Compiler, source: Source) -> Operand:
    """The Vector Displacement node; its tangents are those of the UV map that is rendered."""
    frame: tuple[Operand, Operand] = (ZERO, ONE)
    if source.node.space == "TANGENT":
        frame = compiler.layer("tangent:"), compiler.layer("tangent:", "attribute_alpha")
    operands = [compiler.input(source, name) for name in ("Vector", "Midlevel", "Scale")]
    space = (source.node.space,)
    return compiler.emit_with_modes(source, "vector_displacement", [*operands, *frame], space)


def tangent(compiler: Compiler, source: Source) -> Operand:
    """The Tangent node."""
    node = source.node
    if node.direction_type == "UV_MAP":
        return compiler.layer(f"tangent:{node.uv_map}", "uv_tangent")
    return compiler.emit_with_modes(source, "radial_tangent", [compiler.generated()], (node.axis,))


def geometry(compiler: Compiler, source: Source) -> Operand:
    """The Geometry node."""
    if source.output.identifier == "Tangent":
        return compiler.emit_with_modes(source, "radial_tangent", [compiler.generated()], ("Z",))
    return Rule("geometry", (OUTPUT,))(compiler, source)


def wireframe(compiler: Compiler, source: Source) -> Operand:
    """The Wireframe node."""
    size, unit = compiler.input(source, "Size"), str(source.node.use_pixel_size)
    return compiler.emit_with_modes(source, "wireframe", (size,), (unit,))


def particle_info(compiler: Compiler, source: Source) -> Operand:
    """The Particle Info node."""
    compiler.program.layers.add(PARTICLE)
    if source.output.identifier == "Random":
        compiler.missing("Random of Particle Info as in Cycles", "other random numbers are used")
    return compiler.emit_with_modes(source, "particle_info", (), (source.output.identifier,))


def object_info(compiler: Compiler, source: Source) -> Operand:
    """The Object Info node; the index of the material is known now."""
    if source.output.identifier == "Material Index":
        index = float(compiler.material_index)
        return (index, index, index)
    return Rule("object_info", (OUTPUT,))(compiler, source)


def hair_info(compiler: Compiler, source: Source) -> Operand:
    """The Hair Info node."""
    return compiler.hair_info(source.output.identifier)


# Blender 5.0 changed the hash of Voronoi's cells.
VORONOI_HASH = "=PCG" if bpy.app.version >= (5, 0, 0) else "=LOOKUP3"

NODES: dict[str, Callable[[Compiler, Source], Operand]] = {
    "ShaderNodeAmbientOcclusion": ambient_occlusion,
    "ShaderNodeAttribute": attribute,
    "ShaderNodeBevel": Rule("bevel"),
    "ShaderNodeBlackbody": Rule("blackbody"),
    "ShaderNodeBrightContrast": Rule("bright_contrast"),
    "ShaderNodeBump": bump,
    "ShaderNodeCameraData": Rule("camera_data", (OUTPUT,)),
    "ShaderNodeClamp": Rule("clamp", ("clamp_type",)),
    "ShaderNodeCombineColor": Rule("combine", ("mode",)),
    "ShaderNodeCombineHSV": combine_color("HSV", HSV),
    "ShaderNodeCombineRGB": combine_color("RGB", RGB),
    "ShaderNodeCombineXYZ": combine_color("RGB", XYZ),
    "ShaderNodeDisplacement": Rule("displacement", ("space",)),
    "ShaderNodeFloatCurve": curves,
    "ShaderNodeFresnel": Rule("fresnel"),
    "ShaderNodeGamma": Rule("gamma"),
    "ShaderNodeHairInfo": hair_info,
    "ShaderNodeHueSaturation": Rule("hue_saturation"),
    "ShaderNodeInvert": Rule("invert"),
    "ShaderNodeLayerWeight": Rule("layer_weight", (OUTPUT,)),
    "ShaderNodeLightFalloff": Rule("light_falloff", (OUTPUT,)),
    "ShaderNodeLightPath": Rule("light_path", (OUTPUT,)),
    "ShaderNodeMapRange": map_range,
    "ShaderNodeMapping": Rule("mapping", ("vector_type",)),
    "ShaderNodeMath": Rule("math", ("operation", "use_clamp")),
    "ShaderNodeMix": mix,
    "ShaderNodeMixRGB": Rule(
        "mix_color", ("blend_type", "=True", "use_clamp"), ("Fac", "Color1", "Color2")
    ),
    "ShaderNodeNewGeometry": geometry,
    "ShaderNodeNormal": normal_vector,
    "ShaderNodeNormalMap": normal_map,
    "ShaderNodeObjectInfo": object_info,
    "ShaderNodeParticleInfo": particle_info,
    "ShaderNodeRGBCurve": curves,
    "ShaderNodeRGBToBW": Rule("luminance"),
    "ShaderNodeSeparateColor": Rule("separate", ("mode", OUTPUT)),
    "ShaderNodeSeparateHSV": separate_color("HSV", HSV, "Color"),
    "ShaderNodeSeparateRGB": separate_color("RGB", RGB, "Image"),
    "ShaderNodeSeparateXYZ": separate_color("RGB", XYZ, "Vector"),
    "ShaderNodeTangent": tangent,
    "ShaderNodeTexBrick": Rule("brick", (OUTPUT,)),
    "ShaderNodeTexChecker": Rule("checker", (OUTPUT,)),
    "ShaderNodeTexCoord": texture_coordinate,
    "ShaderNodeTexGradient": Rule("gradient", ("gradient_type",)),
    "ShaderNodeTexIES": ies,
    "ShaderNodeTexImage": image,
    "ShaderNodeTexMagic": Rule("magic", (OUTPUT,)),
    "ShaderNodeTexNoise": Rule("noise", ("noise_dimensions", "noise_type", "normalize", OUTPUT)),
    "ShaderNodeTexVoronoi": Rule(
        "voronoi",
        ("voronoi_dimensions", "distance", "feature", "normalize", OUTPUT, VORONOI_HASH),
    ),
    "ShaderNodeTexWave": Rule(
        "wave", ("wave_type", "bands_direction", "rings_direction", "wave_profile")
    ),
    "ShaderNodeTexWhiteNoise": Rule("white_noise", ("noise_dimensions", OUTPUT)),
    "ShaderNodeUVMap": uv_map,
    "ShaderNodeValToRGB": ramp,
    "ShaderNodeVectorCurve": curves,
    "ShaderNodeVectorDisplacement": vector_displacement,
    "ShaderNodeVectorMath": Rule("vector_math", ("operation",)),
    "ShaderNodeVectorRotate": Rule("vector_rotate", ("rotation_type", "invert")),
    "ShaderNodeVectorTransform": Rule(
        "vector_transform", ("vector_type", "convert_from", "convert_to")
    ),
    "ShaderNodeVertexColor": color_attribute,
    "ShaderNodeVolumeInfo": volume_info,
    "ShaderNodeWavelength": Rule("wavelength"),
    "ShaderNodeWireframe": wireframe,
}
