"""The number between zero and one that Object Info tells each object and instance apart by."""

from __future__ import annotations

from functools import cache

import bpy

WORD = 0xFFFFFFFF  # the largest of the numbers behind it


def random_number(item: bpy.types.DepsgraphObjectInstance) -> float:
    """Blender's number of an instance; Cycles makes that of other objects of their names."""
    if item.is_instance:
        return (item.random_id & WORD) / WORD  # handed out as a signed number
    return number_of_name(item.object.name)


@cache
def number_of_name(name: str) -> float:
    """The same number as Cycles', so that a random colour stays when the engine changes."""
    word = 0
    for byte in name.encode():
        word = (37 * word + byte) & WORD
    return _mixed(word) / WORD


def _mixed(word: int) -> int:
    """Bob Jenkins' lookup3 (public domain) of two words, the second one zero."""
    start = (0xDEADBEEF + (2 << 2) + 13) & WORD
    changing, mixed, next_one = start, start, (start + word) & WORD
    for turn in (14, 11, 25, 16, 4, 14, 24):
        new = ((changing ^ mixed) - _turned(mixed, turn)) & WORD
        changing, mixed, next_one = next_one, new, mixed
    return mixed


def _turned(word: int, bits: int) -> int:
    return (word << bits | word >> (32 - bits)) & WORD
