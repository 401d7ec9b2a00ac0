"""The compiled half of the module, from src/python/.

`contract()` tells the shapes and units of all arrays. What does not fit it raises ValueError, with
a message that names the array and the row.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict, final

import numpy as np
from numpy.typing import NDArray

__version__: str

Setting = bool | int | float | str

class ArrayRow(TypedDict):
    """One array of the boundary."""

    name: str
    dtype: str
    shape: list[str]
    unit: str
    doc: str

class PassRow(TypedDict):
    """One render pass; `type` is COLOR, VECTOR or VALUE, as Blender calls it.

    The film's exposure scales what `is_light`. `extra_bytes` is what a pixel needs for it beside
    what it needs in any case.
    """

    name: str
    channels: str
    type: str
    is_light: bool
    extra_bytes: int
    doc: str

class Contract(TypedDict):
    """All that crosses the boundary. A setting's row has name, label, doc, kind, default, range."""

    mesh: list[ArrayRow]
    mesh_motion: list[ArrayRow]
    content: list[ArrayRow]
    grid: list[ArrayRow]
    image: list[ArrayRow]
    frame: list[ArrayRow]
    settings: list[dict[str, Any]]
    passes: list[PassRow]

class Region(TypedDict):
    """The part of a frame to render [pixels]; y counts from the bottom, maxima are exclusive."""

    width: int
    height: int
    x_min: int
    y_min: int
    x_max: int
    y_max: int

class Progress(TypedDict):
    """What a render does and how far it is; times in seconds."""

    phase: str
    done: bool
    samples_done: int
    samples_total: int
    fraction: float
    seconds_elapsed: float
    seconds_left: float | None
    rays: int
    memory_bytes: int

class Report(TypedDict):
    """What one frame took; `seconds` by phase: build, pass_1, pass_2, resolve."""

    seconds: dict[str, float]
    rays: int
    samples: int
    effective_samples: float
    pixel_memory_bytes: int

class Result(TypedDict):
    """One finished frame: passes (H, W, channels), rows from the bottom up, and its report."""

    passes: dict[str, NDArray[np.float32]]
    report: Report

def contract() -> Contract:
    """Return the tables of arrays, settings and passes."""

class OperationRow(TypedDict):
    """What an instruction of a material may do.

    `parameter` is none, modes, image, table or attribute.
    """

    name: str
    inputs: list[str]
    parameter: str
    modes: list[list[str]]
    is_closure: bool

def operations() -> list[OperationRow]:
    """Return what instructions of materials may do, in the order of their numbers."""

def window_frames(settings: Mapping[str, Setting], targets: Sequence[int], step: int) -> list[int]:
    """Return every frame whose scene is needed to render `targets`, in ascending order."""

@final
class Mesh:
    """A triangle mesh in object space; hand the same one to every frame that shows it unchanged."""

    def __new__(
        cls,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.uint32],
        corner_normals: NDArray[np.float32],
        corner_uvs: NDArray[np.float32],
        layer_keys: NDArray[np.uint32],
        layer_values: NDArray[np.float32],
        material_slots: NDArray[np.uint32],
    ) -> Mesh: ...
    def moving(self, motion_vertices: NDArray[np.float32]) -> Mesh:
        """The same mesh, which changes its form while the shutter is open."""
    def filled(
        self,
        grids: Sequence[tuple[int, Grid]],
        texture_space: NDArray[np.float32],
        is_scaled: bool,
    ) -> Mesh:
        """The same mesh with grids in it, by the hashes of their names.

        `texture_space` (0 or 2, 3) is what Generated coordinates of volumes count: a corner and a
        size. With `is_scaled` the volume gets thinner as the object is scaled up.
        """

    @property
    def vertex_count(self) -> int: ...
    @property
    def triangle_count(self) -> int: ...
    @property
    def vertices(self) -> NDArray[np.float32]:
        """A copy of the positions (V, 3) [m], object space."""

@final
class Grid:
    """Voxels (X, Y, Z, N) in the space of an object; values that are not finite become zero."""

    def __new__(
        cls, voxels: NDArray[np.float32], index_from_object: NDArray[np.float32]
    ) -> Grid: ...

@final
class Image:
    """An image (H, W, 4), RGBA; texels that are not finite become black.

    `SRGB` texels are decoded behind the filter; `divides_alpha` divides colours by alpha there.
    """

    def __new__(
        cls,
        pixels: NDArray[np.float32],
        extension: Literal["REPEAT", "EXTEND", "CLIP", "MIRROR"] = "REPEAT",
        interpolation: Literal["Linear", "Closest", "Cubic"] = "Linear",
        encoding: Literal["LINEAR", "BYTE", "SRGB"] = "LINEAR",
        divides_alpha: bool = False,
    ) -> Image: ...
    @staticmethod
    def tiled(tiles: Sequence[tuple[int, Image]]) -> Image:
        """Return an image of UDIM tiles, by their numbers."""
    @property
    def replaced_texels(self) -> int: ...

@final
class SceneFrame:
    """Everything one frame shows: `arrays` are those of the contract's `frame`."""

    def __new__(
        cls,
        frame: int,
        meshes: Sequence[Mesh],
        images: Sequence[Image],
        arrays: Mapping[str, NDArray[Any]],
    ) -> SceneFrame: ...
    def closures(self, material: int, uv: tuple[float, float]) -> list[str]:
        """Return what a material's program computes at a texture coordinate, printed."""
    @property
    def frame(self) -> int: ...
    @property
    def memory_bytes(self) -> int: ...

@final
class Render:
    """Renders `targets` in the background, beginning at once.

    `frames` holds the scenes that `window_frames` names; without `passes` those are made that cost
    nothing. Dropping the last reference cancels.
    """

    def __new__(
        cls,
        frames: Sequence[SceneFrame],
        targets: Sequence[int],
        step: int,
        region: Region,
        settings: Mapping[str, Setting],
        threads: int,
        passes: Sequence[str] | None = None,
    ) -> Render: ...
    def progress(self) -> Progress:
        """Return what the render does and how far it is."""
    def cancel(self) -> None:
        """Ask the render to stop, and return at once."""
    def wait(self, seconds: float) -> bool:
        """Wait at most so long; return whether the render has finished."""
    def preview(self, frame: int) -> NDArray[np.float32] | None:
        """Return the picture so far (H, W, 4), or None where there is none yet."""
    def result(self, frame: int) -> Result:
        """Return a finished frame, once.

        Raises RuntimeError while the render runs and after it failed or was cancelled.
        """
