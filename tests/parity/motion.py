"""Motion blur."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .rows import table
from .stage import Stage, give, matt, shade


def motion(stage: Stage, thing: str, change: str, value: tuple[float, ...], **render: Any) -> None:
    """Something that moves, turns or grows from frame 0 to frame 2; frame 1 is rendered."""
    mover = getattr(stage, thing)
    start = tuple(getattr(mover, change))
    for frame, sign in ((0, -1.0), (2, 1.0)):
        setattr(mover, change, tuple(a + sign * b for a, b in zip(start, value, strict=True)))
        mover.keyframe_insert(change, frame=frame)
    stage.scene.frame_set(1)
    stage.scene.render.use_motion_blur = True
    for name, setting in render.items():
        owner = stage.scene.render if hasattr(stage.scene.render, name) else stage.scene.cycles
        setattr(owner, name, setting)


def deformation(stage: Stage) -> None:
    """A ball that a shape key stretches."""
    stage.ball.shape_key_add(name="Basis")
    key = stage.ball.shape_key_add(name="Long")
    for point in key.data:
        point.co.z *= 2.0
    for frame, value in ((0, 0.0), (2, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    stage.scene.frame_set(1)
    stage.scene.render.use_motion_blur = True


def blurred(stage: Stage, shutter: float = 0.5) -> None:
    """Render frame 1, with motion blur."""
    stage.scene.frame_set(1)
    stage.scene.render.use_motion_blur = True
    stage.scene.render.motion_blur_shutter = shutter


def follow(owner: Any, path: str, index: int, expression: str) -> None:
    """Let a property follow the frame number."""
    owner.driver_add(path, index).driver.expression = expression


def curve(stage: Stage) -> None:
    """A shutter that opens at once and closes slowly."""
    follow(stage.ball, "location", 0, "1.3 + 2 * (frame - 1)")
    blurred(stage, 1.0)
    mapping = stage.scene.render.motion_blur_shutter_curve
    points = mapping.curves[0].points
    for point in list(points)[1:-1]:
        points.remove(point)
    points[0].location, points[-1].location = (0.0, 1.0), (1.0, 0.0)
    for point in points:
        point.handle_type = "VECTOR"
    mapping.update()


def orbit(stage: Stage, steps: int) -> None:
    """A cube goes round the ball: with one step it cuts the corner."""
    follow(stage.cube, "location", 0, "1.3 - 2.2 * cos(2 * (frame - 1))")
    follow(stage.cube, "location", 1, "-2.2 * sin(2 * (frame - 1))")
    stage.cube.cycles.motion_steps = steps
    blurred(stage, 1.0)


def zoom(stage: Stage) -> None:
    """A lens that grows longer."""
    stage.camera.data.driver_add("lens").driver.expression = "50 + 30 * (frame - 1)"
    blurred(stage)


def armature(stage: Stage) -> None:
    """A finely divided cube that a bone bends."""
    bpy.ops.object.armature_add(location=(-1.2, 0.3, 1.0))
    rig: Any = bpy.context.object
    modifier = stage.cube.modifiers.new("Fine", "SUBSURF")
    modifier.subdivision_type, modifier.render_levels, modifier.levels = "SIMPLE", 3, 3
    group = stage.cube.vertex_groups.new(name="Bone")
    group.add([v.index for v in stage.cube.data.vertices if v.co.z > 0.0], 1.0, "REPLACE")
    stage.cube.modifiers.new("Rig", "ARMATURE").object = rig
    bone = rig.pose.bones[0]
    bone.rotation_mode = "XYZ"
    follow(bone, "rotation_euler", 2, "1.5 * (frame - 1)")
    rig.hide_render = True
    blurred(stage)


def instances(stage: Stage) -> None:
    """A collection with ball and cube, placed by an empty that moves and turns."""
    group: Any = bpy.data.collections.new("Group")
    for thing in (stage.cube, stage.ball):
        group.objects.link(thing)
        stage.scene.collection.objects.unlink(thing)
    empty: Any = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", group
    stage.scene.collection.objects.link(empty)
    follow(empty, "location", 2, "1.0 * (frame - 1)")
    follow(empty, "rotation_euler", 2, "0.6 * (frame - 1)")
    blurred(stage)


def hair(stage: Stage) -> None:
    """Upright hairs that nodes shift, the higher the further."""
    stage.clear()
    points = np.zeros((60, 6, 3), np.float32)
    points[:, :, 2] = np.linspace(0.0, 1.6, 6)
    points[:, :, 0] = 0.3 * (np.arange(60) % 12 - 5.5)[:, None]
    points[:, :, 1] = 0.3 * (np.arange(60) // 12 - 2)[:, None]
    data: Any = bpy.data.hair_curves.new("Hair")
    data.add_curves([6] * 60)
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    radius = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(360, 0.04, np.float32))
    data.materials.append(matt((0.8, 0.5, 0.1)))
    thing = bpy.data.objects.new("Hair", data)
    stage.scene.collection.objects.link(thing)
    thing.modifiers.new("Sway", "NODES").node_group = sway()
    stage.scene.cycles_curves.shape = "THICK"
    blurred(stage)


def sway() -> Any:
    """Nodes that shift points along X by their height times the frame number less one."""
    tree: Any = bpy.data.node_groups.new("Sway", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, end, shift, time, place, parts, away, by_height, offset = (
        tree.nodes.new(kind)
        for kind in (
            "NodeGroupInput",
            "NodeGroupOutput",
            "GeometryNodeSetPosition",
            "GeometryNodeInputSceneTime",
            "GeometryNodeInputPosition",
            "ShaderNodeSeparateXYZ",
            "ShaderNodeMath",
            "ShaderNodeMath",
            "ShaderNodeCombineXYZ",
        )
    )
    away.operation, by_height.operation = "SUBTRACT", "MULTIPLY"
    away.inputs[1].default_value = 1.0
    for source, target in (
        (start.outputs[0], shift.inputs["Geometry"]),
        (place.outputs[0], parts.inputs[0]),
        (time.outputs["Frame"], away.inputs[0]),
        (away.outputs[0], by_height.inputs[0]),
        (parts.outputs["Z"], by_height.inputs[1]),
        (by_height.outputs[0], offset.inputs["X"]),
        (offset.outputs[0], shift.inputs["Offset"]),
        (shift.outputs[0], end.inputs[0]),
    ):
        tree.links.new(source, target)
    return tree


def glow(stage: Stage) -> None:
    """A ball that lights the floor that it flies over."""
    give(
        stage.ball,
        shade(bpy.data.materials.new("Glow"), "ShaderNodeEmission", Strength=8.0),
    )
    stage.ball.scale = (0.4, 0.4, 0.4)
    follow(stage.ball, "location", 0, "0.6 + 3 * (frame - 1)")
    bpy.data.objects.remove(stage.lamp)
    blurred(stage)


def switched_off(stage: Stage) -> None:
    """Of two that move one is not blurred."""
    follow(stage.ball, "location", 2, "1 + 2 * (frame - 1)")
    follow(stage.cube, "location", 2, "1 + 2 * (frame - 1)")
    stage.cube.cycles.use_motion_blur = False
    blurred(stage)


ROWS = table(
    "motion blur",
    ("object moves", motion, {"thing": "ball", "change": "location", "value": (1.0, 0.0, 0.3)}),
    ("object turns", motion, {"thing": "cube", "change": "rotation_euler", "value": (0.0, 0.0, 1.0)}),
    ("object grows", motion, {"thing": "cube", "change": "scale", "value": (0.5, 0.0, 0.5)}),
    ("camera moves", motion, {"thing": "camera", "change": "location", "value": (0.6, 0.0, 0.0)}),
    ("camera turns", motion, {"thing": "camera", "change": "rotation_euler", "value": (0.0, 0.0, 0.1)}),
    ("shutter 1, at start", motion, {"thing": "ball", "change": "location", "value": (1.0, 0.0, 0.0), "motion_blur_shutter": 1.0, "motion_blur_position": "START"}),
    ("deformation", deformation),
    ("shutter 1.5, at end", motion, {"thing": "cube", "change": "location", "value": (0.0, 0.0, 1.0), "motion_blur_shutter": 1.5, "motion_blur_position": "END"}),
    ("shutter curve", curve),
    ("object orbits, 1 step", orbit, {"steps": 1}),
    ("object orbits, 3 steps", orbit, {"steps": 3}),
    ("camera zooms", zoom),
    ("armature", armature),
    ("instances move", instances),
    ("hair sways", hair),
    ("glowing object moves", glow),
    ("switched off for an object", switched_off),
)  # fmt: skip
