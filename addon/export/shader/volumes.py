"""Volumes as even media: one small function per volume node, in a table."""

from __future__ import annotations

from collections.abc import Callable

from ..nodes import Source
from .compiler import ONE, ZERO, Compiler
from .program import Operand, Value

Volume = Callable[[Compiler, Source, Operand], None]

# Operations that read where they are; what they compute is not the same all over a body.
UNEVEN = (
    "ambient_occlusion",
    "attribute",
    "camera_data",
    "coordinate",
    "fresnel",
    "geometry",
    "ies",
    "image",
    "layer_weight",
    "light",
    "object_info",
    "uv_tangent",
    "vector_transform",
    "wireframe",
)


def compile_volume(compiler: Compiler, shader: Source, weight: Operand = ONE) -> None:
    """Write the media of the shader linked to an output's Volume."""
    compile_shader = VOLUMES.get(shader.node.bl_idname)
    if compile_shader is None:
        compiler.missing(f"{shader.label} as a volume")
        return
    compile_shader(compiler, shader, weight)


def absorption(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Absorption."""
    color = _saturated_rest(compiler, _even(compiler, source, "Color"))
    density = _even(compiler, source, "Density")
    compiler.emit("volume", weight, ZERO, compiler.times(color, density), ZERO, ZERO)


def scatter(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Scatter."""
    _warn_of_phase(compiler, source)
    color = compiler.times(_even(compiler, source, "Color"), _even(compiler, source, "Density"))
    compiler.emit("volume", weight, color, ZERO, ZERO, _even(compiler, source, "Anisotropy"))


def coefficients(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Coefficients."""
    _warn_of_phase(compiler, source)
    names = (
        "Scatter Coefficients",
        "Absorption Coefficients",
        "Emission Coefficients",
        "Anisotropy",
    )
    compiler.emit("volume", weight, *(_even(compiler, source, name) for name in names))


def principled(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Principled Volume, without the grids of a volume object."""
    compiler.missing_unless(source, "Blackbody Intensity", 0.0, "Blackbody of Principled Volume")
    color, density = _even(compiler, source, "Color"), _even(compiler, source, "Density")
    root = _root(compiler, _even(compiler, source, "Absorption Color"))
    kept = compiler.times(_saturated_rest(compiler, color), _saturated_rest(compiler, root))
    emission = compiler.times(
        _even(compiler, source, "Emission Color"), _even(compiler, source, "Emission Strength")
    )
    compiler.emit(
        "volume",
        weight,
        compiler.times(color, density),
        compiler.times(kept, density),
        emission,
        _even(compiler, source, "Anisotropy"),
    )


def emission(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Emission, by the metre."""
    light = compiler.times(_even(compiler, source, "Color"), _even(compiler, source, "Strength"))
    compiler.emit("volume", weight, ZERO, ZERO, light, ZERO)


def mix(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Mix Shader."""
    factor = compiler.saturated(_even(compiler, source, "Fac"))
    _linked(compiler, source, "Shader", compiler.times(weight, compiler.rest(factor)))
    _linked(compiler, source, "Shader_001", compiler.times(weight, factor))


def add(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Add Shader."""
    _linked(compiler, source, "Shader", weight)
    _linked(compiler, source, "Shader_001", weight)


def _linked(compiler: Compiler, source: Source, identifier: str, weight: Operand) -> None:
    socket = source.input(identifier)
    end = socket and socket.follow()
    if isinstance(end, Source) and weight != ZERO:
        compile_volume(compiler, end, weight)


def _warn_of_phase(compiler: Compiler, source: Source) -> None:
    phase = getattr(source.node, "phase", "HENYEY_GREENSTEIN")
    if phase != "HENYEY_GREENSTEIN":
        compiler.missing(f"{phase.title()} scattering", "Henyey-Greenstein is used")


def _even(compiler: Compiler, source: Source, identifier: str) -> Operand:
    """The value of an input; its default, with a warning, where it differs from place to place."""
    value = compiler.input(source, identifier)
    if not _is_uneven(compiler, value):
        return value
    compiler.missing(f"a texture in {identifier} of {source.label}", "its default value is used")
    return compiler.default(source, identifier)


def _is_uneven(compiler: Compiler, value: Operand) -> bool:
    """Tell whether any instruction that the value is computed from reads where it is."""
    program = compiler.program
    reached = {value}
    # Instructions only read earlier ones: backwards each is met once, however many read it.
    for index in range(value.index if isinstance(value, Value) else -1, -1, -1):
        if Value(index) in reached:
            instruction = program.instructions[program.start + index]
            if instruction.operation.name.startswith(UNEVEN):
                return True
            reached.update(instruction.operands)
    return False


def _saturated_rest(compiler: Compiler, color: Operand) -> Operand:
    return compiler.saturated(compiler.rest(color))


def _root(compiler: Compiler, color: Operand) -> Operand:
    if not isinstance(color, Value):
        red, green, blue = (max(x, 0.0) ** 0.5 for x in color)
        return (red, green, blue)
    power = compiler.operations["vector_math"].parameter(("POWER",))
    if power is None:
        return color
    return compiler.emit("vector_math", color, (0.5, 0.5, 0.5), ZERO, ZERO, parameter=power)


VOLUMES: dict[str, Volume] = {
    "ShaderNodeAddShader": add,
    "ShaderNodeEmission": emission,
    "ShaderNodeMixShader": mix,
    "ShaderNodeVolumeAbsorption": absorption,
    "ShaderNodeVolumeCoefficients": coefficients,
    "ShaderNodeVolumePrincipled": principled,
    "ShaderNodeVolumeScatter": scatter,
}
