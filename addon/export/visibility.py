"""Which rays see a thing, as bits of the contract."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any

# `instance_visibility` of the contract: a flag of Blender's Ray Visibility for each bit, in order.
RAYS = ("camera", "diffuse", "glossy", "transmission", "shadow")
CAMERA = 1
SHADOW = 16
ALL = 31


def bits(owner: Any, prefix: str = "visible_") -> int:
    """The rays whose flags are set; `prefix` stands before their names."""
    return sum(1 << bit for bit, is_set in enumerate(_flags(prefix)(owner)) if is_set)


@cache
def _flags(prefix: str) -> Callable[[Any], tuple[bool, ...]]:
    return attrgetter(*(prefix + ray for ray in RAYS))
