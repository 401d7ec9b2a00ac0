"""One frame of the evaluated scene as the arrays of the contract."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from .cache import ExportCache
from .camera import export_camera
from .flow import FlowTable, still_flow
from .image import ImageTable
from .instance import InstanceTable
from .light import LightTable
from .linking import NO_GROUP, light_groups
from .material import MaterialTable
from .matte import Mattes
from .motion import MotionTable, still_arrays
from .report import Warnings
from .shader.layers import ACTIVE_UV
from .shutter import SetTime, Shutter, read_shutter, set_time
from .simulation import warn_of_unbaked
from .world import ambient_distance, export_world, mist


@dataclass(frozen=True)
class ExportedFrame:
    """What `dualcone.SceneFrame(frame, meshes, images, arrays)` takes, and what users are told."""

    frame: int
    meshes: list[Any]
    images: list[Any]
    arrays: dict[str, np.ndarray]
    warnings: list[str]
    # Cryptomatte's names and hashes by pass of the contract.
    manifests: dict[str, dict[str, str]]
    # Of everything above but the frame number and the warnings.
    content_hash: bytes
    seconds: float


def export_frame(
    depsgraph: bpy.types.Depsgraph,
    frame: int,
    resolution: tuple[int, int],
    cache: ExportCache,
    core: Any,
    should_stop: Callable[[], bool],
    move: SetTime | None = None,
    passes: Collection[str] = (),
) -> ExportedFrame:
    """Export the scene as it is evaluated now; moving it to `frame` is the caller's business.

    `resolution` is the whole frame in pixels, before any border. `core` is the compiled module.
    `move` moves the scene to a frame and subframe; motion blur and the pass Vector need it, and do
    not go back. `passes` are those of the contract that will be asked for.
    Raises ExportError with a message for the user, ExportStopped once `should_stop()` is true.
    """
    started = perf_counter()
    warnings = Warnings()
    time = frame + depsgraph.scene.frame_subframe
    shutter = read_shutter(depsgraph.scene, warnings) if move else None
    if move and shutter and shutter.middle:
        time += shutter.middle
        set_time(move, time)
    arrays = export_camera(depsgraph, resolution, warnings)
    images = ImageTable(cache, core, warnings, frame)
    materials = _material_table(depsgraph, cache, core, images, warnings, passes)
    has_flow = move is not None and "Vector" in passes
    instances = InstanceTable(
        depsgraph,
        cache,
        core,
        materials,
        LightTable(warnings, materials, groups=light_groups(depsgraph.view_layer_eval)),
        warnings,
        should_stop,
        is_blurred=shutter is not None,
        is_visited_again=shutter is not None or has_flow,
        layers=frozenset({ACTIVE_UV} if "UV" in passes else ()),
    )
    cache.begin_frame(depsgraph)
    instances.read()
    arrays |= _world_arrays(materials, time, should_stop)
    arrays |= instances.arrays() | materials.arrays() | instances.lights.arrays()
    arrays |= _moved_arrays(instances, arrays, resolution, time, move, shutter, has_flow)
    warn_of_unbaked(depsgraph, warnings)
    parts = [mesh.digest for mesh in instances.meshes] + [image.digest for image in images.used]
    seconds = perf_counter() - started
    cache.end_frame(seconds)
    return ExportedFrame(
        frame,
        [mesh.handle for mesh in instances.meshes],
        [image.handle for image in images.used],
        arrays,
        warnings.messages(),
        materials.mattes.manifests if materials.mattes else {},
        content_hash(parts, arrays),
        seconds,
    )


def _material_table(
    depsgraph: bpy.types.Depsgraph,
    cache: ExportCache,
    core: Any,
    images: ImageTable,
    warnings: Warnings,
    passes: Collection[str],
) -> MaterialTable:
    """An empty table that will compile and note what these passes need."""
    outputs = frozenset(int(name.partition(".")[2]) for name in passes if name.startswith("AOV"))
    mattes = Mattes() if any(name.startswith("Crypto") for name in passes) else None
    return MaterialTable(depsgraph, cache, core, images, warnings, outputs, mattes)


def _world_arrays(
    materials: MaterialTable, time: float, should_stop: Callable[[], bool]
) -> dict[str, np.ndarray]:
    """What the contract's arrays say of the world and of the view layer. Raises ExportStopped."""
    layer = materials.depsgraph.view_layer_eval
    world = layer.world_override or materials.depsgraph.scene_eval.world
    material = np.array(materials.index_of_world(world), np.int32)
    read = export_world(world, materials.images, time, materials.warnings, should_stop)
    group = light_groups(layer).get(world.lightgroup, NO_GROUP) if world else NO_GROUP
    return read.arrays() | {
        "world_material": material,
        "world_group": np.array(group, np.uint32),
        "mist": mist(world),
        "ambient_distance": ambient_distance(world),
        "alpha_threshold": np.array(layer.pass_alpha_threshold, np.float32),
    }


def _moved_arrays(
    instances: InstanceTable,
    camera: dict[str, np.ndarray],
    resolution: tuple[int, int],
    time: float,
    move: SetTime | None,
    shutter: Shutter | None,
    has_flow: bool,
) -> dict[str, np.ndarray]:
    """What is elsewhere before and after this time. Moves the scene; raises ExportStopped."""
    arrays = still_arrays() | still_flow()
    # The flow first: motion gives instances other meshes.
    if move and has_flow:
        flow = FlowTable(instances, camera, resolution)
        flow.read(time, 1.0, move)
        arrays |= flow.arrays()
    if move and shutter:
        motion = MotionTable(instances, camera, resolution)
        motion.read(time, 0.5 * shutter.length, move)
        arrays |= motion.arrays() | {"shutter_curve": shutter.curve}
    return arrays


def content_hash(parts: list[bytes], arrays: dict[str, np.ndarray]) -> bytes:
    """Hash of the meshes' and images' own hashes and of all arrays."""
    content = hashlib.blake2b(b"".join(parts), digest_size=16)
    for name in sorted(arrays):
        content.update(f"{name}{arrays[name].shape}".encode())
        content.update(np.ascontiguousarray(arrays[name]))
    return content.digest()
