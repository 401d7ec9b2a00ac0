"""Names of the values that a mesh keeps at its corners, as nodes ask for them.

A layer's name tells what it is: `uv:NAME`, `attribute:NAME`, `tangent:NAME` (along a UV map),
`color:NAME`, `generated`, `flat`, `strand` or `strand info`; volumes keep `attribute:NAME` in
grids. An empty NAME is the one that the mesh marks for rendering.
"""

from __future__ import annotations

import hashlib

ACTIVE_UV = "uv:"
GENERATED = "generated"
# One on the faces that are not smooth; a mesh that has it can be displaced.
FLAT = "flat"
# What strands have and meshes do not: where they go, how thick they are, and what Hair Info tells.
STRAND = "strand"
STRAND_INFO = "strand info"
# No layer: the material is meant for strands, and shades a mesh in another way than Cycles.
HAIR = "hair"
OF_STRANDS = frozenset((STRAND, STRAND_INFO, HAIR))
# No layer, either: the material asks for the particle that an instance shows.
PARTICLE = "particle"
# The coordinate within a volume, which follows from the place.
VOLUME_GENERATED = "volume:generated"
# Those that the renderer knows, by their numbers.
KNOWN = (ACTIVE_UV, FLAT, "undisplaced", VOLUME_GENERATED, STRAND, STRAND_INFO)


def layer_key(layer: str) -> int:
    """Number by which programs and meshes name a layer; first those that the renderer knows."""
    if layer in KNOWN:
        return KNOWN.index(layer)
    return int.from_bytes(hashlib.blake2b(layer.encode(), digest_size=4).digest(), "little")


def output_key(name: str) -> int:
    """Number by which programs name a pass of the user's own."""
    return layer_key(f"output:{name}")
