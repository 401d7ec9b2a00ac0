"""Helpers of the export tests: a core that records, a render that exports, USD as oracle."""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import numpy as np
from pxr import Usd, UsdGeom  # pyright: ignore[reportMissingImports]

import dualcone

ROOT = Path(__file__).resolve().parent.parent.parent


def load_export() -> ModuleType:
    """Import addon/export on its own: it needs nothing else of the add-on."""
    name = "dualcone_export"
    if name not in sys.modules:
        folder = ROOT / "addon" / "export"
        spec = importlib.util.spec_from_file_location(
            name, folder / "__init__.py", submodule_search_locations=[str(folder)]
        )
        assert spec is not None
        assert spec.loader is not None
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[name]


export = load_export()


def scene() -> Any:
    """Return the scene of the file, of which there always is one."""
    return bpy.context.scene


@dataclass
class RecordedMesh:
    """What `dualcone.Mesh` was given."""

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray
    corner_uvs: np.ndarray
    layer_keys: np.ndarray
    layer_values: np.ndarray
    material_slots: np.ndarray
    motion_vertices: np.ndarray | None = None
    grids: dict[int, RecordedGrid] = field(default_factory=dict)
    texture_space: np.ndarray | None = None
    is_scaled: bool = False

    def moving(self, motion_vertices: np.ndarray) -> RecordedMesh:
        return replace(self, motion_vertices=motion_vertices)

    def filled(
        self,
        grids: Sequence[tuple[int, RecordedGrid]],
        texture_space: np.ndarray,
        is_scaled: bool,
    ) -> RecordedMesh:
        return replace(self, grids=dict(grids), texture_space=texture_space, is_scaled=is_scaled)


@dataclass
class RecordedGrid:
    """What `dualcone.Grid` was given."""

    voxels: np.ndarray
    index_from_object: np.ndarray


@dataclass
class RecordedImage:
    """What `dualcone.Image` was given."""

    pixels: np.ndarray
    extension: str
    interpolation: str
    encoding: str = "LINEAR"
    divides_alpha: bool = False
    replaced_texels: int = 0
    tiles: tuple[tuple[int, RecordedImage], ...] = ()

    @staticmethod
    def tiled(tiles: Sequence[tuple[int, RecordedImage]]) -> RecordedImage:
        """Stand in for `dualcone.Image.tiled`."""
        return RecordedImage(np.zeros((1, 1, 4), np.float32), "", "", tiles=tuple(tiles))

    def seen(self) -> np.ndarray:
        """What a look at the middle of each texel returns."""
        color, alpha = self.pixels[..., :3], self.pixels[..., 3:]
        if self.divides_alpha:
            color = np.divide(color, alpha, out=color.copy(), where=alpha > 0.0)
        if self.encoding == "SRGB":
            color = sys.modules[export.__name__ + ".image"].srgb_to_linear(color)
        return np.concatenate([color, alpha], axis=-1)


@dataclass
class RecordingCore:
    """Stands in for the compiled module and keeps what it is given."""

    built: list[RecordedMesh] = field(default_factory=list)
    Image: type = RecordedImage
    Grid: type = RecordedGrid
    operations: Callable[[], Any] = dualcone.operations

    def Mesh(self, **arrays: np.ndarray) -> RecordedMesh:  # noqa: N802, the module's name for it
        self.built.append(RecordedMesh(**arrays))
        return self.built[-1]


def export_now(cache: Any = None, core: Any = None, resolution: tuple[int, int] = (32, 24)) -> Any:
    """Export the current frame from the viewport's depsgraph."""
    return export.export_frame(
        bpy.context.evaluated_depsgraph_get(),
        scene().frame_current,
        resolution,
        cache or export.ExportCache(),
        core or RecordingCore(),
        lambda: False,
    )


def export_in_render(frames: Sequence[int], cache: Any = None, core: Any = None) -> list[Any]:
    """Export frames as the engine does: in `update` of a render, moved by `frame_set`."""
    results: list[Any] = []
    errors: list[BaseException] = []
    cache = cache or export.ExportCache()
    core = core or RecordingCore()

    class Engine(bpy.types.RenderEngine):
        bl_idname = "EXPORT_TEST"
        bl_label = "Export test"

        def update(  # pyright: ignore[reportIncompatibleMethodOverride]
            self, data: Any, depsgraph: Any
        ) -> None:
            now = depsgraph.scene.frame_current
            try:
                for frame in frames:
                    self.frame_set(frame, 0.0)
                    results.append(
                        export.export_frame(
                            depsgraph, frame, (32, 24), cache, core, lambda: False, self.frame_set
                        )
                    )
            except BaseException as error:  # Blender would only print it
                errors.append(error)
            finally:
                self.frame_set(now, 0.0)

        def render(self, depsgraph: Any) -> None:
            pass

    render = scene().render
    bpy.utils.register_class(Engine)
    try:
        render.engine = Engine.bl_idname
        render.resolution_x, render.resolution_y = 8, 8
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(Engine)
    if errors:
        raise errors[0]
    return results


@dataclass(eq=False)
class PlacedMesh:
    """A mesh in world space: points (V, 3), and the directed edges of its faces."""

    points: np.ndarray
    edges: set[tuple[int, int]]
    triangle_count: int


def placed_meshes(frame: Any) -> list[PlacedMesh]:
    """The instances of an exported frame."""
    placed = []
    for row, mesh_row in enumerate(frame.arrays["instance_mesh"]):
        mesh = frame.meshes[mesh_row]
        matrix = frame.arrays["world_from_object"][row].astype(np.float64)
        points = mesh.vertices @ matrix[:, :3].T + matrix[:, 3]
        triangles = mesh.triangles.astype(int)
        edges = {(int(t[i]), int(t[i - 2])) for t in triangles for i in range(3)}
        placed.append(PlacedMesh(points, edges, len(triangles)))
    return placed


def usd_meshes(path: Path, frame: int) -> list[PlacedMesh]:
    """All meshes of a USD file at a frame, instances included."""
    stage = Usd.Stage.Open(str(path))
    time = Usd.TimeCode(frame)
    cache = UsdGeom.XformCache(time)
    placed = []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh) or _is_prototype(prim):
            continue
        if UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible:
            continue
        placed.append(_placed(UsdGeom.Mesh(prim), cache.GetLocalToWorldTransform(prim), time))
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.PointInstancer):
            placed += _point_instances(stage, UsdGeom.PointInstancer(prim), cache, time)
    return [mesh for mesh in placed if mesh.triangle_count]


def _is_prototype(prim: Any) -> bool:
    while prim:
        if prim.IsA(UsdGeom.PointInstancer):
            return True
        prim = prim.GetParent()
    return False


def _point_instances(stage: Any, instancer: Any, cache: Any, time: Any) -> list[PlacedMesh]:
    placed = []
    base = cache.GetLocalToWorldTransform(instancer.GetPrim())
    matrices = instancer.ComputeInstanceTransformsAtTime(time, time)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    for index, matrix in zip(instancer.GetProtoIndicesAttr().Get(time), matrices, strict=True):
        root = stage.GetPrimAtPath(targets[index])
        for prim in Usd.PrimRange(root, Usd.TraverseInstanceProxies()):
            if prim.IsA(UsdGeom.Mesh):
                inner = cache.ComputeRelativeTransform(prim, root)[0]
                placed.append(_placed(UsdGeom.Mesh(prim), inner * matrix * base, time))
    return placed


def _placed(mesh: Any, world: Any, time: Any) -> PlacedMesh:
    matrix = np.array(world)  # row vectors
    points = np.array(mesh.GetPointsAttr().Get(time) or np.zeros((0, 3)), np.float64)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], int)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], int)
    edges = set()
    for face in np.split(corners, np.cumsum(counts)[:-1]):
        edges |= {(int(a), int(b)) for a, b in zip(face, np.roll(face, -1), strict=True)}
    return PlacedMesh(points @ matrix[:3, :3] + matrix[3, :3], edges, int((counts - 2).sum()))


def write_usd(path: Path, frames: Sequence[int]) -> None:
    """Export the scene to USD with Blender's own exporter, as it would be rendered."""
    scene().frame_start, scene().frame_end = min(frames), max(frames)
    bpy.ops.wm.usd_export(
        filepath=str(path),
        check_existing=False,
        export_animation=True,
        export_materials=False,
        export_armatures=False,
        export_shapekeys=False,
        export_subdivision="TESSELLATE",
        use_instancing=False,
        evaluation_mode="RENDER",
    )


def assert_same_meshes(ours: list[PlacedMesh], oracle: list[PlacedMesh]) -> None:
    """Each of our meshes is one of the oracle's: the same points in the same order, same faces."""
    assert len(ours) == len(oracle)
    left = list(oracle)
    for mesh in ours:
        twin = next((other for other in left if _is_same(mesh, other)), None)
        assert twin is not None, f"no twin for a mesh of {len(mesh.points)} points"
        left.remove(twin)


def _is_same(mesh: PlacedMesh, other: PlacedMesh) -> bool:
    return (
        mesh.points.shape == other.points.shape
        and mesh.triangle_count == other.triangle_count
        and other.edges <= mesh.edges
        and np.allclose(mesh.points, other.points, atol=2e-5)
    )


def add_object(name: str, data: Any, **properties: Any) -> Any:
    """Link a new object to the scene."""
    owner = bpy.data.objects.new(name, data)
    scene().collection.objects.link(owner)
    for key, value in properties.items():
        setattr(owner, key, value)
    return owner


def add_camera(**properties: Any) -> Any:
    """Add a camera that looks down from z = 10 and make it active."""
    owner = add_object("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 10))
    for key, value in properties.items():
        setattr(owner.data, key, value)
    scene().camera = owner
    return owner


def add_mesh(name: str = "Mesh", size: float = 1.0) -> Any:
    """Add a quad and a triangle that share an edge."""
    mesh = bpy.data.meshes.new(name)
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0.5, 0.5)]) * size
    mesh.from_pydata(points.tolist(), [], [(0, 1, 2, 3), (1, 4, 2)])
    return add_object(name, mesh)


def add_primitive(kind: str, name: str, **arguments: Any) -> Any:
    """Add one of Blender's mesh primitives."""
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**arguments)
    owner: Any = bpy.context.object
    owner.name = name
    return owner


def animate(owner: Any, path: str, values: dict[int, Any], index: int = -1) -> None:
    """Set keyframes; `values` maps frames to values."""
    for frame, value in values.items():
        holder, _, name = path.rpartition(".")
        target = owner.path_resolve(holder) if holder else owner
        if index >= 0:
            getattr(target, name)[index] = value
        else:
            setattr(target, name, value)
        owner.keyframe_insert(path, frame=frame, index=index)


def add_material(name: str, build: Callable[[Any], Any]) -> Any:
    """Add a material whose surface is the socket that `build(tree)` returns, if it does."""
    material: Any = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if (surface := build(tree)) is not None:
        tree.links.new(surface, output.inputs["Surface"])
    return material


def textured_diffuse(tree: Any) -> Any:
    """Build a Diffuse BSDF with an image for `add_material`."""
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("Texture", 1, 1)
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    return shader.outputs[0]


def contract_table(name: str) -> dict[str, tuple[str, int]]:
    """Rows of a table of src/contract/arrays.rs: name -> (dtype, number of axes)."""
    text = (ROOT / "src" / "contract" / "arrays.rs").read_text()
    table = re.search(rf"pub const {name}: &\[ArraySpec\] = &\[(.*?)\n?\];", text, re.S)
    assert table is not None
    rows = re.findall(r'array\(\s*"(\w+)",\s*(\w+),\s*&\[(.*?)\]', table[1], re.S)
    names = {"F32": "float32", "U32": "uint32", "I32": "int32", "U64": "uint64"}
    return {row: (names[dtype], len(re.findall(r'"', shape)) // 2) for row, dtype, shape in rows}


def render_with_cycles(folder: Path, size: int, samples: int, bounces: int = 0) -> np.ndarray:
    """Render the scene with Cycles: pixels (size, size, 4), rows from the bottom up."""
    render, cycles = scene().render, scene().cycles
    render.engine, cycles.device = "CYCLES", "CPU"
    cycles.samples, cycles.max_bounces = samples, bounces
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 0.01
    render.resolution_x = render.resolution_y = size
    render.threads_mode, render.threads = "FIXED", 1
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = str(folder / "cycles.exr")
    bpy.ops.render.render(write_still=True)
    image: Any = bpy.data.images.load(render.filepath)
    pixels = np.empty((size, size, 4), np.float32)
    image.pixels.foreach_get(pixels.reshape(-1))
    bpy.data.images.remove(image)
    return pixels
