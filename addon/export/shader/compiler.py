"""Walks the nodes that reach a material's output and writes what they compute."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy

from ..nodes import LUMINANCE, Color, Constant, Source
from .layers import (
    ACTIVE_UV,
    GENERATED,
    STRAND,
    STRAND_INFO,
    VOLUME_GENERATED,
    layer_key,
)
from .program import Instruction, Operand, Operations, Program, Value

if TYPE_CHECKING:
    from collections.abc import Iterator


ZERO: Color = (0.0, 0.0, 0.0)
ONE: Color = (1.0, 1.0, 1.0)

# What the types of sockets hold.
NUMBER, COLOR, VECTOR = "number", "color", "vector"
KINDS = {"VALUE": NUMBER, "INT": NUMBER, "BOOLEAN": NUMBER, "RGBA": COLOR}

# Outputs of Hair Info that are not read off the strand's shape.
STRAND_INFOS = ("Intercept", "Length", "Random")


def kind_of(socket_type: str) -> str:
    """What a socket of this type holds."""
    return KINDS.get(socket_type, VECTOR)


class Compiler:
    """Writes the program of one material. Whatever the renderer leaves out becomes a warning."""

    def __init__(
        self,
        name: str,
        material_index: int,
        operations: Operations,
        is_lamp: bool = False,
    ) -> None:
        self.name = name
        self.material_index = material_index
        self.operations = operations
        self.is_lamp = is_lamp
        self.program = Program()
        # The normal of closures whose input is not linked; zero is the surface's own.
        self.normal: Operand = ZERO
        # How many pixels its bumps look around; they share the neighbours that they look at.
        self.filter_width: Color | None = None
        # Where the nodes at hand are evaluated: at the point itself, or at a neighbour for bumps.
        self._point = 0
        # Whether they are those of a volume, which has grids and no surface.
        self.is_inside = False
        self._values: dict[tuple, Operand] = {}
        self._under_way: set[tuple] = set()

    def emit(self, name: str, *operands: Operand, parameter: int = 0) -> Value:
        """Write an instruction and return its value."""
        instructions = self.program.instructions
        value = Value(len(instructions) - self.program.start)
        instructions.append(Instruction(self.operations[name], operands, parameter, self._point))
        return value

    def emit_with_modes(
        self, source: Source, name: str, operands: Sequence[Operand], modes: Sequence[str]
    ) -> Operand:
        """Write an instruction that has modes; zero with a warning if they are not to be had."""
        parameter = self.operations[name].parameter(modes)
        if parameter is None:
            unknown = [
                mode
                for mode, known in zip(modes, self.operations[name].modes, strict=True)
                if mode not in known
            ]
            self.missing(f"{', '.join(unknown)} of {source.label}", "zero is used")
            return ZERO
        return self.emit(name, *operands, parameter=parameter)

    def input(self, source: Source, identifier: str) -> Operand:
        """The value of an input, converted to what its socket holds.

        Where a node type is unknown it is the value in the input's own field, with a warning.
        """
        socket = source.input(identifier)
        if socket is None:
            return ZERO
        end = socket.follow()
        kind = kind_of(socket.socket.type)
        if isinstance(end, Constant):
            implicit = self._implicit(source, end)
            return self._constant(end, kind) if implicit is None else implicit
        value = self.output(end)
        if value is None:
            name = socket.socket.name
            self.missing(f"{end.label} in {name}", "its default value is used")
            return self._constant(Constant(socket.socket), kind)
        return self._passed(value, kind_of(end.output.type), (*map(kind_of, end.through), kind))

    def color(self, end: Source | Constant) -> Operand:
        """The value of a link as a colour; black, with a warning, where a node type is unknown."""
        if isinstance(end, Constant):
            return self._constant(end, COLOR)
        value = self.output(end)
        if value is None:
            self.missing(end.label, "black is used")
            return ZERO
        return self._passed(value, kind_of(end.output.type), (*map(kind_of, end.through), COLOR))

    def default(self, source: Source, identifier: str) -> Color:
        """The value in an input's own field."""
        socket = source.input(identifier)
        return Constant(socket.socket).color() if socket else ZERO

    def output(self, source: Source) -> Operand | None:
        """The value of a node's output; None if the type of the node is unknown."""
        from .nodes import NODES

        compile_node = NODES.get(source.node.bl_idname)
        if compile_node is None:
            return None
        key = (*source.key(), self._point, self.is_inside)
        if key in self._under_way:
            self.missing(f"a circle of links through {source.label}", "zero is used")
            return ZERO
        if key not in self._values:
            self._under_way.add(key)
            self._values[key] = compile_node(self, source)
            self._under_way.discard(key)
        return self._values[key]

    def layer(self, name: str, operation: str = "attribute") -> Value:
        """The value of a layer of the mesh; in a volume that of a grid."""
        if self.is_inside:
            name = name.replace("color:", "attribute:", 1)
            self.program.grids.add(name)
        else:
            self.program.layers.add(name)
        return self.emit(operation, parameter=layer_key(name))

    def uv(self, name: str = "") -> Value:
        """A texture coordinate; without a name that of the active UV map."""
        return self.layer(ACTIVE_UV + name)

    def generated(self) -> Value:
        """The coordinate in the bounds of the undeformed mesh; of a lamp that in its own space."""
        if self.is_lamp:
            return self.emit(
                "coordinate", parameter=self.operations["coordinate"].parameter(("Object",)) or 0
            )
        return self.layer(VOLUME_GENERATED if self.is_inside else GENERATED)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Evaluate nodes at points of a volume: each faces the ray."""
        before, self.is_inside, normal = self.is_inside, True, self.normal
        self.normal = ZERO
        try:
            yield
        finally:
            self.is_inside, self.normal = before, normal

    def hair_info(self, output: str) -> Value:
        """What strands tell by this output of the Hair Info node."""
        self.program.layers.add(STRAND_INFO if output in STRAND_INFOS else STRAND)
        return self.emit(
            "hair_info", parameter=self.operations["hair_info"].parameter((output,)) or 0
        )

    @contextmanager
    def at(self, point: int) -> Iterator[None]:
        """Evaluate nodes at a neighbour of the point."""
        before, self._point = self._point, point
        try:
            yield
        finally:
            self._point = before

    def times(self, first: Operand, second: Operand) -> Operand:
        """The product. What is zero is not computed, so that nobody looks up its textures."""
        if ZERO in (first, second):
            return ZERO
        if first == ONE:
            return second
        if second == ONE:
            return first
        if not isinstance(first, Value) and not isinstance(second, Value):
            return (first[0] * second[0], first[1] * second[1], first[2] * second[2])
        return self.emit("multiply", first, second)

    def saturated(self, operand: Operand) -> Operand:
        """Held between zero and one."""
        if isinstance(operand, Value):
            return self.emit("saturate", operand)
        red, green, blue = (min(max(x, 0.0), 1.0) for x in operand)
        return (red, green, blue)

    def rest(self, operand: Operand) -> Operand:
        """What is missing to one."""
        if isinstance(operand, Value):
            return self.emit("one_minus", operand)
        return (1.0 - operand[0], 1.0 - operand[1], 1.0 - operand[2])

    def warn(self, message: str) -> None:
        """Tell the user something about the material."""
        self.program.warnings.add(self.name, message)

    def give_up(self, reason: str) -> None:
        """Warn, and show a black surface: what was written so far may be half of something."""
        self.warn(f"{reason}, it is shown in black")
        self.program.start = len(self.program.instructions)

    def missing(self, what: str, instead: str = "") -> None:
        """Warn that `what` is left out, and say what is shown in its place."""
        suffix = f" ({instead})" if instead else ""
        self.warn(f"{what} is not rendered yet{suffix}")

    def holds(self, node: Source, identifier: str, value: float) -> bool:
        """Tell whether an input is this value everywhere; one that a node lacks counts as such."""
        socket = node.input(identifier)
        if socket is None:
            return True
        end = socket.follow()
        return not isinstance(end, Source) and all(field == value for field in end.color())

    def _implicit(self, source: Source, end: Constant) -> Operand | None:
        """What an input without a link and without a field stands for."""
        socket = end.socket
        # Inputs of groups have the value of their field.
        if (
            not socket.hide_value
            or socket.is_output
            or isinstance(socket.node, bpy.types.NodeGroup)
        ):
            return None
        if socket.identifier in ("Normal", "Coat Normal"):
            return self.normal
        if socket.identifier == "Tangent":
            return self._tangent(source)
        kind = source.node.bl_idname
        # White noise is the one texture that has no place of its own.
        if not kind.startswith("ShaderNodeTex") or kind == "ShaderNodeTexWhiteNoise":
            return None
        return self.uv() if kind == "ShaderNodeTexImage" else self.generated()

    def _tangent(self, source: Source) -> Operand:
        """The direction of a grain: around the object's Z axis; not asked for without a grain."""
        for identifier in ("Anisotropic", "Anisotropy"):
            socket = source.input(identifier)
            end = socket and socket.follow()
            if isinstance(end, Source) or (end and end.number() != 0.0):
                axis_z = self.operations["radial_tangent"].parameter(("Z",)) or 0
                return self.emit("radial_tangent", self.generated(), parameter=axis_z)
        return ZERO

    def _constant(self, constant: Constant, kind: str) -> Operand:
        value = constant.color()
        return self._passed(
            value, kind_of(constant.socket.type), (*map(kind_of, constant.through), kind)
        )

    def _passed(self, value: Operand, kind: str, through: Sequence[str]) -> Operand:
        """The value after the sockets that it passes: numbers keep no colour."""
        for following in through:
            if following == NUMBER and kind != NUMBER:
                value = self._number(value, kind)
            kind = following
        return value

    def _number(self, value: Operand, kind: str) -> Operand:
        if isinstance(value, Value):
            return self.emit("luminance" if kind == COLOR else "average", value)
        weights = LUMINANCE if kind == COLOR else (1 / 3, 1 / 3, 1 / 3)
        number = sum(w * x for w, x in zip(weights, value, strict=True))
        return (number, number, number)
