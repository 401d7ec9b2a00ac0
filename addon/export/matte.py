"""Cryptomatte: numbers that name objects, materials and assets, as Cycles makes them.

After the specification, "Cryptomatte Specification, version 1.2.0" (Friedman and Jones): a name's
MurmurHash3 is the bits of a float. The hash is after Austin Appleby's description of it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import cache
from typing import Any

# Passes of the contract by what they name.
OBJECT, MATERIAL, ASSET = "CryptoObject", "CryptoMaterial", "CryptoAsset"
# What Cycles calls the surface of what has no material.
NO_MATERIAL = "default_surface"

_WORD = 0xFFFFFFFF


@dataclass
class Mattes:
    """The names met in a frame."""

    # By pass: the hash of each name, in hexadecimal digits.
    manifests: dict[str, dict[str, str]] = field(
        default_factory=lambda: {OBJECT: {}, MATERIAL: {}, ASSET: {}}
    )

    def number(self, kind: str, name: str) -> float:
        """The number of a name, which is noted."""
        value = murmur3(name.encode())
        self.manifests[kind].setdefault(name, f"{value:08x}")
        return as_float(value)

    def of_object(self, owner: Any) -> tuple[float, float]:
        """The numbers of an object and of its asset, the parent above all."""
        return self.number(OBJECT, owner.name), self.number(ASSET, asset_of(owner).name)


def asset_of(owner: Any) -> Any:
    """The object at the top of the parents."""
    while owner.parent is not None:
        owner = owner.parent
    return owner


@cache
def murmur3(data: bytes) -> int:
    """MurmurHash3 of 32 bits, seed 0."""
    state = 0
    whole = len(data) // 4 * 4
    for at in range(0, whole, 4):
        state ^= _mixed(int.from_bytes(data[at : at + 4], "little"))
        state = (_rotated(state, 13) * 5 + 0xE6546B64) & _WORD
    state ^= _mixed(int.from_bytes(data[whole:], "little"))
    state ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        state = ((state ^ (state >> shift)) * factor) & _WORD
    return state ^ (state >> 16)


def _mixed(word: int) -> int:
    return (_rotated((word * 0xCC9E2D51) & _WORD, 15) * 0x1B873593) & _WORD


def _rotated(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _WORD


def as_float(value: int) -> float:
    """The float of these bits; exponents of infinities and of tiny numbers are moved by one."""
    exponent = min(max(value >> 23 & 0xFF, 1), 254)
    return struct.unpack("<f", struct.pack("<I", value & 0x807FFFFF | exponent << 23))[0]
