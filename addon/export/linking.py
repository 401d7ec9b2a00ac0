"""Light linking: the things that a lamp lights, and those that stop its light, as numbered sets.

And light groups, whose light passes show on its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

# Number 0 is the set of all things; the contract has 64 bits.
EVERYTHING = 0
SETS_MAX = 64
# Number of the light group of what is in none; the contract has 8 bits.
NO_GROUP = 0
GROUPS_MAX = 255

# The numbers of a view layer's light groups by their names.
LightGroups = dict[str, int]


def light_groups(view_layer: Any) -> LightGroups:
    """Number the light groups of a view layer, as many as there may be."""
    names = [group.name for group in view_layer.lightgroups]
    return {name: number for number, name in enumerate(names[:GROUPS_MAX], NO_GROUP + 1)}


@dataclass(frozen=True)
class LinkSet:
    """The things of a collection that are included, or all but those that are excluded."""

    included: frozenset[int]
    excluded: frozenset[int]

    @staticmethod
    def of(collection: Any) -> LinkSet:
        """Read a linking collection; as in Blender an excluded thing is out in any case."""
        states: dict[str, set[int]] = {"INCLUDE": set(), "EXCLUDE": set()}
        for thing, state in _linked(collection):
            states[state].add(thing)
        return LinkSet(frozenset(states["INCLUDE"]), frozenset(states["EXCLUDE"]))

    def holds(self, *names: int) -> bool:
        """Whether a thing that goes by any of these names is in the set."""
        is_in = not self.included or not self.included.isdisjoint(names)
        return is_in and self.excluded.isdisjoint(names)


def _linked(collection: Any) -> Iterator[tuple[int, str]]:
    """Things of a collection, by session, and whether they are included or excluded."""
    for thing, entry in zip(collection.objects, collection.collection_objects, strict=True):
        yield name_of(thing), entry.light_linking.link_state
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        for thing in child.all_objects:
            yield name_of(thing), entry.light_linking.link_state


def name_of(thing: Any) -> int:
    """Tells an object from all others in this session, evaluated or not."""
    return thing.original.session_uid


@dataclass
class LinkSets:
    """The sets of one frame, for light or for shadows, each once."""

    _numbers: dict[LinkSet, int] = field(default_factory=dict)

    def number(self, collection: Any) -> int | None:
        """Number of a collection's set; None where there are too many."""
        if collection is None:
            return EVERYTHING
        found = LinkSet.of(collection)
        if not found.included and not found.excluded:
            return EVERYTHING
        if found not in self._numbers and len(self._numbers) + 1 >= SETS_MAX:
            return None
        return self._numbers.setdefault(found, len(self._numbers) + 1)

    def bits(self, names: tuple[int, ...]) -> int:
        """The sets that hold a thing, as bits; the set of all things does."""
        held = (number for found, number in self._numbers.items() if found.holds(*names))
        return 1 << EVERYTHING | sum(1 << number for number in held)
