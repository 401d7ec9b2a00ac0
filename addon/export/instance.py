"""The objects of the evaluated scene: meshes placed by matrices, and lights."""

from __future__ import annotations

import hashlib
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from .cache import CachedMesh, ExportCache
from .light import LightTable
from .material import MaterialTable
from .mesh import NotFinite, load_mesh
from .report import ExportStopped, Warnings
from .transform import is_singular

LEFT_OUT_TYPES = {
    "CURVES": "hair curves are",
    "POINTCLOUD": "point clouds are",
    "VOLUME": "volumes are",
    "GREASEPENCIL": "Grease Pencil is",
    "GPENCIL": "Grease Pencil is",
    "LIGHT_PROBE": "light probes are",
}

# Object flags that the renderer does not look at, with the value it takes for granted.
RAY_FLAGS = (
    ("visible_camera", "camera"),
    ("visible_diffuse", "diffuse"),
    ("visible_glossy", "glossy"),
    ("visible_transmission", "transmission"),
    ("visible_shadow", "shadow"),
)

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
    _shapes: dict[tuple[int, int], Shape | None] = field(default_factory=dict)
    _slot_lists: dict[tuple[int, ...], tuple[int, int]] = field(default_factory=dict)
    _slot_materials: list[int] = field(default_factory=list)
    _names: dict[int, bytes] = field(default_factory=dict)
    _keys: dict[int, None] = field(default_factory=dict)
    _placed: list[Shape] = field(default_factory=list)
    _matrices: array = field(default_factory=lambda: array("f"))
    _colors: array = field(default_factory=lambda: array("f"))
    _infos: array = field(default_factory=lambda: array("f"))

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
            if not item.show_self or (is_viewport and (item.parent or item.object).hide_render):
                continue
            owner = item.object
            if owner.type == "LIGHT":
                self.lights.add(owner, item.matrix_world.copy(), self._key(item, owner))
                continue
            shape = self._shape(owner)
            if shape is not None:
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
            "slot_materials": np.array(self._slot_materials, np.uint32),
        }

    def _place(self, shape: Shape, item: bpy.types.DepsgraphObjectInstance, owner: Any) -> None:
        self._placed.append(shape)
        self._keys[self._key(item, owner)] = None
        matrix = item.matrix_world
        for row in range(3):
            self._matrices.extend(matrix[row])
        self._colors.extend(owner.color)
        self._infos.extend((owner.pass_index, item.random_id / RANDOM_IDS))

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

    def _shape(self, owner: bpy.types.Object) -> Shape | None:
        """The shape of an evaluated object; pointers tell geometries apart within one frame."""
        data = owner.data
        if data is None:
            return None
        key = (owner.original.as_pointer(), data.as_pointer())
        if key not in self._shapes:
            if self.should_stop():
                raise ExportStopped
            self._shapes[key] = self._load_shape(owner)
        return self._shapes[key]

    def _load_shape(self, owner: bpy.types.Object) -> Shape | None:
        if owner.type in LEFT_OUT_TYPES:
            self.warnings.add(owner.name, f"{LEFT_OUT_TYPES[owner.type]} not rendered yet")
        if owner.type != "MESH":
            return None
        self._check(owner)
        rows = self._material_rows(owner)
        layers = frozenset[str]().union(*(self.materials.layers[row] for row in rows))
        try:
            mesh = self._mesh(owner, layers)
        except NotFinite:
            self.warnings.add(owner.name, "has vertices that are not numbers and is left out")
            return None
        if mesh is None:
            return None
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
        hidden_from = [name for flag, name in RAY_FLAGS if not getattr(owner, flag)]
        if hidden_from:
            self.warnings.not_rendered(owner.name, f"Ray visibility ({', '.join(hidden_from)})")
        layer = self.depsgraph.view_layer_eval
        if owner.is_holdout or owner.holdout_get(view_layer=layer):
            self.warnings.not_rendered(owner.name, "Holdout")
        if owner.is_shadow_catcher:
            self.warnings.not_rendered(owner.name, "Shadow catcher")
        if owner.indirect_only_get(view_layer=layer):
            self.warnings.not_rendered(owner.name, "Indirect Only")
        for system in owner.particle_systems:
            if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
                self.warnings.add(owner.name, "hair particles are not rendered yet")
