"""What is elsewhere at other times: objects, vertices, the camera.

The rest of the export shows the middle of the shutter's time. From there the scene is moved to the
times that are asked for, and what differs there is kept: for motion blur those that the shutter
passes, as the objects and the camera want them; for the pass Vector the frames before and after.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from .cache import CachedMesh
from .camera import camera_matrices
from .instance import InstanceTable, Placed, Shape
from .points import placements, read_points
from .report import ExportStopped
from .shutter import SetTime, Times, motion_steps, motion_times, set_time
from .transform import is_singular

# Relative difference of two matrices from which on something moves.
STILL = 1e-6
# The camera's arrays at one time, and those of the contract for all times.
CAMERA_ARRAYS = {"world_from_camera": "camera_motion", "clip_from_camera": "camera_motion_clip"}


@dataclass
class TimeTable(ABC):
    """What differs at other times from the exported one, for the objects of an exported frame."""

    instances: InstanceTable
    # The arrays of the exported camera.
    camera: dict[str, np.ndarray]
    resolution: tuple[int, int]
    # By time: rows (N,) of the instances that were there, and where they were (N, 3, 4).
    _matrices: dict[Fraction, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    # By shape: positions (V, 3) at the times when Blender evaluated it anew.
    _positions: dict[int, dict[Fraction, np.ndarray]] = field(default_factory=dict)
    # What was not there, or another thing, at some time.
    _lost_shapes: set[int] = field(default_factory=set)
    _camera: dict[Fraction, dict[str, np.ndarray]] = field(default_factory=dict)

    def read(self, middle: float, unit: float, move: SetTime) -> None:
        """Look at the scene at all times but the middle one.

        Args:
            middle: the exported time [frames].
            unit: how far from there the time 1 is [frames].
            move: moves the scene, which is left at the last of the times.

        Raises:
            ExportStopped: the user wants to stop.
        """
        depsgraph = self.instances.depsgraph
        camera = depsgraph.scene.camera
        camera_times = self._times_of_camera()
        times = set(camera_times).union(*{self._times(p) for p in self.instances.placed()})
        for time in sorted(times - {Fraction(0)}):
            if self.instances.should_stop():
                raise ExportStopped
            set_time(move, middle + float(time) * unit)
            if time in camera_times:
                found = camera.evaluated_get(depsgraph)
                self._camera[time] = camera_matrices(found, depsgraph, self.resolution)
            self._read_objects(time)

    @abstractmethod
    def _times(self, placed: Placed) -> Times:
        """When an instance is looked at."""

    @abstractmethod
    def _times_of_camera(self) -> Times:
        """When the camera is looked at."""

    @abstractmethod
    def _is_deforming(self, placed: Placed) -> bool:
        """Whether its vertices are looked at, too."""

    def _read_objects(self, time: Fraction) -> None:
        changed = self.instances.cache.changed(self.instances.depsgraph)
        rows, matrices = array("q"), array("f")
        read: set[int] = set()
        for item, owner, all_placed in self.instances.visit_again():
            for placed in all_placed:
                if time not in self._times(placed):
                    continue
                found = np.array(item.matrix_world, np.float32)[None, :3]
                if placed.shape.balls is not None:
                    found = placements(found[0], *read_points(owner.data))
                if len(found) == placed.count:
                    rows.extend(range(placed.row, placed.row + placed.count))
                    matrices.frombytes(found.tobytes())
                shape = placed.shape
                if self._is_deforming(placed) and id(shape) not in read:
                    read.add(id(shape))
                    if owner.original.session_uid in changed:
                        self._read_form(shape, owner, time)
        found = np.frombuffer(matrices, np.float32).reshape(-1, 3, 4)
        self._matrices[time] = (np.frombuffer(rows, np.int64), found)

    def _read_form(self, shape: Shape, owner: Any, time: Fraction) -> None:
        positions = shape.positions(owner) if shape.positions else None
        if positions is None or positions.shape != self._base_positions(shape).shape:
            self._lost_shapes.add(id(shape))
        else:
            self._positions.setdefault(id(shape), {})[time] = positions

    def _base_positions(self, shape: Shape) -> np.ndarray:
        return np.asarray(self.instances.meshes[shape.mesh].handle.vertices)

    def _ways(self, rows: np.ndarray, times: Times) -> np.ndarray:
        """Matrices (N, times, 3, 4); NaN where an instance was not there."""
        base = self.instances.all_matrices()
        ways = np.full((len(rows), len(times), 3, 4), np.nan, np.float32)
        for index, time in enumerate(times):
            at_time = base
            if time in self._matrices:
                there, matrices = self._matrices[time]
                at_time = np.full_like(base, np.nan)
                at_time[there] = matrices
            ways[:, index] = at_time[rows]
        return ways

    def _moved_shapes(self) -> Iterator[tuple[Placed, dict[Fraction, np.ndarray]]]:
        """An instance of each shape that changes its form, and its positions at the times read."""
        shapes = {id(placed.shape): placed for placed in self.instances.placed()}
        for name, found in self._positions.items():
            base = self._base_positions(shapes[name].shape)
            moves = any(differs(positions, base).any() for positions in found.values())
            if moves and name not in self._lost_shapes:
                yield shapes[name], found


@dataclass
class MotionTable(TimeTable):
    """What moves while the shutter is open. Time 1 is when it closes, -1 when it opens."""

    def _times(self, placed: Placed) -> Times:
        return placed.times

    def _times_of_camera(self) -> Times:
        camera = self.instances.depsgraph.scene.camera
        return motion_times(motion_steps(camera, camera)[0])

    def _is_deforming(self, placed: Placed) -> bool:
        return placed.is_deforming

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of the contract that tell of motion; `instances` gets the meshes in motion."""
        moving = dict(self._moving_meshes())
        meshes = {"instance_mesh": self.instances.exchange(moving)} if moving else {}
        return self._camera_arrays() | self._instance_arrays() | meshes

    def _camera_arrays(self) -> dict[str, np.ndarray]:
        """`camera_motion` and `camera_motion_clip` of the contract."""
        at_times = [self._camera.get(time, self.camera) for time in self._times_of_camera()]
        moves = any(
            not np.allclose(found[name], self.camera[name], rtol=STILL, atol=STILL)
            for found in at_times
            for name in CAMERA_ARRAYS
        )
        still = still_arrays()
        return {
            sent: np.stack([found[name] for found in at_times]) if moves else still[sent]
            for name, sent in CAMERA_ARRAYS.items()
        }

    def _instance_arrays(self) -> dict[str, np.ndarray]:
        """`motion_instances`, `motion_spans` and `motion_placements` of the contract."""
        keep = self.instances.keep
        rows_at: dict[Times, list[int]] = {}
        for placed in self.instances.placed():
            rows_at.setdefault(placed.times, []).extend(
                range(placed.row, placed.row + placed.count)
            )
        rows, ways = [], []
        for times, members in rows_at.items():
            wanted = np.array(members, np.int64)
            way = self._ways(wanted, times)
            ways.append(way[moving := self._moves(way) & keep[wanted]])
            rows.append((np.cumsum(keep) - 1)[wanted[moving]])
        return packed(rows, ways)

    def _moves(self, ways: np.ndarray) -> np.ndarray:
        """Which of the ways (N, times, 3, 4) lead anywhere, and can be gone."""
        if ways.shape[1] == 0:
            return np.zeros(len(ways), bool)
        middle = ways[:, ways.shape[1] // 2, None]
        regular = ~is_singular(ways.reshape(-1, 3, 4)).reshape(ways.shape[:2])
        return differs(ways, middle).any(axis=(1, 2, 3)) & regular.all(axis=1)

    def _moving_meshes(self) -> Iterator[tuple[int, CachedMesh]]:
        """The shapes that change their form, by `id`, and their meshes in motion."""
        for placed, found in self._moved_shapes():
            base = self._base_positions(placed.shape)
            mesh = self.instances.meshes[placed.shape.mesh]
            at_times = np.stack([found.get(time, base) for time in placed.times])
            yield id(placed.shape), self._moving(mesh, at_times)

    def _moving(self, mesh: CachedMesh, positions: np.ndarray) -> CachedMesh:
        content = hashlib.blake2b(mesh.digest, digest_size=16)
        content.update(positions)
        return self.instances.cache.moving(mesh, content.digest(), positions)


def differs(numbers: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Where numbers differ by more than rounding: hair passes through world space and back."""
    return np.abs(numbers - base) > STILL * np.maximum(1.0, np.abs(base))


def packed(rows: list[np.ndarray], ways: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of the contract for instances (N,) and their ways (N, times, 3, 4), in groups."""
    still = still_arrays()
    if not any(len(way) for way in ways):
        return {name: values for name, values in still.items() if name.startswith("motion")}
    counts = np.concatenate([np.full(len(way), way.shape[1]) for way in ways])
    spans = np.stack([np.cumsum(counts) - counts, counts], axis=1)
    instances = np.concatenate(rows)
    order = np.argsort(instances)
    return {
        "motion_instances": instances[order].astype(np.uint32),
        "motion_spans": spans[order].astype(np.uint32),
        "motion_placements": np.concatenate([way.reshape(-1, 3, 4) for way in ways]),
    }


def still_arrays() -> dict[str, np.ndarray]:
    """The arrays of the contract for motion, where there is none."""
    return {
        "camera_motion": np.empty((0, 3, 4), np.float32),
        "camera_motion_clip": np.empty((0, 4, 4), np.float32),
        "motion_instances": np.empty(0, np.uint32),
        "motion_spans": np.empty((0, 2), np.uint32),
        "motion_placements": np.empty((0, 3, 4), np.float32),
        "shutter_curve": np.empty(0, np.float32),
    }
