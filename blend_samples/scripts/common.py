"""What the sample scenes share: solids, materials, images, skies, cameras, saving.

Lengths are in metres, angles in radians unless a name says degrees, Z is up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import bpy  # first: the wheel's own modules can be imported only after it
import numpy as np

import bmesh  # isort: skip
from mathutils import Euler, Matrix, Vector  # isort: skip

Object = bpy.types.Object
Material = bpy.types.Material
Rng = np.random.Generator
Point = Sequence[float]
SAMPLES_DIR = Path(__file__).resolve().parent.parent
SMOOTH_BELOW_DEGREES = 35.0


# ---------------------------------------------------------------- scene


def start(frame_end: int) -> bpy.types.Scene:
    """Empty the file and set what all samples have in common."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    bpy.context.preferences.filepaths.save_version = 0
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frame_end
    use_render_settings(scene)
    return scene


def use_render_settings(scene: bpy.types.Scene) -> None:
    """720x480 at 24 frames a second, Cycles at 64 samples, nothing after the render."""
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 720, 480, 100
    render.fps = 24
    render.use_compositing = render.use_sequencer = render.use_motion_blur = False
    render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 64
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False


def save(
    name: str,
    title: str,
    exercises: str,
    light: str,
    author: str = "DualCone contributors",
    licence: str = "CC0-1.0",
) -> Path:
    """Write NAME.blend with everything packed, and its card NAME.toml.

    `light` is interior, sun or overcast.
    """
    scene = bpy.context.scene
    scene.render.filepath = f"//out/{name}_####"
    scene.frame_set(scene.frame_start)
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    path = SAMPLES_DIR / f"{name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    lines = {"title": title, "author": author, "licence": licence, "exercises": exercises}
    lines["light"] = light
    card = "".join(f'{field} = "{text}"\n' for field, text in lines.items())
    card += f"frames = [{scene.frame_start}, {scene.frame_end}]\nfps = {scene.render.fps}\n"
    path.with_suffix(".toml").write_text(card + f"triangles = {evaluated_triangles()}\n")
    return path


def evaluated_triangles() -> int:
    """Triangles of the current frame as a renderer sees them, instances counted each."""
    graph = bpy.context.evaluated_depsgraph_get()
    count = 0
    for instance in graph.object_instances:
        if instance.object.type == "MESH":
            mesh = instance.object.data
            mesh.calc_loop_triangles()
            count += len(mesh.loop_triangles)
    return count


def link(obj: Object, parent: Object | None = None) -> Object:
    bpy.context.scene.collection.objects.link(obj)
    obj.parent = parent
    return obj


def empty(name: str, at: Point = (0, 0, 0), parent: Object | None = None) -> Object:
    obj = link(bpy.data.objects.new(name, None), parent)
    obj.location = at
    return obj


def copy(source: Object, at: Point, turn: Point = (0, 0, 0), scale: float | Point = 1.0) -> Object:
    """A further object on the same mesh and with the same modifiers."""
    obj = link(source.copy(), source.parent)
    obj.location = at
    obj.rotation_euler = turn
    obj.scale = (scale,) * 3 if isinstance(scale, int | float) else scale
    return obj


def key(obj: Object, frame: float, **values: float | Point) -> None:
    """Set properties and key them, as in `key(door, 1, location=(0, 0, 1))`."""
    for path, value in values.items():
        setattr(obj, path, value)
        obj.keyframe_insert(path, frame=frame)


def ease(u: float) -> float:
    """Smooth step from 0 to 1, flat outside."""
    u = min(max(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


def camera(
    keys: Sequence[tuple[int, Point, Point]], lens_mm: float, clip: tuple[float, float]
) -> None:
    """A camera flying through (frame, position, target) keys, looking at the target."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    data.lens, (data.clip_start, data.clip_end) = lens_mm, clip
    eye = link(bpy.data.objects.new("Camera", data))
    target = empty("CameraTarget")
    track = eye.constraints.new("TRACK_TO")
    track.target, track.track_axis, track.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "BEZIER"
    for frame, position, aim in keys:
        key(eye, frame, location=position)
        key(target, frame, location=aim)
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    scene.camera = eye


# ---------------------------------------------------------------- solids


class Solid:
    """Collects shells of several materials into one mesh."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.vertices: list[Vector] = []
        self.faces: list[list[int]] = []
        self.slots: list[int] = []
        self.materials: list[Material] = []

    def add(
        self,
        vertices: Iterable[Point],
        faces: Iterable[Sequence[int]],
        material: Material,
        matrix: Matrix | None = None,
    ) -> None:
        """Append one shell; `matrix` takes its coordinates to the solid's."""
        first = len(self.vertices)
        points = [Vector(v) for v in vertices]
        self.vertices += [matrix @ p for p in points] if matrix else points
        if material not in self.materials:
            self.materials.append(material)
        for face in faces:
            self.faces.append([first + i for i in face])
            self.slots.append(self.materials.index(material))

    def box(
        self,
        size: Point,
        centre: Point,
        material: Material,
        turn: Point = (0, 0, 0),
        taper: float = 1.0,
    ) -> None:
        """A box; `taper` scales its upper face in X and Y."""
        x, y, z = (s / 2 for s in size)
        corners = [
            (sx * x * t, sy * y * t, sz * z)
            for sz, t in ((-1, 1.0), (1, taper))
            for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        self.add(corners, faces, material, placed(centre, turn))

    def prism(
        self,
        outline: Sequence[Point],
        y: tuple[float, float],
        material: Material,
        matrix: Matrix | None = None,
    ) -> None:
        """An outline in the XZ plane, swept from y[0] to y[1]."""
        n = len(outline)
        points = [(x, side, z) for side in y for x, z in outline]
        faces = [tuple(range(n)), tuple(range(2 * n - 1, n - 1, -1))]
        faces += [(i, i + n, (i + 1) % n + n, (i + 1) % n) for i in range(n)]
        self.add(points, faces, material, matrix)

    def lathe(
        self,
        profile: Sequence[Point],
        material: Material,
        matrix: Matrix | None = None,
        segments: int = 24,
    ) -> None:
        """A profile of (radius, height) turned around Z; open ends are closed by caps."""
        rings = len(profile)
        points, faces = [], []
        for i in range(segments):
            a = 2 * math.pi * i / segments
            points += [(r * math.cos(a), r * math.sin(a), h) for r, h in profile]
        for i in range(segments):
            here, there = i * rings, (i + 1) % segments * rings
            faces += [(here + j, there + j, there + j + 1, here + j + 1) for j in range(rings - 1)]
        if tuple(profile[0]) != tuple(profile[-1]):
            faces += [tuple(i * rings + j for i in range(segments)) for j in (0, rings - 1)]
        self.add(points, faces, material, matrix)

    def cylinder(
        self,
        radius: float,
        start: Point,
        end: Point,
        material: Material,
        segments: int = 16,
        end_radius: float | None = None,
    ) -> None:
        """A cylinder, or a cone frustum, between two points."""
        axis = Vector(end) - Vector(start)
        top = radius if end_radius is None else end_radius
        matrix = Matrix.Translation(start) @ axis.to_track_quat("Z", "Y").to_matrix().to_4x4()
        self.lathe([(radius, 0), (top, axis.length)], material, matrix, segments)

    def tube(
        self, path: Sequence[Point], radius: float, material: Material, sides: int = 8
    ) -> None:
        """A round bar along a path of points."""
        points = [Vector(p) for p in path]
        rings: list[Vector] = []
        normal = (points[1] - points[0]).orthogonal().normalized()
        for i, p in enumerate(points):
            tangent = (points[min(i + 1, len(points) - 1)] - points[max(i - 1, 0)]).normalized()
            normal = (normal - tangent * normal.dot(tangent)).normalized()
            side = tangent.cross(normal)
            angles = (2 * math.pi * k / sides for k in range(sides))
            rings += [p + radius * (math.cos(a) * normal + math.sin(a) * side) for a in angles]
        last = (len(points) - 1) * sides
        faces: list[Sequence[int]] = [range(sides), range(last, last + sides)]
        faces += ruled_faces(len(points), sides, closed=True)
        self.add(rings, faces, material)

    def sheet(
        self,
        point: Callable[[float, float], Point],
        nu: int,
        nv: int,
        material: Material,
        matrix: Matrix | None = None,
    ) -> None:
        """A surface point(u, v) over the unit square, nu x nv faces."""
        points = [point(u / nu, v / nv) for u in range(nu + 1) for v in range(nv + 1)]
        self.add(points, ruled_faces(nu + 1, nv + 1, closed=False), material, matrix)

    def rock(self, radius: float, material: Material, rng: Rng, detail: int = 2) -> None:
        """A dented icosphere; the dents are random half-space cuts, so it has flat facets."""
        mesh = bmesh.new()
        bmesh.ops.create_icosphere(mesh, subdivisions=detail, radius=1.0)
        points = np.array([v.co for v in mesh.verts])
        for normal in rng.normal(size=(9, 3)):
            normal /= np.linalg.norm(normal)
            over = np.maximum(points @ normal - rng.uniform(0.55, 0.85), 0.0)
            points -= over[:, None] * normal
        points *= radius * rng.uniform(0.75, 1.0, 3)
        self.add(points.tolist(), [[v.index for v in f.verts] for f in mesh.faces], material)
        mesh.free()

    def to_object(
        self,
        parent: Object | None = None,
        at: Point = (0, 0, 0),
        bevel: float = 0.0,
        segments: int = 2,
        uv_metres: float = 0.0,
        smooth: bool = True,
        closed: bool = True,
    ) -> Object:
        """Make the object.

        It is bevelled by a modifier; UVs are projected along the main axes with `uv_metres`
        to one side of a texture (0: no UVs).
        """
        mesh = bpy.data.meshes.new(self.name)
        mesh.from_pydata([tuple(v) for v in self.vertices], [], self.faces)
        mesh.polygons.foreach_set("material_index", self.slots)
        for material in self.materials:
            mesh.materials.append(material)
        if closed:
            point_outward(mesh)
        if uv_metres:
            project_uv(mesh, uv_metres)
        if smooth:
            mesh.shade_smooth()
            mesh.set_sharp_from_angle(angle=math.radians(SMOOTH_BELOW_DEGREES))
        obj = link(bpy.data.objects.new(self.name, mesh), parent)
        obj.location = at
        if bevel:
            add_bevel(obj, bevel, segments)
        return obj


def outline(text: str) -> list[tuple[float, float]]:
    """Points from text such as "0.1 2, 0.4 2.5"."""
    return [(float(x), float(z)) for x, z in (pair.split() for pair in text.split(","))]


def placed(at: Point, turn: Point = (0, 0, 0)) -> Matrix:
    """Rotation by XYZ Euler angles, then translation."""
    return Matrix.Translation(at) @ Euler(turn).to_matrix().to_4x4()


def ruled_faces(rows: int, columns: int, closed: bool) -> list[tuple[int, int, int, int]]:
    """Quads between neighbouring rows of points; `closed` joins the last column to the first."""
    faces = []
    for i in range(rows - 1):
        for j in range(columns if closed else columns - 1):
            k = (j + 1) % columns
            faces.append(
                (i * columns + j, (i + 1) * columns + j, (i + 1) * columns + k, i * columns + k)
            )
    return faces


def point_outward(mesh: bpy.types.Mesh) -> None:
    edit = bmesh.new()
    edit.from_mesh(mesh)
    bmesh.ops.recalc_face_normals(edit, faces=edit.faces)
    edit.to_mesh(mesh)
    edit.free()


def project_uv(mesh: bpy.types.Mesh, metres: float) -> None:
    """Box projection: each face is mapped along the axis its normal is nearest to."""
    corners = np.zeros(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    points = np.zeros(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)[corners]
    normals = np.zeros(len(mesh.polygons) * 3, np.float32)
    sizes = np.zeros(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("normal", normals)
    mesh.polygons.foreach_get("loop_total", sizes)
    axis = np.repeat(np.abs(normals.reshape(-1, 3)).argmax(1), sizes)
    across, up = np.array([[1, 2], [0, 2], [0, 1]])[axis].T
    rows = np.arange(len(corners))
    uv = np.stack([points[rows, across], points[rows, up]], 1) / metres
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv.astype(np.float32).ravel())


def add_bevel(obj: Object, width: float, segments: int) -> None:
    bevel = obj.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = width, segments
    bevel.limit_method, bevel.angle_limit = "ANGLE", math.radians(SMOOTH_BELOW_DEGREES)
    bevel.harden_normals = True


# ---------------------------------------------------------------- materials


def linear(code: str) -> tuple[float, float, float]:
    """Scene-linear colour of an sRGB code such as '#d9a300'."""
    values = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    r, g, b = (v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values)
    return r, g, b


def principled(
    name: str,
    code: str,
    roughness: float = 0.5,
    metallic: float = 0.0,
    specular: float = 0.5,
    emission: float = 0.0,
    alpha: float = 1.0,
    image: bpy.types.Image | None = None,
    rough_image: bpy.types.Image | None = None,
) -> Material:
    """A Principled material; the images, where given, replace colour and roughness."""
    material, tree = shader_tree(name)
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    colour = (*linear(code), 1.0)
    values = {"Base Color": colour, "Emission Color": colour, "Emission Strength": emission}
    values |= {"Roughness": roughness, "Metallic": metallic, "Specular IOR Level": specular}
    values["Alpha"] = alpha
    for socket, value in values.items():
        shader.inputs[socket].default_value = value
    for socket, texture in (("Base Color", image), ("Roughness", rough_image)):
        if texture:
            node = tree.nodes.new("ShaderNodeTexImage")
            node.image = texture
            tree.links.new(node.outputs["Color"], shader.inputs[socket])
    tree.links.new(shader.outputs[0], tree.nodes["Output"].inputs["Surface"])
    return material


def diffuse(name: str, code: str) -> Material:
    return single_shader(name, "ShaderNodeBsdfDiffuse", Color=(*linear(code), 1.0))


def light_emitter(name: str, code: str, strength: float) -> Material:
    return single_shader(name, "ShaderNodeEmission", Color=(*linear(code), 1.0), Strength=strength)


def varnished(name: str, code: str, roughness: float, share: float) -> Material:
    """Diffuse with a constant share of white gloss over it: Mix of Diffuse and Glossy."""
    material, tree = shader_tree(name)
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs["Fac"].default_value = share
    below, above = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfGlossy")
    below.inputs["Color"].default_value = (*linear(code), 1.0)
    above.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    above.inputs["Roughness"].default_value = roughness
    tree.links.new(below.outputs[0], mix.inputs[1])
    tree.links.new(above.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Output"].inputs["Surface"])
    return material


def single_shader(name: str, kind: str, **values: float | tuple[float, ...]) -> Material:
    material, tree = shader_tree(name)
    node = tree.nodes.new(kind)
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    tree.links.new(node.outputs[0], tree.nodes["Output"].inputs["Surface"])
    return material


def shader_tree(name: str) -> tuple[Material, bpy.types.ShaderNodeTree]:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    material.node_tree.nodes.new("ShaderNodeOutputMaterial").name = "Output"
    return material, material.node_tree


# ---------------------------------------------------------------- images


def packed_image(
    name: str, pixels: np.ndarray, colour: bool = True, hdr: bool = False
) -> bpy.types.Image:
    """An image of (height, width, 3) floats, first row at the bottom, packed into the file.

    Values are sRGB codes in 0..1, plain numbers (colour=False), or radiance (hdr=True).
    """
    height, width, _ = pixels.shape
    image = bpy.data.images.new(name, width, height, float_buffer=hdr)
    image.colorspace_settings.name = "Linear Rec.709" if hdr else "sRGB" if colour else "Non-Color"
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    image.file_format = "HDR" if hdr else "PNG"
    image.pack()
    return image


def noise(
    shape: tuple[int, int], cells: int, rng: Rng, octaves: int = 4, gain: float = 0.5
) -> np.ndarray:
    """Tileable value noise in 0..1: random grids of `cells`, 2 cells, 4 cells..., cubic between."""
    total, weight = np.zeros(shape), 0.0
    for octave in range(octaves):
        n = cells << octave
        grid = rng.random((n, n))
        y, x = (np.arange(s) * n / s for s in shape)
        yi, xi = y.astype(int), x.astype(int)
        fy, fx = ((t - ti) ** 2 * (3 - 2 * (t - ti)) for t, ti in ((y, yi), (x, xi)))
        fy = fy[:, None]
        low = grid[yi][:, xi] * (1 - fx) + grid[yi][:, (xi + 1) % n] * fx
        yi = (yi + 1) % n
        high = grid[yi][:, xi] * (1 - fx) + grid[yi][:, (xi + 1) % n] * fx
        total += gain**octave * (low * (1 - fy) + high * fy)
        weight += gain**octave
    return total / weight


def tinted(low: str, high: str, amount: np.ndarray) -> np.ndarray:
    """The sRGB codes between two colours, by an array of 0..1."""
    a, b = (np.array([int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)]) for c in (low, high))
    return a + (b - a) * np.clip(amount, 0, 1)[..., None]


# ---------------------------------------------------------------- light


def sun(
    elevation_degrees: float, azimuth_degrees: float, strength: float, code: str = "#fff1dc"
) -> Vector:
    """A sun lamp; returns the direction towards it. Azimuth counts from +X to +Y."""
    e, a = math.radians(elevation_degrees), math.radians(azimuth_degrees)
    towards = Vector((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.angle, data.color = strength, math.radians(0.53), linear(code)
    obj = link(bpy.data.objects.new("Sun", data))
    obj.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
    return towards


def sky(
    towards_sun: Vector,
    strength: float,
    clouds: float,
    zenith: str,
    horizon: str,
    ground: str,
    seed: int,
) -> None:
    """A painted equirectangular sky: a gradient, a glow around the sun, clouds on a flat layer.

    The sun's disk is not in it; that is the lamp's.
    """
    height, width = 256, 512
    v, u = np.meshgrid(
        (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij"
    )
    elevation, azimuth = (v - 0.5) * np.pi, (0.5 - u) * 2 * np.pi
    up = np.sin(elevation)
    direction = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), up], -1
    )
    toward = np.clip(direction @ np.array(towards_sun), 0, 1)[..., None]
    haze = np.exp(-np.maximum(up, 0) * 5.0)[..., None]
    radiance = np.array(linear(zenith)) * (1 - haze) + np.array(linear(horizon)) * haze
    radiance += np.array([1.0, 0.82, 0.6]) * (0.35 * toward**8 + 0.9 * toward**64)
    cover = cloud_cover(direction, clouds, seed)[..., None]
    radiance = radiance * (1 - cover) + cover * (0.75 + 0.5 * toward**4) * np.array(
        [1.0, 0.98, 0.95]
    )
    below = np.clip(-up * 40, 0, 1)[..., None]
    radiance = radiance * (1 - below) + below * np.array(linear(ground))
    world_image(packed_image("Sky", radiance, hdr=True), strength)


def cloud_cover(direction: np.ndarray, amount: float, seed: int) -> np.ndarray:
    """How far clouds hide the sky, 0..1, for an array of directions."""
    size = 512
    field = noise((size, size), 6, np.random.default_rng(seed), octaves=6, gain=0.55)
    up = np.maximum(direction[..., 2], 0.03)
    x, y = (
        ((direction[..., k] / (up + 0.15) * 0.12 + 0.5) % 1.0 * size).astype(int) % size
        for k in (0, 1)
    )
    threshold = np.quantile(field, 1 - amount)
    return (
        np.clip((field[y, x] - threshold) / 0.12, 0, 1)
        * np.clip(direction[..., 2] * 8 - 0.2, 0, 1)
        * 0.9
    )


def world_image(image: bpy.types.Image, strength: float) -> None:
    world = bpy.data.worlds.new("World")
    bpy.context.scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    background = tree.nodes["Background"]
    background.inputs["Strength"].default_value = strength
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
