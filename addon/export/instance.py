"""The objects of the evaluated scene: meshes placed by matrices, and lights."""

from __future__ import annotations

import hashlib
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy as np

from .cache import CachedMesh, ExportCache
from .light import LightTable
from .material import MaterialTable
from .mesh import NotFinite, load_mesh, load_surface
from .points import placements, read_points, unit_ball
from .report import ExportStopped, Warnings
from .strands import (
    Strands,
    Surface,
    has_hair,
    strands_of_curves,
    strands_of_particles,
    tubes,
)
from .transform import is_singular
from .visibility import CAMERA, bits

LEFT_OUT_TYPES = {
    "VOLUME": "volumes are",
    "GREASEPENCIL": "Grease Pencil is",
    "GPENCIL": "Grease Pencil is",
    "LIGHT_PROBE": "light probes are",
}

# `random_id` of an instance counts up to this.
RANDOM_IDS = 0xFFFFFFFF

# Items between two looks at `should_stop`; ten thousand take about a tenth of a second.
STOP_INTERVAL = 256


@dataclass(frozen=True)
class Shape:
    """What all instances of one evaluated geometry share."""

    name: str
    mesh: int
    slots: tuple[int, int]
    # Positions and radii of the balls that it consists of, object space; None for one mesh.
    balls: tuple[np.ndarray, np.ndarray] | None = None
    # Whether it is the hair of a particle system, which shows even where its emitter does not.
    is_hair: bool = False


@dataclass(frozen=True)
class Seen:
    """Which rays meet an instance, and whether it is a hole in the picture."""

    visibility: int
    is_holdout: bool


@dataclass
class InstanceTable:
    """Meshes and instances of one frame."""

    depsgraph: bpy.types.Depsgraph
    cache: ExportCache
    core: Any
    materials: MaterialTable
    lights: LightTable
    warnings: Warnings
    should_stop: Callable[[], bool]
    meshes: list[CachedMesh] = field(default_factory=list)
    _mesh_rows: dict[bytes, int] = field(default_factory=dict)
    _shapes: dict[tuple[int, int], list[Shape]] = field(default_factory=dict)
    _slot_lists: dict[tuple[int, ...], tuple[int, int]] = field(default_factory=dict)
    _slot_materials: list[int] = field(default_factory=list)
    _names: dict[int, bytes] = field(default_factory=dict)
    _keys: dict[int, None] = field(default_factory=dict)
    _placed: list[Shape] = field(default_factory=list)
    _matrices: array = field(default_factory=lambda: array("f"))
    _colors: array = field(default_factory=lambda: array("f"))
    _infos: array = field(default_factory=lambda: array("f"))
    _seen: list[Seen] = field(default_factory=list)
    _seen_by: dict[tuple[int, int], Seen] = field(default_factory=dict)

    def read(self) -> None:
        """Walk the evaluated scene once. Raises ExportStopped.

        No item of `object_instances` is kept: each is overwritten by the next. Curves, surfaces,
        texts and metaballs appear twice, as themselves and as an instance of type MESH.
        """
        # The depsgraph of a render leaves out what is hidden; one that a script asked for does not.
        is_viewport = self.depsgraph.mode == "VIEWPORT"
        for count, item in enumerate(self.depsgraph.object_instances):
            if count % STOP_INTERVAL == 0 and self.should_stop():
                raise ExportStopped
            if is_viewport and (item.parent or item.object).hide_render:
                continue
            owner = item.object
            if owner.type == "LIGHT" and item.show_self:
                self.lights.add(owner, item.matrix_world.copy(), self._key(item, owner))
                continue
            for shape in self._shapes_of(owner):
                if item.show_particles if shape.is_hair else item.show_self:
                    self._place(shape, item, owner)

    def arrays(self) -> dict[str, np.ndarray]:
        """The `instance_*` arrays, `world_from_object` and `slot_materials` of the contract."""
        matrices = np.frombuffer(self._matrices, np.float32).reshape(-1, 3, 4)
        singular = is_singular(matrices)
        for row in np.flatnonzero(singular):
            self.warnings.add(
                self._placed[row].name, "its matrix flattens space, this instance is left out"
            )
        keep = ~singular
        keys = np.fromiter(self._keys, np.uint64, len(self._placed))
        meshes = np.array([shape.mesh for shape in self._placed], np.uint32)
        slots = np.array([shape.slots for shape in self._placed], np.uint32).reshape(-1, 2)
        return {
            "instance_mesh": meshes[keep],
            "instance_key": keys[keep],
            "world_from_object": matrices[keep],
            "instance_color": np.frombuffer(self._colors, np.float32).reshape(-1, 4)[keep],
            "instance_info": np.frombuffer(self._infos, np.float32).reshape(-1, 2)[keep],
            "instance_slots": slots[keep],
            "instance_visibility": np.array([s.visibility for s in self._seen], np.uint32)[keep],
            "instance_holdout": np.array([s.is_holdout for s in self._seen], np.uint32)[keep],
            "slot_materials": np.array(self._slot_materials, np.uint32),
        }

    def _place(self, shape: Shape, item: bpy.types.DepsgraphObjectInstance, owner: Any) -> None:
        key = self._key(item, owner)
        count = 1 if shape.balls is None else len(shape.balls[1])
        self._placed += [shape] * count
        self._keys.update(dict.fromkeys(self._free_keys(key, count)))
        self._seen += [self._seen_of(owner, item.parent if item.is_instance else owner)] * count
        self._colors.extend(owner.color[:] * count)
        self._infos.extend((owner.pass_index, item.random_id / RANDOM_IDS) * count)
        if shape.balls is None:
            matrix = item.matrix_world
            for row in range(3):
                self._matrices.extend(matrix[row])
        else:
            matrices = placements(np.array(item.matrix_world, np.float32)[:3], *shape.balls)
            self._matrices.frombytes(matrices.tobytes())

    def _free_keys(self, first: int, count: int) -> list[int]:
        """`count` keys from `first` on that nothing has yet."""
        keys = []
        while len(keys) < count:
            if first not in self._keys:
                keys.append(first)
            first = (first + 1) % 2**64
        return keys

    def _seen_of(self, owner: bpy.types.Object, parent: bpy.types.Object) -> Seen:
        """What the flags of an object and of what instances it, as Cycles combines them."""
        key = (owner.as_pointer(), parent.as_pointer())
        if key not in self._seen_by:
            layer = self.depsgraph.view_layer_eval
            visibility = bits(owner) & bits(parent)
            if parent.indirect_only_get(view_layer=layer):
                visibility &= ~CAMERA
            is_holdout = owner.is_holdout or parent.holdout_get(view_layer=layer)
            self._seen_by[key] = Seen(visibility, is_holdout)
        return self._seen_by[key]

    def _key(self, item: bpy.types.DepsgraphObjectInstance, owner: bpy.types.Object) -> int:
        """The same number in every frame and session: what it is, and how it came to be."""
        content = hashlib.blake2b(self._name(owner), digest_size=8)
        if item.is_instance:
            content.update(self._name(item.parent))
            content.update(array("i", item.persistent_id[:]))
        key = int.from_bytes(content.digest(), "little")
        while key in self._keys:
            key = (key + 1) % 2**64
        return key

    def _name(self, owner: bpy.types.Object) -> bytes:
        original = owner.original
        pointer = original.as_pointer()
        if pointer not in self._names:
            self._names[pointer] = original.name_full.encode()
        return self._names[pointer]

    def _shapes_of(self, owner: bpy.types.Object) -> list[Shape]:
        """What an evaluated object looks like; pointers tell geometries apart within one frame."""
        data = owner.data
        if data is None:
            return []
        key = (owner.original.as_pointer(), data.as_pointer())
        if key not in self._shapes:
            if self.should_stop():
                raise ExportStopped
            self._check(owner)
            self._shapes[key] = self._load_shapes(owner)
        return self._shapes[key]

    def _load_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        if owner.type in LEFT_OUT_TYPES:
            self.warnings.add(owner.name, f"{LEFT_OUT_TYPES[owner.type]} not rendered yet")
        load = SHAPES.get(owner.type)
        try:
            return load(self, owner) if load else []
        except NotFinite:
            self.warnings.add(owner.name, "has vertices that are not numbers and is left out")
            return []

    def _mesh_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        rows = self._material_rows(owner)
        layers = frozenset[str]().union(*(self.materials.layers[row] for row in rows))
        mesh = self._mesh(owner, layers)
        shapes = [] if mesh is None else [self._shape(owner, mesh, rows)]
        for system in owner.particle_systems:
            if has_hair(system):
                strands = strands_of_particles(owner, system, self.warnings)
                slot = min(system.settings.material, len(rows)) - 1
                hair = self._strand_shapes(owner, strands, rows[max(slot, 0)])
                shapes += [replace(shape, is_hair=True) for shape in hair]
        return shapes

    def _curves_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        return self._strand_shapes(
            owner, strands_of_curves(owner.data), self._material_rows(owner)[0]
        )

    def _strand_shapes(
        self, owner: bpy.types.Object, strands: Strands | None, row: int
    ) -> list[Shape]:
        surface = strands and tubes(strands, owner.name, self.warnings)
        return [self._plain_shape(owner, surface, row)] if surface else []

    def _point_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        ball = self._plain_shape(owner, unit_ball(), self._material_rows(owner)[0])
        return [replace(ball, balls=read_points(owner.data))]

    def _plain_shape(self, owner: bpy.types.Object, surface: Surface, row: int) -> Shape:
        """A shape of one material."""
        mesh = load_surface(surface, self.cache, self.core)
        if self.materials.layers[row]:
            self.warnings.not_rendered(owner.name, "Texture coordinates of strands and points")
        return self._shape(owner, mesh, [row])

    def _shape(self, owner: bpy.types.Object, mesh: CachedMesh, rows: list[int]) -> Shape:
        row = self._mesh_rows.setdefault(mesh.digest, len(self.meshes))
        if row == len(self.meshes):
            self.meshes.append(mesh)
        return Shape(owner.name, row, self._slots(rows))

    def _mesh(self, owner: bpy.types.Object, layers: frozenset[str]) -> CachedMesh | None:
        """The mesh of an evaluated object, read only if it may have changed."""
        entry = self.cache.evaluated(owner)
        if entry is not None and (entry.mesh is None or entry.mesh.layers >= layers):
            return entry.mesh
        mesh = self._load_mesh(owner, layers)
        self.cache.remember(owner, mesh)
        return mesh

    def _load_mesh(self, owner: bpy.types.Object, layers: frozenset[str]) -> CachedMesh | None:
        def warn(message: str) -> None:
            self.warnings.add(owner.name, message)

        # In edit mode the evaluated mesh has no attributes, only the edited BMesh behind it.
        if not owner.data.is_editmode:
            return load_mesh(owner.data, self.cache, self.core, layers, warn)
        try:
            mesh = owner.to_mesh()
            return load_mesh(mesh, self.cache, self.core, layers, warn) if mesh else None
        finally:
            owner.to_mesh_clear()

    def _material_rows(self, owner: bpy.types.Object) -> list[int]:
        """Row of the material in each slot; one row where there is no slot."""
        override = self.depsgraph.view_layer_eval.material_override
        materials = [override or slot.material for slot in owner.material_slots] or [override]
        return [self.materials.index(material) for material in materials]

    def _slots(self, rows: list[int]) -> tuple[int, int]:
        """First entry and number of entries in `slot_materials`."""
        key = tuple(rows)
        if key not in self._slot_lists:
            self._slot_lists[key] = (len(self._slot_materials), len(rows))
            self._slot_materials += rows
        return self._slot_lists[key]

    def _check(self, owner: bpy.types.Object) -> None:
        """Warn of what the renderer does not do with this object."""
        if owner.is_shadow_catcher:
            self.warnings.not_rendered(owner.name, "Shadow catcher")


# What becomes triangles, by the object's type. Texts, metaballs and surfaces are instances of type
# MESH already.
SHAPES: dict[str, Callable[[InstanceTable, bpy.types.Object], list[Shape]]] = {
    "MESH": InstanceTable._mesh_shapes,
    "CURVES": InstanceTable._curves_shapes,
    "POINTCLOUD": InstanceTable._point_shapes,
}
