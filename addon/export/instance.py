"""The objects of the evaluated scene: meshes placed by matrices, and lights."""

from __future__ import annotations

import hashlib
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import bpy
import numpy as np

from .cache import CachedMesh, ExportCache
from .light import LightTable
from .linking import LinkSets, name_of
from .material import MaterialTable
from .mesh import NotFinite, load_mesh, load_surface, mesh_positions
from .points import placements, read_points, unit_ball
from .random_number import random_number
from .report import ExportStopped, Warnings
from .shader.layers import HAIR, OF_STRANDS, PARTICLE, VOLUME_GENERATED
from .shutter import Times, motion_steps, motion_times
from .strands import (
    Strands,
    Surface,
    has_hair,
    strands_of_curves,
    strands_of_particles,
    tubes,
)
from .transform import is_singular, is_without_area
from .visibility import CAMERA, bits
from .volume import (
    UNBLURRED,
    filled,
    grid_box,
    grid_names,
    mesh_texture_space,
    read_smoke,
    read_volume,
    smoke_domain,
)

LEFT_OUT_TYPES = {
    "GREASEPENCIL": "Grease Pencil is",
    "GPENCIL": "Grease Pencil is",
    "LIGHT_PROBE": "light probes are",
}

LIFT_SETTING = "shadow_terminator_geometry_offset"

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
    # Whether its materials ask for the particle that it shows.
    asks_for_particle: bool = False
    # Reads the vertices (V, 3) anew once the object is evaluated at another time.
    positions: Callable[[Any], np.ndarray | None] | None = None


@dataclass(frozen=True)
class Placed:
    """Instances that came of one item of the scene: one, or the balls of a point cloud."""

    shape: Shape
    # The first of them, and how many there are.
    row: int
    count: int
    # When they are looked at, for motion blur; empty for none.
    times: Times
    is_deforming: bool


@dataclass(frozen=True)
class Seen:
    """Which rays meet an instance, what the picture shows in its place, and whose links hold."""

    visibility: int
    is_holdout: bool
    is_catcher: bool
    # Of the object and of what instances it, as light linking knows them.
    names: tuple[int, ...]
    # Below this cosine of light its shadows are those of its smooth form, not of its faces.
    lift_cosine: float
    # The sets that its light reaches and that stop it, and its light group.
    links: tuple[int, int, int]


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
    is_blurred: bool = False
    # Whether `visit_again` will be called.
    is_visited_again: bool = False
    # Layers of all meshes, beside those that materials read.
    layers: frozenset[str] = frozenset()
    meshes: list[CachedMesh] = field(default_factory=list)
    _mesh_rows: dict[bytes, int] = field(default_factory=dict)
    _shapes: dict[tuple[int, int], list[Shape]] = field(default_factory=dict)
    _slot_lists: dict[tuple[int, ...], tuple[int, int]] = field(default_factory=dict)
    _slot_materials: list[int] = field(default_factory=list)
    _names: dict[int, bytes] = field(default_factory=dict)
    _keys: dict[int, None] = field(default_factory=dict)
    # Of the instances in the order of `_placed`: those of the arrays.
    keep: np.ndarray = field(default_factory=lambda: np.empty(0, bool))
    _placed: list[Shape] = field(default_factory=list)
    _matrices: array = field(default_factory=lambda: array("f"))
    _colors: array = field(default_factory=lambda: array("f"))
    _infos: array = field(default_factory=lambda: array("f"))
    _matte_numbers: array = field(default_factory=lambda: array("f"))
    _particles: dict[int, list[float]] = field(default_factory=dict)
    _seen: list[Seen] = field(default_factory=list)
    _seen_by: dict[tuple[int, int], Seen] = field(default_factory=dict)
    # What was placed for the items of each key, in their order, if they are visited again.
    _visits: dict[int, list[list[Placed]]] = field(default_factory=dict)

    def read(self) -> None:
        """Walk the evaluated scene once. Raises ExportStopped.

        No item of `object_instances` is kept: each is overwritten by the next. Curves, surfaces,
        texts and metaballs appear twice, as themselves and as an instance of type MESH.
        """
        for item, owner in self._items():
            if owner.type == "LIGHT" and item.show_self:
                self.lights.add(owner, item.matrix_world.copy(), self._key(item, owner))
                continue
            placed = [
                self._place(shape, item, owner)
                for shape in self._shapes_of(owner)
                if (item.show_particles if shape.is_hair else item.show_self)
            ]
            if placed and self.is_visited_again:
                self._visits.setdefault(self._hash(item, owner), []).append(placed)

    def visit_again(self) -> Iterator[tuple[Any, Any, list[Placed]]]:
        """Walk the scene at another time: items, their objects, and what `read` placed for them."""
        visited: Counter[int] = Counter()
        for item, owner in self._items():
            key = self._hash(item, owner)
            visits = self._visits.get(key, [])
            if visited[key] < len(visits):
                yield item, owner, visits[visited[key]]
            visited[key] += 1

    def placed(self) -> Iterator[Placed]:
        """All that may move."""
        for visits in self._visits.values():
            for placed in visits:
                yield from placed

    def all_matrices(self) -> np.ndarray:
        """Where each instance is (I, 3, 4), those included that are left out."""
        return np.frombuffer(self._matrices, np.float32).reshape(-1, 3, 4)

    def exchange(self, moving: dict[int, CachedMesh]) -> np.ndarray:
        """Give shapes, by `id`, other meshes; return the new `instance_mesh` of the contract."""
        meshes, self.meshes = self.meshes, []
        rows: dict[bytes, int] = {}
        instance_mesh = np.empty(len(self._placed), np.uint32)
        for index, shape in enumerate(self._placed):
            mesh = moving.get(id(shape)) or meshes[shape.mesh]
            instance_mesh[index] = row = rows.setdefault(mesh.digest, len(self.meshes))
            if row == len(self.meshes):
                self.meshes.append(mesh)
        return instance_mesh[self.keep]

    def _items(self) -> Iterator[tuple[Any, Any]]:
        # The depsgraph of a render leaves out what is hidden; one that a script asked for does not.
        is_viewport = self.depsgraph.mode == "VIEWPORT"
        for count, item in enumerate(self.depsgraph.object_instances):
            if count % STOP_INTERVAL == 0 and self.should_stop():
                raise ExportStopped
            if not (is_viewport and (item.parent or item.object).hide_render):
                yield item, item.object

    def arrays(self) -> dict[str, np.ndarray]:
        """The `instance_*` arrays, `world_from_object` and `slot_materials` of the contract."""
        matrices = self.all_matrices()
        singular = is_singular(matrices)
        # Without area Cycles shows nothing, either: many a scene hides things by a scale of zero.
        for row in np.flatnonzero(singular & ~is_without_area(matrices)):
            self.warnings.add(
                self._placed[row].name, "its matrix flattens space, this instance is left out"
            )
        self.keep = keep = ~singular
        keys = np.fromiter(self._keys, np.uint64, len(self._placed))
        meshes = np.array([shape.mesh for shape in self._placed], np.uint32)
        slots = np.array([shape.slots for shape in self._placed], np.uint32).reshape(-1, 2)
        mattes = np.frombuffer(self._matte_numbers, np.float32).reshape(-1, 2)
        links = np.array([seen.links for seen in self._seen], np.uint32).reshape(-1, 3)
        catchers = np.array([seen.is_catcher for seen in self._seen], np.uint32)
        return {
            "instance_mattes": mattes[keep] if self.materials.mattes else mattes,
            "instance_mesh": meshes[keep],
            "instance_key": keys[keep],
            "world_from_object": matrices[keep],
            "instance_color": np.frombuffer(self._colors, np.float32).reshape(-1, 4)[keep],
            "instance_info": np.frombuffer(self._infos, np.float32).reshape(-1, 2)[keep],
            "instance_lift_cosine": np.array([s.lift_cosine for s in self._seen], np.float32)[keep],
            "instance_slots": slots[keep],
            **self._particle_arrays(),
            "instance_visibility": np.array([s.visibility for s in self._seen], np.uint32)[keep],
            "instance_holdout": np.array([s.is_holdout for s in self._seen], np.uint32)[keep],
            "instance_shadow_catcher": catchers[keep],
            "instance_receiver_sets": self._linked(self.lights.receivers)[keep],
            "instance_blocker_sets": self._linked(self.lights.blockers)[keep],
            "instance_links": links[keep],
            "slot_materials": np.array(self._slot_materials, np.uint32),
        }

    def _particle_arrays(self) -> dict[str, np.ndarray]:
        """The `particle*` arrays of the contract."""
        rows = np.array([row for row in self._particles if self.keep[row]], np.int64)
        numbers = [self._particles[row] for row in rows.tolist()]
        return {
            "particle_instances": (np.cumsum(self.keep)[rows] - 1).astype(np.uint32),
            "particles": np.array(numbers, np.float32).reshape(-1, 13),
        }

    def _linked(self, sets: LinkSets) -> np.ndarray:
        """The sets that hold each instance; all lamps are known by now."""
        bits = {seen.names: sets.bits(seen.names) for seen in self._seen_by.values()}
        return np.fromiter((bits[seen.names] for seen in self._seen), np.uint64, len(self._seen))

    def _place(self, shape: Shape, item: bpy.types.DepsgraphObjectInstance, owner: Any) -> Placed:
        key = self._key(item, owner)
        count = 1 if shape.balls is None else len(shape.balls[1])
        steps, deforms = (0, False)
        if self.is_blurred:
            steps, deforms = motion_steps(owner, item.parent if item.is_instance else owner)
        placed = Placed(
            shape,
            len(self._placed),
            count,
            motion_times(steps),
            deforms and shape.positions is not None,
        )
        self._placed += [shape] * count
        self._keys.update(dict.fromkeys(self._free_keys(key, count)))
        self._seen += [self._seen_of(owner, item.parent if item.is_instance else owner)] * count
        self._colors.extend(owner.color[:] * count)
        if shape.asks_for_particle and item.particle_system:
            particle = particle_numbers(item, self.depsgraph.scene)
            self._particles.update(dict.fromkeys(range(placed.row, placed.row + count), particle))
        if self.materials.mattes:
            self._matte_numbers.extend(self.materials.mattes.of_object(owner) * count)
        self._infos.extend((owner.pass_index, random_number(item)) * count)
        if shape.balls is None:
            matrix = item.matrix_world
            for row in range(3):
                self._matrices.extend(matrix[row])
        else:
            matrices = placements(np.array(item.matrix_world, np.float32)[:3], *shape.balls)
            self._matrices.frombytes(matrices.tobytes())
        return placed

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
            names = (name_of(owner), name_of(parent))
            is_catcher = owner.is_shadow_catcher or parent.is_shadow_catcher
            links = self.lights.links(owner)
            lift = lift_cosine(owner)
            self._seen_by[key] = Seen(visibility, is_holdout, is_catcher, names, lift, links)
        return self._seen_by[key]

    def _key(self, item: bpy.types.DepsgraphObjectInstance, owner: bpy.types.Object) -> int:
        """The same number in every frame and session: what it is, and how it came to be."""
        key = self._hash(item, owner)
        while key in self._keys:
            key = (key + 1) % 2**64
        return key

    def _hash(self, item: bpy.types.DepsgraphObjectInstance, owner: bpy.types.Object) -> int:
        content = hashlib.blake2b(self._name(owner), digest_size=8)
        if item.is_instance:
            content.update(self._name(item.parent))
            content.update(array("i", item.persistent_id[:]))
        return int.from_bytes(content.digest(), "little")

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
            self._shapes[key] = self._load_shapes(owner)
        return self._shapes[key]

    def _load_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        if owner.type in LEFT_OUT_TYPES:
            self.warnings.add(owner.name, f"{LEFT_OUT_TYPES[owner.type]} not rendered yet")
        load = InstanceTable._smoke_shapes if smoke_domain(owner) else SHAPES.get(owner.type)
        try:
            return load(self, owner) if load else []
        except NotFinite:
            self.warnings.add(owner.name, "has vertices that are not numbers and is left out")
            return []

    def _mesh_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        if is_adaptive(owner, self.depsgraph.scene):
            what = "adaptive subdivision is not rendered yet (the modifier's own levels are used)"
            self.warnings.add(owner.name, what)
        if shading_offset(owner) > 0.0:
            self.warnings.not_rendered(owner.name, "Shading Offset below Shadow Terminator")
        rows = self._material_rows(owner)
        layers = self.layers.union(*(self.materials.layers[row] for row in rows))
        mesh = self._mesh(owner, layers)
        shapes = []
        if mesh is not None:
            if any(VOLUME_GENERATED in self.materials.grids[row] for row in rows):
                mesh = filled(
                    mesh, [], mesh_texture_space(owner.data), False, self.cache, self.core
                )
            if HAIR in layers and not any(map(has_hair, owner.particle_systems)):
                what = (
                    "Principled Hair is not rendered yet on meshes (faces count as parts of hairs)"
                )
                self.warnings.add(owner.name, what)
            shapes.append(replace(self._shape(owner, mesh, rows), positions=mesh_positions))
        first = 0
        for index, system in enumerate(owner.particle_systems):
            if has_hair(system):
                slot = min(system.settings.material, len(rows)) - 1
                read = partial(self._hair_of, index=index, first=first)
                hair = self._strand_shapes(owner, read, rows[max(slot, 0)])
                first += len(system.particles) + len(system.child_particles)
                shapes += [replace(shape, is_hair=True) for shape in hair]
        return shapes

    def _hair_of(self, owner: bpy.types.Object, index: int, first: int) -> Strands | None:
        strands = strands_of_particles(owner, owner.particle_systems[index], self.warnings)
        return strands and replace(strands, first=first)

    def _curves_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        def read(curves: bpy.types.Object) -> Strands:
            return strands_of_curves(curves.data)

        return self._strand_shapes(owner, read, self._material_rows(owner)[0])

    def _strand_shapes(
        self, owner: bpy.types.Object, read: Callable[[Any], Strands | None], row: int
    ) -> list[Shape]:
        """The tubes of the strands that `read` finds."""

        def surface_of(
            owner: bpy.types.Object, roots: np.ndarray | None, wanted: frozenset[str] = frozenset()
        ) -> Surface | None:
            strands = read(owner)
            return tubes(strands, owner.name, self.warnings, roots, wanted) if strands else None

        surface = surface_of(owner, None, self.materials.layers[row])
        if surface is None:
            return []

        def positions(owner: bpy.types.Object) -> np.ndarray | None:
            again = surface_of(owner, surface.roots)
            return again and again.vertices

        return [replace(self._plain_shape(owner, surface, row), positions=positions)]

    def _point_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        ball = self._plain_shape(owner, unit_ball(), self._material_rows(owner)[0])
        return [replace(ball, balls=read_points(owner.data))]

    def _volume_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        rows = self._material_rows(owner)
        wanted = grid_names(self.materials.grids[row] for row in rows)
        entry = self.cache.evaluated(owner)
        if entry is not None and (entry.mesh is None or entry.mesh.layers == wanted):
            mesh = entry.mesh
        else:
            grids = read_volume(owner, wanted, self.warnings, self.is_blurred)
            is_scaled = owner.data.render.space == "OBJECT"
            mesh = grid_box(grids, wanted, is_scaled, self.cache, self.core)
            self.cache.remember(owner, mesh)
        return [self._shape(owner, mesh, rows)] if mesh else []

    def _smoke_shapes(self, owner: bpy.types.Object) -> list[Shape]:
        rows = self._material_rows(owner)
        wanted = grid_names(self.materials.grids[row] for row in rows)
        grids = read_smoke(owner, wanted, self.depsgraph.scene.frame_current)
        if grids and self.is_blurred:
            self.warnings.add(owner.name, UNBLURRED)
        mesh = grid_box(grids, wanted, False, self.cache, self.core)
        return [self._shape(owner, mesh, rows)] if mesh else []

    def _plain_shape(self, owner: bpy.types.Object, surface: Surface, row: int) -> Shape:
        """A shape of one material."""
        mesh = load_surface(surface, self.cache, self.core)
        if self.materials.layers[row] - OF_STRANDS - {PARTICLE}:
            self.warnings.not_rendered(owner.name, "Texture coordinates of strands and points")
        return self._shape(owner, mesh, [row])

    def _shape(self, owner: bpy.types.Object, mesh: CachedMesh, rows: list[int]) -> Shape:
        number = self._mesh_rows.setdefault(mesh.digest, len(self.meshes))
        if number == len(self.meshes):
            self.meshes.append(mesh)
        asks = any(PARTICLE in self.materials.layers[row] for row in rows)
        return Shape(owner.name, number, self._slots(rows), asks_for_particle=asks)

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
        if owner.type == "VOLUME" or smoke_domain(owner):
            return [self.materials.index_of_volume(material) for material in materials]
        return [self.materials.index(material) for material in materials]

    def _slots(self, rows: list[int]) -> tuple[int, int]:
        """First entry and number of entries in `slot_materials`."""
        key = tuple(rows)
        if key not in self._slot_lists:
            self._slot_lists[key] = (len(self._slot_materials), len(rows))
            self._slot_materials += rows
        return self._slot_lists[key]


def particle_numbers(item: Any, scene: Any) -> list[float]:
    """What the contract's `particles` have of the particle that an instance shows."""
    number = item.persistent_id[0]
    particles = item.particle_system.particles
    if not 0 <= number < len(particles):  # a child of one
        return [float(number)] + [0.0] * 12
    particle = particles[number]
    age = scene.frame_current_final - particle.birth_time
    vectors = (particle.location, particle.velocity, particle.angular_velocity)
    single = (number, age, particle.lifetime, particle.size)
    return [*single, *(x for vector in vectors for x in vector)]


def lift_cosine(owner: bpy.types.Object) -> float:
    """Geometry Offset below Shadow Terminator: a setting of Cycles until objects got their own."""
    own = getattr(owner, LIFT_SETTING, None)
    return getattr(getattr(owner, "cycles", None), LIFT_SETTING, 0.1) if own is None else own


def shading_offset(owner: bpy.types.Object) -> float:
    """Shading Offset beside it, by the name that the running version has for it."""
    own = getattr(owner, "shadow_terminator_shading_offset", None)
    cycles = getattr(owner, "cycles", None)
    return getattr(cycles, "shadow_terminator_offset", 0.0) if own is None else own


def is_adaptive(owner: Any, scene: Any) -> bool:
    """Whether Cycles would divide an object's mesh as finely as the picture wants it."""
    last = owner.modifiers[-1] if owner.modifiers else None
    if last is None or last.type != "SUBSURF" or not last.show_render:
        return False
    if hasattr(last, "use_adaptive_subdivision"):  # Blender 5
        return last.use_adaptive_subdivision
    cycles, settings = getattr(owner.original, "cycles", None), getattr(scene, "cycles", None)
    is_experimental = getattr(settings, "feature_set", "") == "EXPERIMENTAL"
    return is_experimental and getattr(cycles, "use_adaptive_subdivision", False)


# What becomes triangles, by the object's type. Texts, metaballs and surfaces are instances of type
# MESH already.
SHAPES: dict[str, Callable[[InstanceTable, bpy.types.Object], list[Shape]]] = {
    "MESH": InstanceTable._mesh_shapes,
    "CURVES": InstanceTable._curves_shapes,
    "POINTCLOUD": InstanceTable._point_shapes,
    "VOLUME": InstanceTable._volume_shapes,
}
