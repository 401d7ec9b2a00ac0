"""Shaders as weighted closures: one small function per shader node, in a table."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..nodes import Constant, Source, linked_shader
from .compiler import ONE, ZERO, Compiler
from .layers import HAIR, STRAND
from .program import Operand, Operation
from .volumes import VOLUMES

# Blender's reflectance where nothing is known.
DEFAULT_SURFACE = (0.8, 0.8, 0.8)
# The parameter of a `principled` that loses nothing to roughness, Cycles' Multiscatter GGX.
KEEPS_ALL = 1


def compile_surface(compiler: Compiler, shader: Source | Constant | None) -> None:
    """Write the closures of the shader linked to a material's output, or of a colour there."""
    if shader is not None:
        _shader(compiler, shader, ONE)


def diffuse_surface(compiler: Compiler, color: Operand, weight: Operand = ONE) -> None:
    """Write a diffuse closure, the stand-in where there is nothing better."""
    compiler.emit("diffuse", weight, color, ZERO, compiler.normal)


def default_surface(compiler: Compiler) -> None:
    """Write what shows without a material: from Blender 5.0 on Principled, until then diffuse."""
    if bpy.app.version < (5, 0, 0):
        diffuse_surface(compiler, DEFAULT_SURFACE)
        return
    given: dict[str, Operand] = {
        "Weight": ONE,
        "Base Color": DEFAULT_SURFACE,
        "Roughness": (0.5, 0.5, 0.5),
        "IOR": (1.5, 1.5, 1.5),
        "Specular IOR Level": (0.5, 0.5, 0.5),
        "Specular Tint": ONE,
    }
    operands = (given.get(name, ZERO) for name in compiler.operations["principled"].inputs)
    compiler.emit("principled", *operands, parameter=KEEPS_ALL)


def _shader(compiler: Compiler, end: Source | Constant, weight: Operand) -> None:
    if isinstance(end, Constant) or end.output.type != "SHADER":
        # A colour in a shader's place glows, as in Cycles.
        compiler.emit("emission", weight, compiler.color(end))
    elif compile_shader := SHADERS.get(end.node.bl_idname):
        compile_shader(compiler, end, weight)
    elif end.node.bl_idname not in VOLUMES:  # those do nothing to a surface
        _stand_in(compiler, end, weight)


def _stand_in(compiler: Compiler, source: Source, weight: Operand) -> None:
    """A diffuse surface in the place of a shader of unknown type."""
    compiler.missing(source.label, "a diffuse surface is shown")
    has_color = source.input("Color") is not None
    color = compiler.input(source, "Color") if has_color else DEFAULT_SURFACE
    diffuse_surface(compiler, color, weight)


def _linked_shader(compiler: Compiler, source: Source, identifier: str, weight: Operand) -> None:
    """The closures linked to a shader's input; an unlinked one is black."""
    end = linked_shader(source.node, identifier, source.groups)
    if end is not None and weight != ZERO:
        _shader(compiler, end, weight)


def _closure(compiler: Compiler, source: Source, name: str, weight: Operand) -> None:
    """The closure `name` with the node's inputs, and what its distribution says."""
    operation = compiler.operations[name]
    operands = (compiler.input(source, identifier) for identifier in operation.inputs[1:])
    parameter = operation.parameter(_modes(source, operation)) or 0
    compiler.emit(name, weight, *operands, parameter=parameter)


def _modes(source: Source, operation: Operation) -> list[str]:
    """What the node chooses of each of the operation's lists."""
    distribution = getattr(source.node, "distribution", "")
    below = getattr(source.node, "subsurface_method", getattr(source.node, "falloff", ""))
    component = getattr(source.node, "component", "")  # of Toon
    if below not in SUBSURFACE_METHODS:
        below = "RANDOM_WALK"
    keeps_all = str(distribution == "MULTI_GGX")
    if distribution not in (*DISTRIBUTIONS, *FIBRES):
        distribution = "GGX"
    metal = getattr(source.node, "fresnel_type", "")  # of Metallic
    filmed = "METALS" if bpy.app.version >= (5, 0, 0) else "DIELECTRICS"
    chosen = (keeps_all, distribution, below, component, metal, filmed)
    return [mode for modes in operation.modes for mode in chosen if mode in modes]


# How microfacets may lie, and the closures that know all of them.
DISTRIBUTIONS = ("GGX", "MULTI_GGX", "BECKMANN")
MICROFACETS = ("glossy", "metallic", "glass", "refraction")
# How the fibres of cloth may stand.
FIBRES = ("MICROFIBER", "ASHIKHMIN")
# How light may scatter below a surface.
SUBSURFACE_METHODS = ("RANDOM_WALK", "RANDOM_WALK_SKIN", "BURLEY")


def closure(name: str) -> Shader:
    """A node that is one closure."""

    def compile_closure(compiler: Compiler, source: Source, weight: Operand) -> None:
        _warn_of_closure(compiler, source, name)
        _closure(compiler, source, name, weight)

    return compile_closure


def _warn_of_closure(compiler: Compiler, source: Source, name: str) -> None:
    distribution = getattr(source.node, "distribution", "GGX")
    known = DISTRIBUTIONS if name in MICROFACETS else ("GGX", "MULTI_GGX", *FIBRES)
    if distribution not in known:
        what = distribution.replace("_", "-").title()
        compiler.missing(f"{what} distribution", "GGX is used")


def principled(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Reflection, light and transparency of a Principled BSDF."""
    alpha = compiler.saturated(compiler.input(source, "Alpha"))
    opaque = compiler.times(weight, alpha)
    _closure(compiler, source, "principled", opaque)
    if not is_dark(compiler, source):
        _emission(compiler, source, "Emission Color", "Emission Strength", opaque, below_layers)
    if alpha != ONE:
        compiler.emit("transparent", compiler.times(weight, compiler.rest(alpha)), ONE)


def is_dark(compiler: Compiler, source: Source) -> bool:
    """Whether a Principled BSDF's strength is a number that gives no light, as those below zero."""
    strength = source.input("Emission Strength")
    end = strength and strength.follow()
    return isinstance(end, Constant) and end.number() <= 0.0


def hair(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Principled Hair BSDF. Strands bring their own random number."""
    if source.node.model != "CHIANG":
        compiler.missing("Huang's model of Principled Hair", "Chiang's is used")
    operation = compiler.operations["hair"]
    given: dict[str, Operand] = {"Weight": weight, "Random": _strand_random(compiler, source)}
    operands = [
        given[name] if name in given else compiler.input(source, name) for name in operation.inputs
    ]
    compiler.program.layers |= {STRAND, HAIR}
    parameter = operation.parameter((source.node.parametrization,)) or 0
    compiler.emit("hair", *operands, parameter=parameter)


def _strand_random(compiler: Compiler, source: Source) -> Operand:
    """What varies the hair, if anything."""
    socket = source.input("Random")
    if socket is not None and isinstance(socket.follow(), Source):
        return compiler.input(source, "Random")
    if all(compiler.holds(source, f"Random {what}", 0.0) for what in ("Color", "Roughness")):
        return ZERO
    return compiler.hair_info("Random")


def streak(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Hair BSDF."""
    compiler.program.layers.add(STRAND)
    operation = compiler.operations["streak"]
    operands = (compiler.input(source, name) for name in operation.inputs[1:])
    parameter = operation.parameter((source.node.component,)) or 0
    compiler.emit("streak", weight, *operands, parameter=parameter)


def emission(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Emission."""
    _emission(compiler, source, "Color", "Strength", weight)


def holdout(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Holdout: a hole in the picture."""
    compiler.emit("holdout", weight)


def mix(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Mix Shader."""
    factor = compiler.saturated(compiler.input(source, "Fac"))
    first = compiler.times(weight, compiler.rest(factor))
    _linked_shader(compiler, source, "Shader", first)
    _linked_shader(compiler, source, "Shader_001", compiler.times(weight, factor))


def add(compiler: Compiler, source: Source, weight: Operand) -> None:
    """Add Shader."""
    _linked_shader(compiler, source, "Shader", weight)
    _linked_shader(compiler, source, "Shader_001", weight)


def below_layers(compiler: Compiler, source: Source) -> Operand:
    """Share of a Principled BSDF's own light that its sheen and coat let through."""
    if all(compiler.holds(source, f"{layer} Weight", 0.0) for layer in ("Coat", "Sheen")):
        return ONE
    inputs = compiler.operations["below_layers"].inputs
    return compiler.emit("below_layers", *(compiler.input(source, name) for name in inputs))


def _emission(
    compiler: Compiler,
    source: Source,
    color: str,
    strength: str,
    weight: Operand,
    share: Callable[[Compiler, Source], Operand] = lambda *_: ONE,
) -> None:
    """Light; with a strength of zero nobody asks for its colour, nor for the share that leaves."""
    factor = compiler.input(source, strength)
    if factor != ZERO:
        radiance = compiler.times(compiler.input(source, color), factor)
        compiler.emit("emission", weight, compiler.times(radiance, share(compiler, source)))


Shader = Callable[[Compiler, Source, Operand], None]

SHADERS: dict[str, Shader] = {
    "ShaderNodeAddShader": add,
    "ShaderNodeBsdfAnisotropic": closure("glossy"),  # the id of Glossy since 4.0
    "ShaderNodeBsdfDiffuse": closure("diffuse"),
    "ShaderNodeBsdfGlass": closure("glass"),
    "ShaderNodeBsdfHair": streak,
    "ShaderNodeBsdfHairPrincipled": hair,
    "ShaderNodeBsdfMetallic": closure("metallic"),
    "ShaderNodeBsdfPrincipled": principled,
    "ShaderNodeBsdfRefraction": closure("refraction"),
    "ShaderNodeBsdfSheen": closure("sheen"),
    "ShaderNodeBsdfToon": closure("toon"),
    "ShaderNodeBsdfTranslucent": closure("translucent"),
    "ShaderNodeBsdfTransparent": closure("transparent"),
    "ShaderNodeEmission": emission,
    "ShaderNodeHoldout": holdout,
    "ShaderNodeMixShader": mix,
    "ShaderNodeSubsurfaceScattering": closure("subsurface"),
}
