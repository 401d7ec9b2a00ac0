"""Materials as weighted closures: one small function per shader node, in a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

import bpy
import numpy as np

from .image import ImageTable
from .nodes import Color, Input, Source, active_output, find_input, surface
from .reader import MaterialReader
from .report import Warnings

BLACK = (0.0, 0.0, 0.0)
# What Blender shows on an object without a material.
DEFAULT_SURFACE = (0.8, 0.8, 0.8)


class Kind(IntEnum):
    """`closure_kind` of the contract."""

    PRINCIPLED = 0
    DIFFUSE = 1
    GLOSSY = 2
    EMISSION = 3
    TRANSPARENT = 4


@dataclass(frozen=True)
class Closure:
    """One row of the closure arrays."""

    kind: Kind
    weight: float
    color: Color = DEFAULT_SURFACE
    color_image: int = -1
    roughness: float = 0.5
    roughness_image: int = -1
    metallic: float = 0.0
    ior: float = 1.5
    specular: float = 0.5
    alpha: float = 1.0
    alpha_image: int = -1
    emission: Color = BLACK

    def has_image(self) -> bool:
        """Whether a texture replaces one of its values."""
        return max(self.color_image, self.roughness_image, self.alpha_image) >= 0


Closures = list[Closure]


@dataclass
class MaterialTable:
    """The materials of one frame, each once, in the order of their first use."""

    images: ImageTable
    warnings: Warnings
    closures: Closures = field(default_factory=list)
    # First closure and number of closures of each material.
    ranges: list[tuple[int, int]] = field(default_factory=list)
    # UV maps that each material asks for by name.
    uv_maps: list[set[str]] = field(default_factory=list)
    # Whether each material looks up images.
    is_textured: list[bool] = field(default_factory=list)
    _rows: dict[int | None, int] = field(default_factory=dict)

    def index(self, material: bpy.types.Material | None) -> int:
        """Row of an evaluated material; None is Blender's default surface."""
        key = material.original.session_uid if material else None
        if key not in self._rows:
            name = material.name if material else ""
            reader = MaterialReader(name, self.images, self.warnings)
            closures = read_material(reader, material)
            self._rows[key] = len(self.ranges)
            self.ranges.append((len(self.closures), len(closures)))
            self.uv_maps.append(reader.uv_maps)
            self.is_textured.append(any(closure.has_image() for closure in closures))
            self.closures += closures
        return self._rows[key]

    def arrays(self) -> dict[str, np.ndarray]:
        """The `material_*` and `closure_*` arrays of the contract."""

        def column(name: str, dtype: type, *shape: int) -> np.ndarray:
            values = [getattr(closure, name) for closure in self.closures]
            return np.array(values, dtype).reshape(len(values), *shape)

        arrays = {"material_closures": np.array(self.ranges, np.uint32).reshape(-1, 2)}
        arrays["closure_kind"] = column("kind", np.uint32)
        for name in ("weight", "roughness", "metallic", "ior", "specular", "alpha"):
            arrays[f"closure_{name}"] = column(name, np.float32)
        for name in ("color", "emission"):
            arrays[f"closure_{name}"] = column(name, np.float32, 3)
        for name in ("color_image", "roughness_image", "alpha_image"):
            arrays[f"closure_{name}"] = column(name, np.int32)
        return arrays


def uses_nodes(owner: bpy.types.Material | bpy.types.World) -> bool:
    """Whether the node tree counts. From Blender 5.0 on it always does and `use_nodes` is going."""
    return owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)


def read_material(reader: MaterialReader, material: bpy.types.Material | None) -> Closures:
    """The closures of an evaluated material, or of none."""
    if material is None:
        return [Closure(Kind.DIFFUSE, 1.0)]
    if not uses_nodes(material):
        red, green, blue, _ = material.diffuse_color
        return [Closure(Kind.DIFFUSE, 1.0, (red, green, blue))]
    output = active_output(material.node_tree)
    for identifier in ("Volume", "Displacement"):
        socket = output and find_input(output, identifier)
        if socket and isinstance(socket.follow(), Source):
            reader.missing(identifier)
    shader = surface(material.node_tree)
    return _shader(reader, shader, 1.0) if shader else []


def _shader(reader: MaterialReader, node: Source, weight: float) -> Closures:
    read = SHADERS.get(node.node.bl_idname)
    if read is not None:
        return read(reader, node, weight)
    reader.missing(node.label, "a diffuse surface is shown")
    color = reader.color(node, "Color") if node.input("Color") else DEFAULT_SURFACE
    return [Closure(Kind.DIFFUSE, weight, color)]


def _linked_shader(reader: MaterialReader, socket: Input | None, weight: float) -> Closures:
    """The closures linked to a shader's input; an unlinked one is black."""
    end = socket and socket.follow()
    if not isinstance(end, Source) or weight == 0.0:
        return []
    return _shader(reader, end, weight)


# Inputs of Principled that the renderer leaves out, the value at which they do nothing, and how
# Blender's panel calls them.
PRINCIPLED_LEFT_OUT = (
    ("Diffuse Roughness", 0.0, "Diffuse Roughness"),
    ("Subsurface Weight", 0.0, "Subsurface"),
    ("Specular Tint", 1.0, "Specular Tint"),
    ("Anisotropic", 0.0, "Anisotropic"),
    ("Transmission Weight", 0.0, "Transmission"),
    ("Coat Weight", 0.0, "Coat"),
    ("Sheen Weight", 0.0, "Sheen"),
    ("Thin Film Thickness", 0.0, "Thin Film"),
)


def principled(reader: MaterialReader, node: Source, weight: float) -> Closures:
    for identifier, neutral, what in PRINCIPLED_LEFT_OUT:
        reader.missing_unless(node, identifier, neutral, what)
    reader.missing_normal(node)
    color, color_image = reader.textured_color(node, "Base Color")
    roughness, roughness_image = reader.textured_number(node, "Roughness")
    alpha, alpha_image = reader.textured_alpha(node, "Alpha")
    closure = Closure(
        Kind.PRINCIPLED,
        weight,
        color,
        color_image,
        roughness,
        roughness_image,
        metallic=reader.number(node, "Metallic"),
        ior=reader.number(node, "IOR"),
        specular=reader.number(node, "Specular IOR Level"),
        alpha=alpha,
        alpha_image=alpha_image,
        emission=_radiance(reader, node, "Emission Color", "Emission Strength"),
    )
    return [closure]


def diffuse(reader: MaterialReader, node: Source, weight: float) -> Closures:
    reader.missing_unless(node, "Roughness", 0.0, "Roughness of Diffuse BSDF")
    reader.missing_normal(node)
    color, image = reader.textured_color(node, "Color")
    return [Closure(Kind.DIFFUSE, weight, color, image)]


def glossy(reader: MaterialReader, node: Source, weight: float) -> Closures:
    reader.missing_unless(node, "Anisotropy", 0.0, "Anisotropy")
    reader.missing_normal(node)
    if node.node.distribution not in ("GGX", "MULTI_GGX"):
        reader.missing(f"{node.node.distribution.title()} distribution", "GGX is used")
    color, color_image = reader.textured_color(node, "Color")
    roughness, roughness_image = reader.textured_number(node, "Roughness")
    return [Closure(Kind.GLOSSY, weight, color, color_image, roughness, roughness_image)]


def emission(reader: MaterialReader, node: Source, weight: float) -> Closures:
    radiance = _radiance(reader, node, "Color", "Strength")
    return [Closure(Kind.EMISSION, weight, BLACK, emission=radiance)]


def transparent(reader: MaterialReader, node: Source, weight: float) -> Closures:
    return [Closure(Kind.TRANSPARENT, weight, reader.color(node, "Color"))]


def mix(reader: MaterialReader, node: Source, weight: float) -> Closures:
    factor = min(max(reader.number(node, "Fac"), 0.0), 1.0)
    first = _linked_shader(reader, node.input("Shader"), weight * (1.0 - factor))
    return first + _linked_shader(reader, node.input("Shader_001"), weight * factor)


def add(reader: MaterialReader, node: Source, weight: float) -> Closures:
    first = _linked_shader(reader, node.input("Shader"), weight)
    return first + _linked_shader(reader, node.input("Shader_001"), weight)


def _radiance(reader: MaterialReader, node: Source, color: str, strength: str) -> Color:
    """Colour times strength. With a strength of zero nobody asks for the colour."""
    factor = reader.number(node, strength)
    if factor == 0.0:
        return BLACK
    red, green, blue = reader.color(node, color)
    return (red * factor, green * factor, blue * factor)


SHADERS: dict[str, Callable[[MaterialReader, Source, float], Closures]] = {
    "ShaderNodeBsdfPrincipled": principled,
    "ShaderNodeBsdfDiffuse": diffuse,
    "ShaderNodeBsdfAnisotropic": glossy,  # the id of Glossy since 4.0
    "ShaderNodeEmission": emission,
    "ShaderNodeBsdfTransparent": transparent,
    "ShaderNodeMixShader": mix,
    "ShaderNodeAddShader": add,
}
