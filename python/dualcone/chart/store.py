"""What a run has measured so far, on disk: an interrupted run goes on where it ended."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .measures import Pictures, Reference


class StoreError(Exception):
    """The folder holds another experiment; the message is for the user."""


class Unit(NamedTuple):
    """What is rendered at once: all frames, by one method at one budget with one seed."""

    scene: str
    method: str
    budget: int
    seed: int

    @property
    def file(self) -> str:
        """Name of the file that keeps its pictures."""
        return f"{self.scene}-{self.method}-{self.budget}-{self.seed}.npy"


@dataclass(frozen=True)
class Row:
    """One frame of a unit."""

    scene: str
    method: str
    budget: int
    seed: int
    frame: int
    samples: int
    width: int
    height: int
    # Sampling, sharing and denoising; of a processor that has nothing else to do.
    seconds: float
    # The same as it passed on the wall.
    wall_seconds: float
    # Export, trees and writing too, on the wall.
    total_seconds: float
    # 0 where the renderer does not tell.
    rays_per_pixel: float
    relative_mse: float
    trimmed: float
    energy_ratio: float
    # Mean squared change of the error since the frame before; NaN in the first frame.
    change: float
    # NaN without flip-evaluator.
    flip: float

    @property
    def unit(self) -> Unit:
        return Unit(self.scene, self.method, self.budget, self.seed)


COLUMNS = [field.name for field in dataclasses.fields(Row)]
TYPES = {"str": str, "int": int, "float": float}


def parse(line: Mapping[str, str]) -> Row:
    """Read one line of the CSV."""
    fields = dataclasses.fields(Row)
    values: dict[str, Any] = {f.name: TYPES[str(f.type)](line[f.name]) for f in fields}
    return Row(**values)


class Store:
    """A folder with chart.csv, experiment.json and the pictures."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.csv = folder / "chart.csv"
        self._pictures = folder / "pictures"

    def open(self, experiment: Mapping[str, Any]) -> None:
        """Begin, or go on with, an experiment.

        Raises:
            StoreError: the folder holds another one, whose rows must not mix with this one's.
        """
        self._pictures.mkdir(parents=True, exist_ok=True)
        told = self.folder / "experiment.json"
        words = json.dumps(experiment, sort_keys=True, indent=1)
        if told.exists() and self.csv.exists() and told.read_text() != words:
            raise StoreError(
                f"{self.folder} holds rows of another build or other options: remove it"
            )
        told.write_text(words)
        if not self.csv.exists():
            self.csv.write_text(",".join(COLUMNS) + "\n")
        self._drop_torn_line()

    def experiment(self) -> dict[str, Any]:
        """Return what `open` was told."""
        return json.loads((self.folder / "experiment.json").read_text())

    def append(self, rows: Sequence[Row], pictures: Pictures) -> None:
        """Keep a finished unit: its pictures first, then all of its rows in one write."""
        path = self._pictures / rows[0].unit.file
        with path.with_suffix(".part").open("wb") as partial:
            np.save(partial, np.clip(pictures, 0.0, 6e4).astype(np.float16))
        path.with_suffix(".part").replace(path)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows(dataclasses.astuple(row) for row in rows)
        with self.csv.open("ab", buffering=0) as file:
            file.write(text.getvalue().encode())
            os.fsync(file.fileno())

    def rows(self) -> list[Row]:
        """Return everything measured so far."""
        with self.csv.open(newline="") as file:
            return [parse(line) for line in csv.DictReader(file)]

    def pictures(self, units: Iterable[Unit]) -> Iterator[Pictures]:
        """Yield the pictures (frames, H, W, 3) of those units that have some."""
        for unit in units:
            path = self._pictures / unit.file
            if path.exists():
                yield np.load(path).astype(np.float32)

    def keep_reference(self, scene: str, halves: NDArray[np.float32]) -> None:
        """Keep the two halves of a scene's reference, for the report."""
        np.save(self.folder / f"reference-{scene}.npy", halves)

    def reference(self, scene: str) -> Reference:
        """Return a scene's reference."""
        return Reference(np.load(self.folder / f"reference-{scene}.npy"))

    def keep_check(self, scene: str, make: Callable[[], dict[str, float]]) -> None:
        """Compare a scene's reference with the second engine, once."""
        checks = self.checks()
        if scene not in checks:
            checks[scene] = make()
            (self.folder / "checks.json").write_text(json.dumps(checks, indent=1))

    def checks(self) -> dict[str, dict[str, float]]:
        """Return by scene what the comparisons with the second engine gave."""
        path = self.folder / "checks.json"
        return json.loads(path.read_text()) if path.exists() else {}

    def _drop_torn_line(self) -> None:
        """Remove what an interrupted write has left behind the last whole line."""
        content = self.csv.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            self.csv.write_bytes(content[:whole])


def finished(rows: Iterable[Row], frames: int) -> set[Unit]:
    """Return the units that have all their frames."""
    counts: dict[Unit, int] = {}
    for row in rows:
        counts[row.unit] = counts.get(row.unit, 0) + 1
    return {unit for unit, count in counts.items() if count >= frames}
