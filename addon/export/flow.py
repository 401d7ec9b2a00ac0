"""Where things are in the frames before and after, for the pass Vector."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from .instance import Placed
from .motion import TimeTable, differs
from .shutter import Times
from .transform import is_singular

BEFORE, AFTER = Fraction(-1), Fraction(1)
# All things are looked at there, as Cycles does, whatever their motion blur.
TIMES: Times = (BEFORE, AFTER)


@dataclass
class FlowTable(TimeTable):
    """What differs in the frames around. Time 1 is a frame later, -1 a frame earlier."""

    def _times(self, placed: Placed) -> Times:
        return TIMES

    def _times_of_camera(self) -> Times:
        return TIMES

    def _is_deforming(self, placed: Placed) -> bool:
        return placed.shape.positions is not None

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of the contract that begin with `flow_`."""
        base = self.instances.all_matrices()
        ways = self._ways(np.arange(len(base)), TIMES)
        # What is not there, or flat, counts as still.
        lost = np.isnan(ways).any(axis=(2, 3)) | is_singular(ways.reshape(-1, 3, 4)).reshape(-1, 2)
        ways = np.where(lost[..., None, None], base[:, None], ways)
        first_vertices, vertices = self._forms()
        moves = differs(ways, base[:, None]).any(axis=(1, 2, 3)) | (first_vertices >= 0)
        keep = self.instances.keep
        return {
            "flow_camera": self._cameras("world_from_camera"),
            "flow_camera_clip": self._cameras("clip_from_camera"),
            "flow_instances": np.flatnonzero(moves[keep]).astype(np.uint32),
            "flow_placements": ways[keep & moves],
            "flow_first_vertex": first_vertices[keep & moves],
            "flow_vertices": vertices,
        }

    def _cameras(self, name: str) -> np.ndarray:
        return np.stack([self._camera[time][name] for time in TIMES])

    def _forms(self) -> tuple[np.ndarray, np.ndarray]:
        """First vertex of each instance's forms (I,), -1 for none, and the vertices (W, 2, 3)."""
        firsts: dict[int, int] = {}
        forms = [np.empty((0, 2, 3), np.float32)]
        count = 0
        for placed, found in self._moved_shapes():
            base = self._base_positions(placed.shape)
            form = np.stack([found.get(time, base) for time in TIMES], axis=1)
            firsts[id(placed.shape)] = count
            forms.append(form)
            count += len(form)
        of_instances = np.full(len(self.instances.all_matrices()), -1, np.int32)
        for placed in self.instances.placed():
            first = firsts.get(id(placed.shape), -1)
            of_instances[placed.row : placed.row + placed.count] = first
        return of_instances, np.concatenate(forms)


def still_flow() -> dict[str, np.ndarray]:
    """The same arrays where no pass asks for them."""
    return {
        "flow_camera": np.empty((0, 3, 4), np.float32),
        "flow_camera_clip": np.empty((0, 4, 4), np.float32),
        "flow_instances": np.empty(0, np.uint32),
        "flow_placements": np.empty((0, 2, 3, 4), np.float32),
        "flow_first_vertex": np.empty(0, np.int32),
        "flow_vertices": np.empty((0, 2, 3), np.float32),
    }
