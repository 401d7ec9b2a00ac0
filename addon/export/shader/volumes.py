"""Volumes as media: one small function per volume node, in a table."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..nodes import Color, Constant, Source, linked_shader
from .compiler import ONE, ZERO, Compiler
from .program import Operand, Value

Volume = Callable[[Compiler, Source, Operand], None]

# Stefan and Boltzmann's constant over pi, in the units of Cycles' blackbodies.
BLACKBODY_SCALE = 5.670373e-8 * 1e-6 / math.pi
# What Blender gives a volume without a material: half of the light that it takes it scatters.
DEFAULT_COLOR: Color = (0.5, 0.5, 0.5)


def compile_volume(compiler: Compiler, shader: Source | Constant) -> None:
    """Write the media of the shader linked to an output's Volume, or of a colour there."""
    with compiler.inside():
        _volume(compiler, shader, ONE)


def default_volume(compiler: Compiler) -> None:
    """Write what fills a volume object without a material."""
    with compiler.inside():
        density = compiler.layer("attribute:density", "attribute_or_one")
        color = compiler.times(DEFAULT_COLOR, density)
        compiler.emit("volume", ONE, color, color, ZERO, ZERO)


def _volume(compiler: Compiler, end: Source | Constant, weight: Operand) -> None:
    if isinstance(end, Constant) or end.output.type != "SHADER":
        # A colour in a shader's place glows, as in Cycles.
        compiler.emit("volume", weight, ZERO, ZERO, compiler.color(end), ZERO)
    elif compile_shader := VOLUMES.get(end.node.bl_idname):
        compile_shader(compiler, end, weight)
    elif end.node.bl_idname.startswith("ShaderNodeVolume"):  # others do nothing in a volume
        compiler.missing(end.label)


def absorption(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Absorption."""
    color = _saturated_rest(compiler, compiler.input(source, "Color"))
    density = compiler.input(source, "Density")
    compiler.emit("volume", weight, ZERO, compiler.times(color, density), ZERO, ZERO)


def scatter(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Scatter."""
    _warn_of_phase(compiler, source)
    color = compiler.times(compiler.input(source, "Color"), compiler.input(source, "Density"))
    compiler.emit("volume", weight, color, ZERO, ZERO, compiler.input(source, "Anisotropy"))


def coefficients(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Volume Coefficients."""
    _warn_of_phase(compiler, source)
    names = (
        "Scatter Coefficients",
        "Absorption Coefficients",
        "Emission Coefficients",
        "Anisotropy",
    )
    compiler.emit("volume", weight, *(compiler.input(source, name) for name in names))


def principled(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Principled Volume; what its grids say counts where the body has them."""
    color, density = compiler.input(source, "Color"), compiler.input(source, "Density")
    color = compiler.times(color, _grid(compiler, source, "Color Attribute"))
    root = _root(compiler, compiler.input(source, "Absorption Color"))
    kept = compiler.times(_saturated_rest(compiler, color), _saturated_rest(compiler, root))
    # Last, so that what does not depend on the body is computed here.
    grid = _grid(compiler, source, "Density Attribute")
    compiler.emit(
        "volume",
        weight,
        compiler.times(compiler.times(color, density), grid),
        compiler.times(compiler.times(kept, density), grid),
        _principled_glow(compiler, source),
        compiler.input(source, "Anisotropy"),
    )


def _principled_glow(compiler: Compiler, source: Source) -> Operand:
    """Light of a Principled Volume: of its own colour, and of its heat."""
    glow = compiler.times(
        compiler.input(source, "Emission Color"), compiler.input(source, "Emission Strength")
    )
    intensity = compiler.input(source, "Blackbody Intensity")
    if intensity == ZERO:
        return glow
    grid = _grid(compiler, source, "Temperature Attribute")
    kelvin = _math(
        compiler, "MAXIMUM", compiler.times(compiler.input(source, "Temperature"), grid), ZERO
    )
    power = _math(compiler, "POWER", kelvin, (4.0, 4.0, 4.0))
    # Between one and the fourth power, by the intensity.
    mixed = compiler.emit_with_modes(source, "mix", (intensity, ONE, power), ("False",))
    tint = compiler.times(compiler.input(source, "Blackbody Tint"), (BLACKBODY_SCALE,) * 3)
    color = compiler.times(compiler.emit("blackbody", kelvin), mixed)
    return _sum(compiler, glow, compiler.times(color, tint))


def _grid(compiler: Compiler, source: Source, identifier: str) -> Operand:
    """The grid that an input names, one without it."""
    socket = source.input(identifier)
    end = socket and socket.follow()
    name = end.socket.default_value if isinstance(end, Constant) else ""
    return compiler.layer(f"attribute:{name}", "attribute_or_one") if name else ONE


def _math(compiler: Compiler, what: str, first: Operand, second: Operand) -> Operand:
    parameter = compiler.operations["math"].parameter((what, "False")) or 0
    return compiler.emit("math", first, second, ZERO, parameter=parameter)


def _sum(compiler: Compiler, first: Operand, second: Operand) -> Operand:
    if first == ZERO:
        return second
    return first if second == ZERO else compiler.emit("add", first, second)


def emission(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Emission, by the metre."""
    light = compiler.times(compiler.input(source, "Color"), compiler.input(source, "Strength"))
    compiler.emit("volume", weight, ZERO, ZERO, light, ZERO)


def mix(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Mix Shader."""
    factor = compiler.saturated(compiler.input(source, "Fac"))
    _linked(compiler, source, "Shader", compiler.times(weight, compiler.rest(factor)))
    _linked(compiler, source, "Shader_001", compiler.times(weight, factor))


def add(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Add Shader."""
    _linked(compiler, source, "Shader", weight)
    _linked(compiler, source, "Shader_001", weight)


def _linked(compiler: Compiler, source: Source, identifier: str, weight: Operand) -> None:
    end = linked_shader(source.node, identifier, source.groups)
    if end is not None and weight != ZERO:
        _volume(compiler, end, weight)


def _warn_of_phase(compiler: Compiler, source: Source) -> None:
    phase = getattr(source.node, "phase", "HENYEY_GREENSTEIN")
    if phase != "HENYEY_GREENSTEIN":
        compiler.missing(f"{phase.title()} scattering", "Henyey-Greenstein is used")


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
