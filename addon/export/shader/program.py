"""Programs, instruction by instruction: of a material, and of a frame as arrays of the contract."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ..nodes import Color
from ..report import Warnings

if TYPE_CHECKING:
    from ..image import ImageTable, ImageUse

# Operands from here on name constants.
FIRST_CONSTANT = 1 << 31

# Rows of a ramp or curve.
TABLE_SIZE = 256


@dataclass(frozen=True)
class Value:
    """What an earlier instruction of the same program computed."""

    index: int


# A constant stands for itself; a number fills all three places.
Operand = Value | Color


@dataclass(frozen=True)
class Operation:
    """What an instruction may do; see `dualcone.operations()`."""

    number: int
    name: str
    inputs: tuple[str, ...]
    # What its parameter means: "none", "modes", "image", "table" or "attribute".
    kind: str
    modes: tuple[tuple[str, ...], ...]
    is_closure: bool

    def parameter(self, modes: Sequence[str]) -> int | None:
        """Number that stands for one choice of each list; None if one is not to be had."""
        number, radix = 0, 1
        for choices, choice in zip(self.modes, modes, strict=True):
            if choice not in choices:
                return None
            number += radix * choices.index(choice)
            radix *= len(choices)
        return number


class Operations:
    """The renderer's table of operations, by name."""

    def __init__(self, core: Any) -> None:
        self._rows = {
            row["name"]: Operation(
                number,
                row["name"],
                tuple(row["inputs"]),
                row["parameter"],
                tuple(tuple(choices) for choices in row["modes"]),
                row["is_closure"],
            )
            for number, row in enumerate(core.operations())
        }

    def __getitem__(self, name: str) -> Operation:
        return self._rows[name]


@dataclass(frozen=True)
class Instruction:
    """An operation, what it reads, and at which of the three points."""

    operation: Operation
    operands: tuple[Operand, ...]
    parameter: int
    point: int


@dataclass
class Program:
    """The program of one material, which frames may share: it counts its own tables and images."""

    instructions: list[Instruction] = field(default_factory=list)
    # Where it begins: what is written before is not run.
    start: int = 0
    tables: list[bytes] = field(default_factory=list)
    # Of the original images, which outlive the evaluated ones; pixels that are none of Blender's.
    images: list[ImageUse | np.ndarray] = field(default_factory=list)
    # What the program reads from meshes, by the names in `layers.py`.
    layers: set[str] = field(default_factory=set)
    # The same of what its volume reads from grids.
    grids: set[str] = field(default_factory=set)
    warnings: Warnings = field(default_factory=Warnings)

    @property
    def is_lasting(self) -> bool:
        """Whether it stays the same until Blender evaluates the material anew."""
        uses = (use for use in self.images if not isinstance(use, np.ndarray))
        return all(use.image.source not in ("SEQUENCE", "MOVIE") for use in uses)

    def table(self, rows: np.ndarray) -> int:
        """Number of a table of (TABLE_SIZE, 4) numbers."""
        self.tables.append(np.ascontiguousarray(rows, np.float32).tobytes())
        return len(self.tables) - 1

    def image(self, use: ImageUse) -> int:
        """Number of an image."""
        self.images.append(replace(use, image=use.image.original))
        return len(self.images) - 1

    def pixels(self, pixels: np.ndarray) -> int:
        """Number of an image (H, W, 4) that is none of Blender's."""
        self.images.append(pixels)
        return len(self.images) - 1


@dataclass
class Programs:
    """The programs of all materials of a frame, one after the other."""

    spans: list[tuple[int, int]] = field(default_factory=list)
    _instructions: array[int] = field(default_factory=lambda: array("I"))
    _operands: array[int] = field(default_factory=lambda: array("I"))
    _constants: dict[Color, int] = field(default_factory=dict)
    _tables: dict[bytes, int] = field(default_factory=dict)

    def count(self) -> int:
        """How many instructions there are."""
        return len(self._instructions) // 4

    def add(self, program: Program, images: ImageTable, depsgraph: bpy.types.Depsgraph) -> None:
        """Append a program, with the frame's numbers for its tables and images."""
        numbers = {
            "table": [self._table(content) for content in program.tables],
            "image": [_image_row(use, images, depsgraph) for use in program.images],
        }
        self.spans.append((self.count() + program.start, len(program.instructions) - program.start))
        for each in program.instructions:
            parameter = each.parameter
            if each.operation.kind in numbers:
                parameter = numbers[each.operation.kind][parameter]
            start = len(self._operands)
            self._instructions.extend((each.operation.number, start, parameter, each.point))
            self._operands.extend([self._number(operand) for operand in each.operands])

    def _table(self, content: bytes) -> int:
        """First row of a table."""
        return self._tables.setdefault(content, len(self._tables) * TABLE_SIZE)

    def arrays(self) -> dict[str, np.ndarray]:
        """The `material_programs` and `program_*` arrays of the contract."""
        tables = np.frombuffer(b"".join(self._tables), np.float32)
        return {
            "material_programs": np.array(self.spans, np.uint32).reshape(-1, 2),
            "program_instructions": np.array(self._instructions, np.uint32).reshape(-1, 4),
            "program_operands": np.array(self._operands, np.uint32),
            "program_constants": np.array(list(self._constants), np.float32).reshape(-1, 3),
            "program_tables": tables.reshape(-1, 4),
        }

    def _number(self, operand: Operand) -> int:
        if isinstance(operand, Value):
            return operand.index
        finite = tuple(x if abs(x) <= FLOAT_MAX else 0.0 for x in operand)
        return FIRST_CONSTANT + self._constants.setdefault(finite, len(self._constants))


def _image_row(
    use: ImageUse | np.ndarray, images: ImageTable, depsgraph: bpy.types.Depsgraph
) -> int:
    if isinstance(use, np.ndarray):
        return images.index_of_pixels(use)
    return images.index(replace(use, image=use.image.evaluated_get(depsgraph)))


FLOAT_MAX = float(np.finfo(np.float32).max)
