"""The two converted samples, from models of others (see ../LICENSES).

    python converted.py excavator MESHES_DIR HDRI   # zx120-*.obj, kloppenheim_05_1k.hdr
    python converted.py figure MANNEQUINY_GLB HDRI  # potsdamer_platz_1k.hdr

The excavator's meshes are the COLLADA files of zx120_description, converted to OBJ.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy
import loader
import numpy as np
from common import (
    Material,
    Object,
    Rng,
    Solid,
    camera,
    empty,
    key,
    noise,
    packed_image,
    principled,
    project_uv,
    save,
    start,
    tinted,
    world_image,
)
from mathutils import Vector


def reduced_hdri(path: Path, strength: float) -> None:
    """The panorama at half its size, each texel the mean of four, packed into the world."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    texels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(texels)
    halved = texels.reshape(height // 2, 2, width // 2, 2, 4).mean((1, 3))[..., :3]
    bpy.data.images.remove(image)
    world_image(packed_image(path.stem, halved, hdr=True), strength)


# ---------------------------------------------------------------- excavator

EXCAVATOR_FRAMES = 72
# Joint and mesh offsets of zx120.urdf: name, parent, origin, roll-pitch-yaw, mesh, its pitch.
LINKS = (
    ("track", None, (0, 0, 0), 0.0, "crawler", 0.0),
    ("body", "track", (0, 0, 1), 0.0, "body", 0.0),
    ("boom", "body", (0.14, -0.16443, 0.424), 1.57079632679, "boom", -1.185),
    ("arm", "boom", (0, 0, 4.6), 0.0, "arm", 3.28),
    ("bucket", "arm", (0, 0, 2.519), 0.0, "bucket", 0.75),
)
# A dig: frame, swing, boom, arm, bucket, inside the joint limits of the URDF.
DIG = (
    (1, 0, -0.55, 1.5, 0.3),
    (16, 0, -0.15, 1.15, -0.2),
    (30, 0, -0.25, 2.1, 1.6),
    (44, 0.35, -0.9, 2.2, 1.9),
    (60, 1.2, -1.0, 1.7, 1.2),
    (72, 1.3, -0.95, 1.2, -0.3),
)


def excavator(meshes: Path, hdri: Path) -> None:
    rng = np.random.default_rng(120)
    start(EXCAVATOR_FRAMES)
    worn = 0.25 + 0.4 * noise((256, 256), 6, rng, 5) ** 2
    wear = packed_image("PaintRoughness", np.repeat(worn[..., None], 3, 2), colour=False)
    orange = principled("Orange Paint", "#bd5f1a", rough_image=wear)
    track = principled("Track", "#2a2a2b", 0.6, metallic=0.4)
    steel = principled("Worn Steel", "#8b8884", 0.36, metallic=1.0)
    paints = {"crawler": track, "bucket": steel}
    joints = {}
    for name, parent, origin, pitch, mesh, mesh_pitch in LINKS:
        base = empty(name, origin, joints.get(parent))
        base.rotation_euler.y = pitch
        joints[name] = empty(f"{name}_joint", parent=base)
        part = import_obj(meshes / f"zx120-{mesh}.obj", paints.get(mesh, orange))
        part.parent = joints[name]
        part.rotation_euler = (0, mesh_pitch, 0)
    for frame, swing, *pitches in DIG:
        key(joints["body"], frame, rotation_euler=(0, 0, swing))
        for name, angle in zip(("boom", "arm", "bucket"), pitches, strict=True):
            key(joints[name], frame, rotation_euler=(0, angle, 0))
    pit(rng)
    reduced_hdri(hdri, 0.6)
    camera(
        [(1, (9.6, -9.2, 2.7), (2.3, -0.2, 2.0)), (72, (8.4, -10.4, 3.6), (2.2, 0.2, 2.2))],
        35,
        (0.05, 600),
    )
    save(
        "excavator",
        "Excavator",
        "a chain of rigid joints, a hard sun inside an HDRI, imported meshes with many small "
        "parts, metal, packed image textures",
        "sun",
        author="PWRI OPERA (model), DualCone contributors (scene)",
        licence="Apache-2.0 (model), CC0-1.0 (HDRI, scene)",
    )


def import_obj(path: Path, material: Material) -> Object:
    bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    part = bpy.context.object
    part.rotation_mode, part.location = "XYZ", (0, 0, 0)
    part.data.materials.clear()
    part.data.materials.append(material)
    for layer in list(part.data.uv_layers):
        part.data.uv_layers.remove(layer)
    project_uv(part.data, 1.5)
    return part


def pit(rng: Rng) -> None:
    """The loader's ground, a heap where the bucket unloads, and scattered stones."""
    loader.ground(rng, "#4f4335", "#957f62")
    rocks = loader.rock_kinds(rng, ("#5f5445", "#6d6252", "#544b3f"))
    loader.gravel_pile(rocks, rng, Vector((1.2, 8.2, 0)), 3.0, 1.9, 110)
    loader.gravel_pile(rocks, rng, Vector((-7.5, 5.0, 0)), 2.6, 1.5, 60)
    for rock in rocks:
        bpy.data.objects.remove(rock)


# ---------------------------------------------------------------- figure

FIGURE_FRAMES = 48
RUN_METRES_PER_FRAME = 0.17  # what the planted foot slides back in the action


def figure(model: Path, hdri: Path) -> None:
    rng = np.random.default_rng(12)
    start(FIGURE_FRAMES)
    bpy.ops.import_scene.gltf(filepath=str(model))
    bpy.data.objects.remove(bpy.data.objects["Icosphere"])  # the importer's bone shape
    use_paints()
    forget_normals()
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    loop_action(armature, next(a for a in bpy.data.actions if a.name.startswith("run_")))
    way = -RUN_METRES_PER_FRAME * (FIGURE_FRAMES - 1)
    for frame, y in ((1, 0.0), (FIGURE_FRAMES, way)):
        key(armature.parent, frame, location=(0, y, 0))
    tiles(rng)
    reduced_hdri(hdri, 1.0)
    begin = (1, (2.3, -3.6, 1.25), (-0.1, -0.15, 0.92))
    end = (FIGURE_FRAMES, (3.0, way - 2.7, 0.95), (-0.1, way - 0.15, 0.95))
    camera([begin, end], 46, (0.01, 500))
    save(
        "figure",
        "Running figure",
        "an armature deforming a skin, an overcast HDRI, a camera that travels along, "
        "packed image textures",
        "overcast",
        author="GDQuest and contributors (figure), DualCone contributors (scene)",
        licence="CC-BY-4.0 (figure), CC0-1.0 (HDRI, scene)",
    )


def use_paints() -> None:
    """Plain Principled colours after the file's own names; its vertex colours are all white."""
    paints = {
        "Azul": principled("Blue", "#2a5fae", 0.35),
        "Blanco": principled("White", "#dcdad4", 0.4),
        "Negro": principled("Black", "#1b1b1d", 0.3),
    }
    for old in [m for m in bpy.data.materials if m.name.endswith("_COLOR_0")]:
        old.user_remap(paints[old.name.split("_")[0]])
        bpy.data.materials.remove(old)


def forget_normals() -> None:
    """The file's normals stand at right angles to where its faces look; Blender's own do not."""
    for thing in (o for o in bpy.data.objects if o.type == "MESH"):
        bpy.context.view_layer.objects.active = thing
        bpy.ops.mesh.customdata_custom_splitnormals_clear()
        thing.data.shade_smooth()


def loop_action(armature: Object, action: bpy.types.Action) -> None:
    """Play one of the file's actions over and over, in an NLA strip of its own."""
    data = armature.animation_data
    data.action = None
    for track in list(data.nla_tracks):
        data.nla_tracks.remove(track)
    strip = data.nla_tracks.new().strips.new(action.name, 1, action)
    strip.repeat = math.ceil(FIGURE_FRAMES / (action.frame_range[1] - action.frame_range[0]))
    for other in [a for a in bpy.data.actions if a.users == 0 or a is not action]:
        other.use_fake_user = False


def tiles(rng: Rng) -> None:
    """A square of stone slabs, 0.6 m each, in several tones."""
    size, slabs = 384, 6
    row, column = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    tone = rng.random((slabs, slabs))[row * slabs // size, column * slabs // size]
    amount = 0.35 + 0.3 * tone + 0.3 * (noise((size, size), 12, rng, 5, 0.7) - 0.5)
    joint = (row % (size // slabs) < 2) | (column % (size // slabs) < 2)
    colour = tinted("#5f5c57", "#a5a099", np.where(joint, 0.0, amount))
    stone = principled(
        "Slabs", "#8c8880", 0.6, image=packed_image("Slabs", np.round(colour * 48) / 48)
    )
    ground = Solid("Ground")
    ground.add([(-60, -70, 0), (60, -70, 0), (60, 50, 0), (-60, 50, 0)], [range(4)], stone)
    ground.to_object(closed=False, smooth=False, uv_metres=3.6)


if __name__ == "__main__":
    kind, model_path, hdri_path = sys.argv[1:]
    {"excavator": excavator, "figure": figure}[kind](Path(model_path), Path(hdri_path))
