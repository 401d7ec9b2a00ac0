"""Every pass against Cycles' own, from the files that both write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from exr import Exr, read_exr, write_all_passes
from numpy.typing import NDArray

SIZE = 32
FLOOR = 3
FRAME = 3
IS_OLD = bpy.app.version < (5, 0, 0)
DATA_SWITCHES = (
    "use_pass_z",
    "use_pass_mist",
    "use_pass_position",
    "use_pass_normal",
    "use_pass_vector",
    "use_pass_uv",
    "use_pass_object_index",
    "use_pass_material_index",
)


@pytest.fixture
def stage(scene: Any, tmp_path: Path) -> Any:
    """Set up things of every kind: still, moving, deforming, seen by a camera that turns."""
    add_plane()
    add_moving_cube()
    add_deforming_tube()
    add_moving_camera(scene)
    world: Any = bpy.data.worlds.new("World")
    world.mist_settings.start, world.mist_settings.depth = 6.0, 9.0
    scene.world = world
    scene.frame_start, scene.frame_end = FRAME, FRAME
    scene.frame_set(FRAME)
    render = scene.render
    render.resolution_x = render.resolution_y = SIZE
    render.resolution_percentage = 100
    scene.dualcone.filter = "BOX"
    scene.dualcone.method = "PATH"
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    write_all_passes(scene, tmp_path)
    return scene


def material(name: str, index: int) -> Any:
    made: Any = bpy.data.materials.new(name)
    made.use_nodes = True
    made.pass_index = index
    return made


def add_plane() -> None:
    bpy.ops.mesh.primitive_plane_add(size=14.0)
    plane: Any = bpy.context.object
    plane.pass_index = FLOOR
    plane.data.materials.append(material("Floor", 7))


def add_moving_cube() -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(-1.5, 0.0, 1.0))
    cube: Any = bpy.context.object
    cube.pass_index = 12
    cube.data.materials.append(material("Paint", 5))
    for frame, x, angle in ((1, -2.0, 0.0), (3, -1.5, 0.3), (5, 0.0, 0.2)):
        cube.location.x, cube.rotation_euler.z = x, angle
        cube.keyframe_insert("location", frame=frame)
        cube.keyframe_insert("rotation_euler", frame=frame)


def add_deforming_tube() -> None:
    bpy.ops.mesh.primitive_cylinder_add(radius=0.8, depth=2.0, location=(2.0, 0.5, 1.0))
    tube: Any = bpy.context.object
    tube.pass_index = 9
    tube.data.uv_layers.remove(tube.data.uv_layers[0])
    tube.shape_key_add(name="Basis")
    key = tube.shape_key_add(name="Tall")
    for point in key.data:
        point.co.z *= 1.8
        point.co.x += 0.4
    for frame, value in ((1, 0.0), (3, 0.5), (5, 0.3)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def add_moving_camera(scene: Any) -> None:
    bpy.ops.object.camera_add(location=(0.0, -9.0, 4.0), rotation=(1.2, 0.0, 0.0))
    camera: Any = bpy.context.object
    for frame, x in ((1, -0.3), (3, 0.0), (5, 0.5)):
        camera.location.x = camera.rotation_euler.z = x
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.camera = camera


def render(scene: Any, engine: str, samples: int) -> Exr:
    """Render FRAME with an engine and read the file."""
    scene.render.engine = engine
    scene.dualcone.samples = scene.cycles.samples = samples
    scene.frame_set(FRAME)
    bpy.ops.render.render(animation=True)
    return read_exr(Path(bpy.path.abspath(scene.render.filepath)) / f"{FRAME:04}.exr")


def switch_on(scene: Any, *switches: str) -> None:
    for switch in switches:
        setattr(scene.view_layers[0], switch, True)


def blender_name(name: str) -> str:
    """Return what this version of Blender calls a pass."""
    from addon import passes

    return passes.NAMES_BEFORE_5.get(name, name) if IS_OLD else name


# Passes of what is seen, and how far a pixel of one object may be off.
TOLERANCES = {
    "Mist": 0.03,
    "Normal": 0.15,
    "Vector": 0.05,
    "UV": 0.02,
    "Object Index": 0.0,
    "Material Index": 0.0,
}
# Those of one sample somewhere in the pixel: off by no more than the pixels around are apart.
SAMPLED = ("Depth", "Position")


@pytest.fixture
def pair(stage: Any) -> tuple[Exr, Exr]:
    """Render the passes of what is seen with DualCone and with Cycles."""
    switch_on(stage, *DATA_SWITCHES)
    return render(stage, "DUALCONE", 64), render(stage, "CYCLES", 64)


def test_data_is_that_of_cycles(pair: tuple[Exr, Exr]) -> None:
    ours, theirs = pair
    assert ours.layers() == theirs.layers()
    inside = interior(ours) & interior(theirs)
    assert inside.mean() > 0.4
    for name, tolerance in TOLERANCES.items():
        assert errors(pair, name)[inside].max() <= tolerance, name
    for name in SAMPLED:
        around = spread(theirs.layer(name))
        assert (errors(pair, name) <= 1.1 * around)[inside].all(), name


def test_data_would_be_seen_to_differ(pair: tuple[Exr, Exr]) -> None:
    """No comparison holds for a picture that is moved by two pixels."""
    ours, theirs = pair
    inside = interior(ours) & interior(theirs)
    for name in (*TOLERANCES, *SAMPLED):
        tolerance = 1.1 * spread(theirs.layer(name)) if name in SAMPLED else TOLERANCES[name]
        moved = np.roll(ours.layer(blender_name(name)), 2, axis=1)
        error = np.abs(moved - theirs.layer(blender_name(name))).max(axis=-1)
        assert (error > tolerance)[inside].any(), name


PANE = 40


def test_data_shows_what_is_dense_enough(stage: Any) -> None:
    """Two panes before the camera: what of them, and of what they cover, passes show."""
    for x, alpha in ((-1.1, 0.7), (1.1, 0.3)):
        bpy.ops.mesh.primitive_plane_add(
            size=2.0, location=(x, -5.0, 2.5), rotation=(1.2, 0.0, 0.4)
        )
        pane: Any = bpy.context.object
        pane.pass_index = PANE
        pane.data.materials.append(material_of("BsdfPrincipled", Alpha=alpha))
    switch_on(stage, *DATA_SWITCHES)
    layer = stage.view_layers[0]
    layer.pass_alpha_threshold = 0.0
    all_shown = render(stage, "DUALCONE", 1), render(stage, "CYCLES", 1)
    # A seed of one sample each: the middle of a pane is the same for both.
    shows = [exr.layer(blender_name("Object Index"))[..., 0] == PANE for exr in all_shown]
    inside = np.logical_and.reduce([around(show).all(axis=0) for show in shows])
    left = np.arange(SIZE) < SIZE // 2
    dense, thin = inside & left, inside & ~left
    assert dense.sum() > 20
    assert thin.sum() > 20
    layer.pass_alpha_threshold = 0.5
    pair = render(stage, "DUALCONE", 256), render(stage, "CYCLES", 256)
    for name in SAMPLED:
        near = 1.1 * spread(all_shown[1].layer(name))
        assert (errors(pair, name) <= near)[dense].all(), name
    assert not errors(pair, "Object Index")[dense].any()
    # What lies behind the thin pane shows as often as chance lets a path pass it.
    for mask in (dense, thin):
        for name in ("Normal", "UV", "Vector"):
            ours, theirs = (exr.layer(blender_name(name))[mask].mean(axis=0) for exr in pair)
            np.testing.assert_allclose(ours, theirs, rtol=0.02, atol=0.02, err_msg=name)
    shares = [(exr.layer(blender_name("Object Index"))[thin] == PANE).mean() for exr in pair]
    # Six standard deviations of the difference of two counts.
    assert abs(shares[0] - shares[1]) < 6.0 * np.sqrt(2.0 * 0.3 * 0.7 / thin.sum())
    assert 0.0 < shares[0] < 1.0


PARTS = ("Diffuse", "Glossy", "Transmission")
LIGHT_SWITCHES = (
    *(
        f"use_pass_{part.lower()}_{way}"
        for part in PARTS
        for way in ("direct", "indirect", "color")
    ),
    "use_pass_emit",
    "use_pass_environment",
)


@pytest.fixture
def lit_stage(stage: Any) -> Any:
    """Give things of the stage all kinds of closures, and light of all kinds."""
    objects: Any = bpy.data.objects
    objects["Plane"].data.materials[0] = material_of("BsdfPrincipled", Roughness=0.35)
    cube = objects["Cube"]
    cube.data.materials[0] = material_of("BsdfGlass", Roughness=0.3)
    cube.animation_data_clear()
    cube.location.z = 1.3  # No face of the glass may lie in the floor.
    objects["Cylinder"].data.materials.append(material_of("BsdfTranslucent", Color=(0.3, 0.7, 0.5)))
    for x, shader, inputs in (
        (-2.2, "BsdfPrincipled", {"Metallic": 1.0, "Roughness": 0.4}),
        (0.0, "BsdfPrincipled", {"Coat Weight": 1.0, "Sheen Weight": 0.5}),
        (1.5, "BsdfPrincipled", {"Subsurface Weight": 1.0, "Subsurface Scale": 0.3}),
        (3.1, "Emission", {"Strength": 2.0}),
    ):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7, location=(x, -2.5, 0.7))
        ball: Any = bpy.context.object
        ball.data.materials.append(material_of(shader, **inputs))
    # One surface, so that light comes to it straight from its source.
    pane = material_of("BsdfRefraction", Roughness=0.4)
    pane.node_tree.nodes["Refraction BSDF"].distribution = "GGX"
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(0.0, -4.5, 3.6), rotation=(1.2, 0.0, 0.0))
    bpy.context.object.data.materials.append(pane)
    bpy.ops.object.light_add(type="AREA", location=(2.0, -4.0, 6.0))
    lamp: Any = bpy.context.object
    lamp.data.energy, lamp.data.size = 600.0, 2.0
    stage.world.use_nodes = True
    nodes = stage.world.node_tree.nodes
    sky = nodes.get("Background") or nodes.new("ShaderNodeBackground")
    end = nodes.get("World Output") or nodes.new("ShaderNodeOutputWorld")
    stage.world.node_tree.links.new(sky.outputs[0], end.inputs[0])
    sky.inputs["Color"].default_value = (0.4, 0.5, 0.8, 1.0)
    cycles = stage.cycles
    cycles.max_bounces = cycles.transmission_bounces = 12
    cycles.diffuse_bounces = cycles.glossy_bounces = 4
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    switch_on(stage, *LIGHT_SWITCHES)
    return stage


def material_of(shader: str, **inputs: Any) -> Any:
    """Make a material of one node."""
    made = material(shader, 1)
    tree = made.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(f"ShaderNode{shader}")
    for name, value in inputs.items():
        is_color = isinstance(value, tuple)
        node.inputs[name].default_value = (*value, 1.0) if is_color else value
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    return made


def lights(exr: Exr) -> dict[str, NDArray[Any]]:
    """Return the passes that add up to the picture, each with its colour."""
    found = {name: exr.layer(blender_name(name)) for name in ("Emission", "Environment")}
    for part in PARTS:
        color = exr.layer(blender_name(f"{part} Color"))
        for way in ("Direct", "Indirect"):
            name = f"{part} {way}"
            found[name] = color * exr.layer(blender_name(name))
    return found


@pytest.fixture
def cycles_light(lit_stage: Any) -> dict[str, NDArray[Any]]:
    return lights(render(lit_stage, "CYCLES", 512))


@pytest.mark.parametrize("method", ["PATH", "DUAL_CONE"])
def test_light_adds_up_and_is_divided_as_cycles_does(
    lit_stage: Any, cycles_light: dict[str, NDArray[Any]], method: str
) -> None:
    lit_stage.dualcone.method = method
    exr = render(lit_stage, "DUALCONE", 128)
    ours = lights(exr)
    total = sum(ours.values())
    np.testing.assert_allclose(total, exr.layer("Combined")[..., :3], rtol=1e-4, atol=1e-5)
    energies = {name: pixels.mean() for name, pixels in cycles_light.items()}
    for name, energy in energies.items():
        # Noise; a part that went to another pass would show as more.
        assert ours[name].mean() == pytest.approx(energy, rel=0.05, abs=5e-4), name
    assert min(energies.values()) > 5e-3


def test_colors_are_those_of_cycles(lit_stage: Any) -> None:
    switch_on(lit_stage, "use_pass_object_index")
    for index, thing in enumerate(bpy.data.objects):
        thing.pass_index = thing.pass_index or 20 + index
    ours, theirs = render(lit_stage, "DUALCONE", 64), render(lit_stage, "CYCLES", 64)
    inside = interior(ours) & interior(theirs)
    for part in PARTS:
        # How much rough glass lets pass is an estimate in both.
        tolerance = 0.12 if part == "Transmission" else 0.02
        name = f"{part} Color"
        assert errors((ours, theirs), name)[inside].max() < tolerance, name


def test_bits_do_not_depend_on_threads_or_on_frames_rendered_together(lit_stage: Any) -> None:
    switch_on(lit_stage, *DATA_SWITCHES)
    lit_stage.dualcone.method = "DUAL_CONE"
    alone = render(lit_stage, "DUALCONE", 4)
    lit_stage.frame_start, lit_stage.frame_end = FRAME - 1, FRAME + 1
    lit_stage.render.threads = 2
    together = render(lit_stage, "DUALCONE", 4)
    assert alone.channels.keys() == together.channels.keys()
    for name, pixels in alone.channels.items():
        np.testing.assert_array_equal(pixels, together.channels[name], name)


def test_a_pass_that_the_method_cannot_make_is_named(scene: Any) -> None:
    from addon import passes

    layer = scene.view_layers[0]
    switch_on(scene, "use_pass_glossy_direct", "use_pass_glossy_color", "use_pass_z")
    assert list(passes.problems(layer, "PATH")) == []
    (problem,) = passes.problems(layer, "PAPER")
    assert problem.startswith(f"{blender_name('Glossy Direct')}: only")
    for number in range(256):
        layer.lightgroups.add().name = f"Key {number}"
    (problem,) = passes.problems(layer, "PATH")
    assert problem.endswith(": Combined_Key 255")


@pytest.mark.parametrize("method", ["PATH", "DUAL_CONE"])
def test_light_groups_add_up_and_are_those_of_cycles(lit_stage: Any, method: str) -> None:
    glowing: Any = next(thing for thing in bpy.data.objects if "Emission" in thing.material_slots)
    members = {"Lamp": bpy.data.objects["Area"], "Glow": glowing, "Sky": lit_stage.world}
    for name, member in members.items():
        lit_stage.view_layers[0].lightgroups.add().name = name
        member.lightgroup = name
    lit_stage.view_layers[0].lightgroups.add().name = "Nothing"
    lit_stage.dualcone.method = method
    ours, theirs = render(lit_stage, "DUALCONE", 128), render(lit_stage, "CYCLES", 512)
    assert ours.layers() == theirs.layers()
    groups = [exr.layer(f"Combined_{name}") for exr in (ours, theirs) for name in members]
    if method == "PATH":
        combined = ours.layer("Combined")[..., :3]
        np.testing.assert_allclose(sum(groups[:3]), combined, rtol=1e-3, atol=1e-4)
    for one, other in zip(groups[:3], groups[3:], strict=True):
        # Noise; a light of another group would show as more.
        assert one.mean() == pytest.approx(other.mean(), rel=0.05)
    assert not ours.layer("Combined_Nothing").any()


WHITE = (1.0, 1.0, 1.0)


def test_guides_of_denoisers_are_those_of_cycles(lit_stage: Any) -> None:
    """Also of what a mirror and clear glass show; by each thing's mean, the noise of both."""
    for x, shader in ((-3.6, "BsdfAnisotropic"), (3.6, "BsdfGlass")):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=1.2, location=(x, 2.0, 1.0))
        bpy.ops.object.shade_smooth()
        bpy.context.object.data.materials.append(material_of(shader, Roughness=0.0, Color=WHITE))
    objects: Any = bpy.data.objects
    objects["Plane"].data.materials[0] = material_of("BsdfDiffuse", Color=(0.3, 0.6, 0.2))
    for index, thing in enumerate(objects):
        thing.pass_index = 20 + index
    lit_stage.view_layers[0].cycles.denoising_store_passes = True
    switch_on(lit_stage, "use_pass_object_index")
    pair = ours, theirs = render(lit_stage, "DUALCONE", 256), render(lit_stage, "CYCLES", 256)
    assert ours.layers() == theirs.layers()
    things = [exr.layer(blender_name("Object Index"))[..., 0] for exr in pair]
    for thing in np.unique(things[0]):
        # One sample tells whose a pixel is: those at the edge of a thing are left out.
        mask = np.logical_and.reduce([around(image == thing).all(axis=0) for image in things])
        if mask.sum() < 4:
            continue
        for name, tolerance in (("Normal", 0.02), ("Albedo", 0.03), ("Depth", 0.1)):
            means = [exr.layer(f"Denoising {name}")[mask].mean(axis=0) for exr in pair]
            np.testing.assert_allclose(*means, atol=tolerance, err_msg=f"{name} {thing}")


def test_ambient_occlusion_is_that_of_cycles(lit_stage: Any) -> None:
    lit_stage.world.light_settings.distance = 2.0
    switch_on(lit_stage, "use_pass_ambient_occlusion", "use_pass_object_index")
    pair = render(lit_stage, "DUALCONE", 512), render(lit_stage, "CYCLES", 512)
    inside = interior(pair[0]) & interior(pair[1])
    ours, theirs = (exr.layer(blender_name("Ambient Occlusion")) for exr in pair)
    assert np.ptp(theirs[inside]) > 0.4
    # Noise of one ray per sample, at most: the difference of two shares has sqrt(2 / 4 / 512).
    noise = 0.031
    error = (ours - theirs)[inside]
    assert np.abs(error).max() < 4.0 * noise
    assert error.std() < 0.5 * noise
    assert abs(error.mean()) < 0.004
    moved = (np.roll(ours, 1, axis=1) - theirs)[inside]
    assert moved.std() > 0.5 * noise
    assert np.abs(moved).max() > 4.0 * noise


def test_the_light_of_shadow_catchers_is_that_of_cycles(lit_stage: Any) -> None:
    bpy.data.objects["Plane"].is_shadow_catcher = True
    lit_stage.render.film_transparent = True
    lit_stage.view_layers[0].cycles.use_pass_shadow_catcher = True
    pair = render(lit_stage, "DUALCONE", 1024), render(lit_stage, "CYCLES", 1024)
    ours, theirs = (exr.layer("Shadow Catcher") for exr in pair)
    # Noise: each is off by 0.01 on average from what many samples make of it.
    assert np.abs(ours - theirs).mean() < 0.03
    assert np.abs(np.roll(ours, 1, axis=1) - theirs).mean() > 0.03
    # Chosen by its neighbours: a pixel's own noise would choose the dark ones.
    beside = np.roll(theirs, 1, axis=1) + np.roll(theirs, -1, axis=1)
    shaded = 0.5 * beside.mean(axis=-1) < 0.9
    assert 0.05 < shaded.mean() < 0.5
    # Some hundred pixels, each off by 0.05 at one standard deviation: over four of their means'.
    assert ours[shaded].mean() == pytest.approx(theirs[shaded].mean(), rel=0.05)


@pytest.mark.parametrize("method", ["PATH", "DUAL_CONE"])
def test_light_of_media_is_apart(lit_stage: Any, method: str) -> None:
    fog = material("Fog", 1)
    tree = fog.node_tree
    tree.nodes.clear()
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Density"].default_value = 0.5
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    bpy.data.objects["Cube"].data.materials[0] = fog
    layer = lit_stage.view_layers[0]
    # The switches are Cycles', and files that were made for it have them set.
    layer.cycles.use_pass_volume_direct = layer.cycles.use_pass_volume_indirect = True
    lit_stage.dualcone.method = method
    lit_stage.cycles.volume_bounces = lit_stage.dualcone.volume_bounces = 2
    ours, theirs = render(lit_stage, "DUALCONE", 128), render(lit_stage, "CYCLES", 256)
    media = ("Volume Direct", "Volume Indirect")
    total = sum([*lights(ours).values(), *(ours.layer(blender_name(name)) for name in media)])
    np.testing.assert_allclose(total, ours.layer("Combined")[..., :3], rtol=1e-4, atol=1e-5)
    for name in media:
        energies = [exr.layer(blender_name(name)).mean() for exr in (ours, theirs)]
        assert energies[1] > 1e-3
        assert energies[0] == pytest.approx(energies[1], rel=0.08), name


CRYPTOMATTE = ("CryptoObject", "CryptoMaterial", "CryptoAsset")


@pytest.fixture
def masked(stage: Any) -> Any:
    """Let all be named: children, an instance, a thing without material, names of all lengths."""
    from addon.export.matte import murmur3

    for kind in ("object", "material", "asset"):
        setattr(stage.view_layers[0], f"use_pass_cryptomatte_{kind}", True)
    cube, tube = bpy.data.objects["Cube"], bpy.data.objects["Cylinder"]
    tube.parent = cube
    tube.name = "Röhre"
    # Hashes whose bits would be infinite or too small for a float.
    cube.name, bpy.data.objects["Plane"].name = "Cube 296", "Stone 306"
    assert [murmur3(name.encode()) >> 23 & 0xFF for name in ("Cube 296", "Stone 306")] == [255, 0]
    mesh = bpy.data.meshes.new("Ball")
    mesh.from_pydata([(0, 0, 0), (2, 0, 0), (0, 0, 2)], [], [(0, 1, 2)])
    collection = bpy.data.collections.new("Held")
    collection.objects.link(bpy.data.objects.new("Ball 7", mesh))
    holder = bpy.data.objects.new("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", collection
    holder.location = (-1.0, -4.0, 0.5)
    stage.collection.objects.link(holder)
    return stage


def coverage(exr: Exr, kind: str) -> dict[float, NDArray[Any]]:
    """Return the share of each pixel that each name covers."""
    levels = sorted(name for name in exr.layers() if name.startswith(kind))
    assert levels == [f"{kind}{level:02}" for level in range(3)]
    found: dict[float, NDArray[Any]] = {}
    for level in levels:
        pixels = np.stack([exr.channels[f"ViewLayer.{level}.{c}"] for c in "rgba"], axis=-1)
        for names, weights in ((pixels[..., 0], pixels[..., 1]), (pixels[..., 2], pixels[..., 3])):
            for name in np.unique(names):
                share = np.where(names == name, weights, 0.0)
                found[float(name)] = found.get(float(name), 0.0) + share
    assert not np.any(found.pop(0.0, 0.0))
    return found


@pytest.mark.parametrize("method", ["PATH", "DUAL_CONE"])
def test_cryptomatte_names_what_cycles_names(masked: Any, method: str) -> None:
    masked.dualcone.method = method
    ours, theirs = render(masked, "DUALCONE", 64), render(masked, "CYCLES", 64)
    for kind in CRYPTOMATTE:
        mine, other = coverage(ours, kind), coverage(theirs, kind)
        assert mine.keys() == other.keys()
        assert len(mine) >= 3
        for name, share in other.items():
            np.testing.assert_allclose(mine[name].mean(), share.mean(), atol=0.004)
            assert np.abs(mine[name] - share).max() < 0.3  # edges, by chance
        total = np.sum(list(mine.values()), axis=0)
        assert total.max() <= 1.0 + 1e-5
        assert (total[: SIZE // 2] > 0.999).all()  # below the horizon


def test_cryptomatte_says_which_names_there_are(masked: Any) -> None:
    ours, theirs = render(masked, "DUALCONE", 1), render(masked, "CYCLES", 1)
    fields = {key: value for key, value in theirs.metadata.items() if key.startswith("cryptomatte")}
    assert len(fields) == 12
    for key, value in fields.items():
        if not key.endswith("manifest"):
            assert ours.metadata[key] == value
            continue
        names, known = json.loads(ours.metadata[key]), json.loads(value)
        # Cycles names what has no surface, too, and materials that nothing has.
        assert len(names) >= 3
        assert names.items() <= known.items()


def test_cryptomatte_ranks_by_weight(masked: Any) -> None:
    exr = render(masked, "DUALCONE", 64)
    weights = [exr.channels[f"ViewLayer.CryptoObject0{k}.{c}"] for k in range(3) for c in "ga"]
    assert (np.diff(np.stack(weights), axis=0) <= 0.0).all()
    masked.render.film_transparent = True
    exr = render(masked, "DUALCONE", 64)
    total = np.sum(list(coverage(exr, "CryptoObject").values()), axis=0)
    np.testing.assert_allclose(total, exr.layer("Combined")[..., 3], atol=1e-5)


@pytest.fixture
def marked(stage: Any) -> Any:
    """Let nodes fill passes: a colour by place, a number from a group; nothing on the cube."""
    layer = stage.view_layers[0]
    for name, kind in (("Stripes", "COLOR"), ("Height", "VALUE"), ("Nothing", "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    tube = bpy.data.objects["Cylinder"]
    tube.data.materials.append(material("Tube", 1))
    for owner in ("Plane", "Cylinder"):
        tree = bpy.data.objects[owner].data.materials[0].node_tree
        geometry = tree.nodes.new("ShaderNodeNewGeometry")
        color = tree.nodes.new("ShaderNodeOutputAOV")
        color.aov_name = "Stripes"
        tree.links.new(geometry.outputs["Position"], color.inputs["Color"])
    group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    group.interface.new_socket("Way", in_out="INPUT", socket_type="NodeSocketFloat")
    value = group.nodes.new("ShaderNodeOutputAOV")
    value.aov_name = "Height"
    inside = group.nodes.new("NodeGroupInput")
    group.links.new(inside.outputs[0], value.inputs["Value"])
    tree = tube.data.materials[0].node_tree
    outside = tree.nodes.new("ShaderNodeGroup")
    outside.node_tree = group
    outside.inputs[0].default_value = -2.5
    return stage


@pytest.mark.parametrize("method", ["PATH", "DUAL_CONE"])
def test_aov_outputs_are_those_of_cycles(marked: Any, method: str) -> None:
    switch_on(marked, "use_pass_object_index")
    marked.dualcone.method = method
    ours, theirs = render(marked, "DUALCONE", 64), render(marked, "CYCLES", 64)
    assert ours.layers() == theirs.layers() >= {"Stripes", "Height", "Nothing"}
    inside = interior(ours) & interior(theirs)
    for name, tolerance, largest in (("Stripes", 0.15, 3.0), ("Height", 0.0, 2.0)):
        assert np.abs(theirs.layer(name)[inside]).max() > largest
        assert errors((ours, theirs), name)[inside].max() <= tolerance, name
    assert not ours.layer("Nothing").any()


def errors(pair: tuple[Exr, Exr], name: str) -> NDArray[Any]:
    ours, theirs = (exr.layer(blender_name(name)) for exr in pair)
    assert ours.shape == theirs.shape
    return np.abs(ours - theirs).max(axis=-1)


def around(pixels: NDArray[Any]) -> NDArray[Any]:
    """Return each pixel's neighbours and itself, (9, H, W, ...)."""
    steps = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    return np.stack([np.roll(pixels, step, axis=(0, 1)) for step in steps])


def spread(pixels: NDArray[Any]) -> NDArray[Any]:
    return np.ptp(around(pixels), axis=0).max(axis=-1)


def interior(exr: Exr) -> NDArray[np.bool_]:
    """Pixels that show one object, and so do their neighbours; needs the pass Object Index."""
    index = exr.layer(blender_name("Object Index"))[..., 0]
    alpha = exr.layer("Combined")[..., 3]
    same = (np.ptp(around(index), axis=0) == 0) & (index > 0) & (alpha == 1.0)
    same[[0, -1]] = same[:, [0, -1]] = False
    # Where the floor ends in the distance a pixel holds half of it.
    same[SIZE * 3 // 4 :] &= index[SIZE * 3 // 4 :] != FLOOR
    return same
