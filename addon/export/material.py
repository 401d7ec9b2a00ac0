"""Materials, and the nodes of lights: each once, as programs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import bpy
import numpy as np

from .cache import ExportCache
from .image import ImageTable
from .matte import MATERIAL, NO_MATERIAL, Mattes
from .nodes import (
    RecursiveGroup,
    Source,
    active_output,
    find_input,
    linked_shader,
    nodes_of,
    surface,
)
from .report import Warnings
from .shader import (
    Compiler,
    Operations,
    Program,
    Programs,
    compile_surface,
    compile_volume,
    default_volume,
)
from .shader.closures import default_surface, diffuse_surface
from .shader.compiler import ONE
from .shader.layers import FLAT, output_key
from .shader.nodes import displaced_normal

# Stands in for the `session_uid` of the default volume; Blender's are not negative.
DEFAULT_VOLUME = -1


@dataclass(frozen=True)
class Traits:
    """What a material is beside its nodes."""

    transparent_shadow: bool = True
    bump_correction: bool = True

    @staticmethod
    def of(material: bpy.types.Material | None) -> Traits:
        """Those of an evaluated material."""
        settings: Any = getattr(material, "cycles", None)
        corrects = getattr(settings, "use_bump_map_correction", True)
        return Traits(casts_transparent_shadow(material), corrects)

    @staticmethod
    def arrays(all_traits: Sequence[Traits]) -> dict[str, np.ndarray]:
        """Their columns in the contract."""
        names = [item.name for item in fields(Traits)]
        return {
            f"material_{name}": np.array([getattr(t, name) for t in all_traits], np.uint32)
            for name in names
        }


@dataclass
class MaterialTable:
    """The materials of one frame, each once, in the order of their first use."""

    depsgraph: bpy.types.Depsgraph
    cache: ExportCache
    core: Any
    images: ImageTable
    warnings: Warnings
    # Hashes of the names of the user's own passes that are asked for.
    outputs: frozenset[int] = frozenset()
    # Where Cryptomatte's names are noted, if they are asked for.
    mattes: Mattes | None = None
    programs: Programs = field(default_factory=Programs)
    # What each material reads from meshes, by the names in `shader/layers.py`.
    layers: list[frozenset[str]] = field(default_factory=list)
    # The same of what their volumes read from grids.
    grids: list[frozenset[str]] = field(default_factory=list)
    _pass_indices: list[int] = field(default_factory=list)
    _traits: list[Traits] = field(default_factory=list)
    _matte_numbers: list[float] = field(default_factory=list)
    _rows: dict[int, int] = field(default_factory=dict)

    @cached_property
    def _operations(self) -> Operations:
        return Operations(self.core)

    def index(self, material: bpy.types.Material | None) -> int:
        """Row of an evaluated material; None is Blender's default surface."""
        uid = material.original.session_uid if material else 0  # Blender counts from one
        name, pass_index = (material.name, material.pass_index) if material else ("", 0)
        compiler = Compiler(name, pass_index, self._operations)

        def write() -> None:
            compile_material(compiler, material)
            if self.outputs and material and uses_nodes(material):
                compile_outputs(compiler, material, self.outputs)

        return self._row(uid, compiler, write, Traits.of(material))

    def index_of_volume(self, material: bpy.types.Material | None) -> int:
        """The same for the material of a volume object; None is Blender's default volume."""
        if material is not None:
            return self.index(material)
        compiler = Compiler("", 0, self._operations)

        def write() -> None:
            default_volume(compiler)
            compiler.emit("transparent", ONE, ONE)

        return self._row(DEFAULT_VOLUME, compiler, write)

    def index_of_light(self, light: bpy.types.Light) -> int:
        """Row of an evaluated light's nodes, which are compiled as a material's."""
        compiler = Compiler(light.name, 0, self._operations, is_lamp=True)

        def write() -> None:
            with failures_told(compiler):
                compile_surface(compiler, surface(light.node_tree))

        return self._row(light.original.session_uid, compiler, write)

    def index_of_world(self, world: bpy.types.World | None) -> int:
        """Row of what fills an evaluated world; -1 for nothing."""
        if world is None or not uses_nodes(world):
            return -1
        output = active_output(world.node_tree)
        if output is None or not output.inputs["Volume"].is_linked:
            return -1
        compiler = Compiler(world.name, 0, self._operations)

        def write() -> None:
            with failures_told(compiler):
                if volume := linked_shader(output, "Volume"):
                    compile_volume(compiler, volume)

        return self._row(world.original.session_uid, compiler, write)

    def _row(
        self,
        uid: int,
        compiler: Compiler,
        compile_owner: Callable[[], None],
        traits: Traits = Traits(),
    ) -> int:
        if uid not in self._rows:
            program = self._program(uid, compiler, compile_owner)
            self.warnings.add_all(program.warnings)
            self.programs.add(program, self.images, self.depsgraph)
            self._rows[uid] = len(self.layers)
            self.layers.append(frozenset(program.layers))
            self.grids.append(frozenset(program.grids))
            self._pass_indices.append(compiler.material_index)
            self._traits.append(traits)
            if self.mattes:
                name = compiler.name or NO_MATERIAL
                self._matte_numbers.append(self.mattes.number(MATERIAL, name))
        return self._rows[uid]

    def _program(self, uid: int, compiler: Compiler, compile_owner: Callable[[], None]) -> Program:
        """The owner's program, compiled only if it may have changed."""
        program = self.cache.programs.get(uid)
        if program is None:
            compile_owner()
            program = compiler.program
            self.cache.statistics.materials_compiled += 1
            if program.is_lasting:
                self.cache.programs[uid] = program
        return program

    def arrays(self) -> dict[str, np.ndarray]:
        """The `material_*` and `program_*` arrays of the contract."""
        indices = np.array(self._pass_indices, np.float32)
        mattes = np.array(self._matte_numbers, np.float32)
        programs = self.programs.arrays()
        return {
            **programs,
            "material_index": indices,
            **Traits.arrays(self._traits),
            "material_mattes": mattes,
        }


def uses_nodes(owner: bpy.types.Material | bpy.types.World) -> bool:
    """Whether the node tree counts. From Blender 5.0 on it always does and `use_nodes` is going."""
    return owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)


def casts_transparent_shadow(material: bpy.types.Material | None) -> bool:
    """Whether rays that look for a light pass a material where others do.

    A body of nothing but a volume has no surface that could stop them.
    """
    if material is None or material.use_transparent_shadow:
        return True
    try:
        return uses_nodes(material) and surface(material.node_tree) is None
    except RecursiveGroup:
        return False


def compile_material(compiler: Compiler, material: bpy.types.Material | None) -> None:
    """Write the program of an evaluated material, or of none."""
    if material is None:
        default_surface(compiler)
    elif not uses_nodes(material):
        red, green, blue, _ = material.diffuse_color
        diffuse_surface(compiler, (red, green, blue))
    else:
        with failures_told(compiler):
            _compile_tree(compiler, material)


def compile_outputs(
    compiler: Compiler, material: bpy.types.Material, wanted: Collection[int]
) -> None:
    """Write what the AOV Output nodes send to passes of these names (hashes)."""
    try:
        for node in nodes_of(material.node_tree, "ShaderNodeOutputAOV"):
            key = output_key(node.node.aov_name)
            if key in wanted:
                color, value = compiler.input(node, "Color"), compiler.input(node, "Value")
                compiler.emit("output", color, value, parameter=key)
    except (RecursiveGroup, RecursionError):
        pass  # The surface's own compilation has told the user.


@contextmanager
def failures_told(compiler: Compiler) -> Iterator[None]:
    """Give up, and tell the user why, where nodes lead round in circles or too far."""
    try:
        yield
    except RecursiveGroup as group:
        compiler.give_up(f"the node group '{group}' contains itself")
    except RecursionError:
        compiler.give_up("its chains of nodes are too long")


def _compile_tree(compiler: Compiler, material: bpy.types.Material) -> None:
    output = active_output(material.node_tree)
    if displacement := _linked(output, "Displacement"):
        _displace(compiler, material, displacement)
    shader = surface(material.node_tree)
    compile_surface(compiler, shader)
    if volume := linked_shader(output, "Volume"):
        compile_volume(compiler, volume)
        _warn_of_interpolation(compiler, material)
        if shader is None:
            compiler.emit("transparent", ONE, ONE)  # nothing but the volume is seen


def _warn_of_interpolation(compiler: Compiler, material: bpy.types.Material) -> None:
    """Cycles can blend voxels smoothly."""
    cycles = getattr(material, "cycles", None)
    if compiler.program.grids and getattr(cycles, "volume_interpolation", "LINEAR") == "CUBIC":
        compiler.missing("Cubic interpolation of volumes", "Linear is used")


def _linked(output: bpy.types.Node | None, identifier: str) -> Source | None:
    socket = output and find_input(output, identifier)
    end = socket and socket.follow()
    return end if isinstance(end, Source) else None


def _displace(compiler: Compiler, material: bpy.types.Material, displacement: Source) -> None:
    """Move vertices, bend the normal as the displaced surface would, or both."""
    moved = compiler.output(displacement)
    if moved is None:
        compiler.missing(displacement.label)
        return
    method = material.displacement_method
    if method != "DISPLACEMENT":
        compiler.normal = displaced_normal(compiler, displacement, method == "BOTH")
        compiler.emit("bent", compiler.normal)
    if method != "BUMP":
        compiler.program.layers.add(FLAT)
        compiler.emit("displaced", moved, parameter=int(method == "BOTH"))
