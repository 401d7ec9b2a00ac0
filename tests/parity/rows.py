"""Rows of the table of features."""

from __future__ import annotations

import ast
import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import stage

Build = Callable[..., None]


@dataclass(frozen=True)
class Row:
    """One feature with one value. `build(stage, **values)` makes its scene."""

    group: str
    name: str
    build: Build
    values: dict[str, Any]
    # Camera rays per pixel of each of two renders.
    samples: int = 64
    # Whether Blender strews its things anew whenever the scene is built: pixels cannot agree then.
    is_strewn: bool = False

    @property
    def key(self) -> str:
        """Name of its files."""
        words = f"{self.group} {self.name}".lower()
        return "-".join("".join(c if c.isalnum() else " " for c in words).split())

    def digest(self) -> str:
        """Hash of all that its pictures depend on but the two renderers."""
        sources = (without_format(inspect.getsource(what)) for what in (stage, self.build))
        content = f"{list(sources)}{sorted(self.values.items())!r}{self.samples}"
        return hashlib.blake2b(content.encode(), digest_size=12).hexdigest()


def table(group: str, *lines: tuple[Any, ...]) -> list[Row]:
    """Rows of one group from lines `(name, build, values)`, with `samples` and `is_strewn` among the values."""
    rows = []
    for name, build, *rest in lines:
        values = dict(rest[0]) if rest else {}
        samples, is_strewn = values.pop("samples", 64), values.pop("is_strewn", False)
        rows.append(Row(group, name, build, values, samples, is_strewn))
    return rows


def without_format(source: str) -> str:
    """Return the source without comments and as Python would write it."""
    return ast.unparse(ast.parse(source))
