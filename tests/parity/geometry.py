"""Things that are not plain meshes, and many of them."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import bpy
import numpy as np

from .rows import table
from .stage import Stage, add_node, give, matt, node_tree, output

COLOR = (0.8, 0.5, 0.1)


def put(stage: Stage, data: Any, location: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Any:
    """An object with this data in the place of cube and ball."""
    stage.clear()
    thing = bpy.data.objects.new("Thing", data)
    stage.scene.collection.objects.link(thing)
    thing.location = location
    if hasattr(data, "materials"):
        data.materials.append(matt(COLOR))
    return thing


def bevelled_curve(stage: Stage) -> None:
    stage.clear()
    bpy.ops.curve.primitive_bezier_circle_add(
        radius=1.5, location=(0.0, 0.0, 1.2), rotation=(0.8, 0.3, 0.0)
    )
    curve: Any = bpy.context.object
    curve.data.bevel_depth, curve.data.bevel_resolution = 0.3, 4
    give(curve, matt(COLOR))


def bent_quads(stage: Stage, edge_is_sharp: bool = False) -> None:
    """Flat faces that are no planes: each of their triangles has a normal of its own."""
    mesh = bpy.data.meshes.new("Bent")
    side = 4
    at = [(x, y) for y in range(side + 1) for x in range(side + 1)]
    places = [(x - 0.5 * side, y - 0.5 * side, 0.6 * ((x * y) % 3) - 0.5) for x, y in at]
    rows = [y * (side + 1) + x for y in range(side) for x in range(side)]
    mesh.from_pydata(places, [], [(i, i + 1, i + side + 2, i + side + 1) for i in rows])
    # The edge makes Blender's normals of corners count, those of whole faces.
    mesh.polygons[0].use_smooth = True
    mesh.edges[0].use_edge_sharp = edge_is_sharp
    for polygon in mesh.polygons[1:]:
        polygon.use_smooth = False
    put(stage, mesh)


def text(stage: Stage) -> None:
    data: Any = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude, data.align_x = "Cone", 0.2, "CENTER"
    put(stage, data).rotation_euler = (pi / 2, 0.0, 0.0)


def metaballs(stage: Stage) -> None:
    data: Any = bpy.data.metaballs.new("Drops")
    data.resolution = data.render_resolution = 0.2
    for x in (-0.7, 0.7):
        data.elements.new().co = (x, 0.0, 0.2 * x)
    put(stage, data)


def nurbs_surface(stage: Stage) -> None:
    stage.clear()
    bpy.ops.surface.primitive_nurbs_surface_torus_add(
        location=(0.0, 0.0, 1.2), rotation=(0.7, 0.0, 0.0)
    )
    give(bpy.context.object, matt(COLOR))


def subdivided(stage: Stage) -> None:
    modifier = stage.cube.modifiers.new("Smooth", "SUBSURF")
    modifier.render_levels = 4


def few_faces(stage: Stage, lift: float) -> None:
    """A smooth ball of few faces, lit from the side."""
    stage.clear()
    bpy.ops.mesh.primitive_uv_sphere_add(segments=10, ring_count=6, location=(0.0, 0.0, 1.3))
    bpy.ops.object.shade_smooth()
    ball: Any = bpy.context.object
    ball.scale = (1.6, 1.2, 1.2)
    # The object's own from Blender 5 on.
    name = "shadow_terminator_geometry_offset"
    setattr(ball if hasattr(ball, name) else ball.cycles, name, lift)
    give(ball, matt(COLOR))
    stage.only("POINT", energy=600.0, shadow_soft_size=0.1).location = (4.0, -0.5, 2.0)


def tufts(count: int, points: int) -> np.ndarray:
    """Root to tip of bent hairs on a disk, (count, points, 3)."""
    i, t = np.arange(count)[:, None], np.linspace(0.0, 1.0, points)[None, :]
    radius, angle = np.sqrt((i + 0.5) / count) * 1.5, i * 2.39996
    bend = 0.6 * t**2
    x = radius * np.cos(angle) + bend * np.cos(3.0 * angle)
    y = radius * np.sin(angle) + bend * np.sin(3.0 * angle)
    return np.stack([x, y, t * 1.6 + 0.0 * i], axis=-1).astype(np.float32)


def hair_curves(
    stage: Stage, shape: str, count: int = 60, root: float = 0.06, tip: float = 0.02
) -> None:
    """Curves objects, as hair, with a radius that shrinks."""
    points = 8
    data: Any = bpy.data.hair_curves.new("Hair")
    data.add_curves([points] * count)
    data.attributes["position"].data.foreach_set("vector", tufts(count, points).ravel())
    radius = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set(
        "value", np.tile(np.linspace(root, tip, points, dtype=np.float32), count)
    )
    put(stage, data, (0.0, 0.0, 0.0))
    stage.scene.cycles_curves.shape = shape
    stage.scene.render.hair_type = "STRIP" if shape == "RIBBONS" else "STRAND"


def hair_particles(stage: Stage, children: int = 0) -> None:
    """A hair particle system on the ball.

    On its vertices: over faces Blender strews other hairs whenever the scene is built, and always
    other children.
    """
    modifier = stage.ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings: Any = modifier.particle_system.settings
    settings.type, settings.count, settings.hair_length = "HAIR", 300, 0.6
    settings.emit_from = "VERT"
    settings.root_radius, settings.radius_scale = 3.0, 0.01
    if children:
        settings.child_type, settings.rendered_child_count = "SIMPLE", children


def displaced(stage: Stage, method: str, is_smooth: bool = True, space: str = "OBJECT") -> None:
    """Noise that lifts the vertices of the ball, and of a grid in the place of the cube."""
    tree = node_tree(bpy.data.materials.new("Row"))
    shader = add_node(tree, "ShaderNodeBsdfPrincipled", Roughness=0.4)
    tree.links.new(shader.outputs[0], output(tree).inputs["Surface"])
    noise = add_node(tree, "ShaderNodeTexNoise", Scale=5.0)
    lift = add_node(tree, "ShaderNodeDisplacement", space=space, Height=noise.outputs[0], Scale=0.5)
    tree.links.new(lift.outputs[0], output(tree).inputs["Displacement"])
    material = bpy.data.materials["Row"]
    material.displacement_method = method
    bpy.data.objects.remove(stage.cube)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=48, y_subdivisions=48, size=2.4)
    stage.cube = bpy.context.object
    stage.cube.location, stage.cube.rotation_euler = (-1.4, 0.3, 1.0), (0.7, 0.0, 0.4)
    stage.cube.scale = (1.0, 1.2, 0.8)
    for thing in (stage.cube, stage.ball):
        give(thing, material)
        thing.data.shade_smooth() if is_smooth else thing.data.shade_flat()


def displaced_by_vectors(stage: Stage, space: str) -> None:
    """Noise that moves the vertices of the ball, and of a grid in the place of the cube, aside."""
    displaced(stage, "DISPLACEMENT")
    tree = bpy.data.materials["Row"].node_tree
    noise = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeTexNoise")
    move = add_node(
        tree, "ShaderNodeVectorDisplacement", space=space, Vector=noise.outputs[1], Midlevel=0.5
    )
    tree.links.new(move.outputs[0], output(tree).inputs["Displacement"])


def points(stage: Stage, radius: float) -> None:
    """A point cloud, made by Geometry Nodes from the corners of the ball."""
    tree: Any = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, sink = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    to_points = tree.nodes.new("GeometryNodeMeshToPoints")
    to_points.inputs["Radius"].default_value = radius
    material = tree.nodes.new("GeometryNodeSetMaterial")
    material.inputs["Material"].default_value = matt(COLOR)
    tree.links.new(source.outputs[0], to_points.inputs[0])
    tree.links.new(to_points.outputs[0], material.inputs[0])
    tree.links.new(material.outputs[0], sink.inputs[0])
    bpy.data.objects.remove(stage.ball)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, location=(1.0, 0.0, 1.3))
    cloud: Any = bpy.context.object
    cloud.modifiers.new("Points", "NODES").node_group = tree


def instances(stage: Stage, side: int) -> None:
    """Balls on the corners of a grid."""
    stage.clear()
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=1.0)
    bpy.ops.object.shade_smooth()
    ball: Any = bpy.context.object
    give(ball, matt(COLOR))
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, size=6.0)
    grid: Any = bpy.context.object
    grid.instance_type = "VERTS"
    grid.show_instancer_for_render = False
    ball.parent, ball.scale = grid, (2.0 / side,) * 3


def scaled_instances(stage: Stage) -> None:
    """A collection of a cube, turned, stretched and mirrored."""
    library = bpy.data.collections.new("Library")
    stage.scene.collection.objects.unlink(stage.cube)
    library.objects.link(stage.cube)
    bpy.data.objects.remove(stage.ball)
    for x, scale in ((-1.0, (1.0, -1.0, 0.5)), (1.0, (0.5, 0.7, 1.4)), (3.0, (-0.5, -0.5, -0.5))):
        empty = bpy.data.objects.new("Copy", None)
        stage.scene.collection.objects.link(empty)
        empty.instance_type, empty.instance_collection = "COLLECTION", library
        empty.location, empty.scale, empty.rotation_euler = (x, 0.0, 0.5), scale, (0.0, 0.1, x)


def wires(stage: Stage) -> None:
    """A knot that grows thick and thin."""
    data: Any = bpy.data.curves.new("Knot", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.15
    spline = data.splines.new("POLY")
    spline.points.add(99)
    for i, point in enumerate(spline.points):
        t = 2.0 * pi * i / 99
        r = 1.0 + 0.4 * cos(3 * t)
        point.co = (r * cos(2 * t), r * sin(2 * t), 0.4 * sin(3 * t), 1.0)
        point.radius = 1.0 + 0.7 * sin(t)
    put(stage, data, (0.0, 0.0, 1.2))


ROWS = table(
    "geometry",
    ("curve, bevelled", bevelled_curve),
    ("curve, poly with radii", wires),
    ("text", text),
    ("flat faces that are no planes", bent_quads),
    ("flat faces that are no planes, a sharp edge", bent_quads, {"edge_is_sharp": True}),
    ("metaballs", metaballs),
    ("NURBS surface", nurbs_surface),
    ("subdivision", subdivided),
    ("hair curves, ribbons", hair_curves, {"shape": "RIBBONS"}),
    ("hair curves, 3D", hair_curves, {"shape": "THICK"}),
    ("hair curves, thin ribbons", hair_curves, {"shape": "RIBBONS", "count": 400, "root": 0.01, "tip": 0.0}),
    ("hair particles", hair_particles),
    ("hair particles, children", hair_particles, {"children": 10, "is_strewn": True}),
    ("displaced, smooth", displaced, {"method": "DISPLACEMENT"}),
    ("displaced, flat", displaced, {"method": "DISPLACEMENT", "is_smooth": False}),
    ("displaced, world space", displaced, {"method": "DISPLACEMENT", "space": "WORLD"}),
    ("displaced by bumps alone", displaced, {"method": "BUMP"}),
    ("displaced by bumps alone, flat", displaced, {"method": "BUMP", "is_smooth": False}),
    ("displaced and bumped", displaced, {"method": "BOTH"}),
    ("displaced and bumped, flat", displaced, {"method": "BOTH", "is_smooth": False}),
    ("displaced by vectors, tangent space", displaced_by_vectors, {"space": "TANGENT"}),
    ("displaced by vectors, object space", displaced_by_vectors, {"space": "OBJECT"}),
    ("displaced by vectors, world space", displaced_by_vectors, {"space": "WORLD"}),
    ("smooth form of few faces", few_faces, {"lift": 0.1}),
    ("smooth form of few faces, not lifted", few_faces, {"lift": 0.0}),
    ("point cloud", points, {"radius": 0.15}),
    ("instances on vertices", instances, {"side": 8}),
    ("instances, mirrored and stretched", scaled_instances),
)  # fmt: skip
