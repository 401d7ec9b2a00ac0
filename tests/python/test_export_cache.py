"""An export that keeps programs between frames gives what one that starts anew gives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from export_oracle import (
    add_camera,
    add_material,
    add_mesh,
    export,
    export_in_render,
    export_now,
    scene,
)

Change = Callable[[], None]


def principled(tree: Any) -> Any:
    return tree.nodes.new("ShaderNodeBsdfPrincipled").outputs[0]


class Stage:
    """A cube whose material has a group, an image and a ramp; a second one stays as it is."""

    def __init__(self) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        add_camera()
        self.cube = add_mesh()
        self.material = add_material("changing", principled)
        self.other = add_material("constant", principled)
        for material in (self.material, self.other):
            self.cube.data.materials.append(material)
        tree: Any = self.material.node_tree
        self.tree = tree
        self.shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
        self.group: Any = bpy.data.node_groups.new("group", "ShaderNodeTree")
        self.group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketFloat")
        self.value = self.group.nodes.new("ShaderNodeValue")
        end = self.group.nodes.new("NodeGroupOutput")
        self.group.links.new(self.value.outputs[0], end.inputs[0])
        inside = tree.nodes.new("ShaderNodeGroup")
        inside.node_tree = self.group
        self.ramp = tree.nodes.new("ShaderNodeValToRGB")
        tree.links.new(inside.outputs[0], self.ramp.inputs[0])
        tree.links.new(self.ramp.outputs[0], self.shader.inputs["Roughness"])
        self.texture = tree.nodes.new("ShaderNodeTexImage")
        self.texture.image = bpy.data.images.new("one", 4, 4)
        tree.links.new(self.texture.outputs[0], self.shader.inputs["Base Color"])
        self.metallic = self.shader.inputs["Metallic"]

    def key(self, socket: Any) -> None:
        """Animate a socket over frames 1 to 20."""
        for frame, value in ((1, 0.1), (20, 0.9)):
            socket.default_value = value
            socket.keyframe_insert("default_value", frame=frame)

    def drive(self) -> None:
        """Let a socket follow the cube."""
        driver = self.metallic.driver_add("default_value").driver
        driver.expression = "x"
        variable = driver.variables.new()
        variable.name = "x"
        variable.targets[0].id = self.cube
        variable.targets[0].data_path = "location.x"

    def relink(self) -> None:
        self.tree.links.remove(self.shader.inputs["Base Color"].links[0])

    def swap_image(self) -> None:
        self.texture.image = bpy.data.images.new("two", 2, 2)

    def recolor_image(self) -> None:
        self.texture.image.colorspace_settings.name = "Non-Color"

    def bend_ramp(self) -> None:
        self.ramp.color_ramp.elements[0].color = (0.3, 0.2, 0.1, 1.0)

    def set_value(self, socket: Any, value: float) -> None:
        socket.default_value = value

    def swap_slot(self) -> None:
        self.cube.material_slots[1].material = add_material("new", principled)

    def swap_group(self) -> None:
        group = self.group.copy()
        node: Any = next(n for n in group.nodes if n.bl_idname == "ShaderNodeValue")
        node.outputs[0].default_value = 0.77
        next(n for n in self.tree.nodes if n.type == "GROUP").node_tree = group


CHANGES: dict[str, Callable[[Stage], None]] = {
    "a value": lambda s: s.set_value(s.metallic, 0.6),
    "a value in a group": lambda s: s.set_value(s.value.outputs[0], 0.6),
    "a link": Stage.relink,
    "an image": Stage.swap_image,
    "an image's colour space": Stage.recolor_image,
    "a ramp": Stage.bend_ramp,
    "a slot": Stage.swap_slot,
    "a group": Stage.swap_group,
    "a pass index": lambda s: setattr(s.material, "pass_index", 3),
}


def contents(exported: Any) -> tuple[Any, ...]:
    """All of a frame that the renderer is given."""
    arrays = {name: array.tolist() for name, array in exported.arrays.items()}
    return arrays, exported.content_hash, exported.warnings


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_material_is_compiled_again(name: str) -> None:
    stage = Stage()
    cache = export.ExportCache()
    before = contents(export_now(cache))
    assert contents(export_now(cache)) == before
    assert cache.statistics.materials_compiled == 2
    CHANGES[name](stage)
    assert contents(export_now(cache)) == contents(export_now())
    # A constant material is not compiled for the sake of another.
    assert cache.statistics.materials_compiled == 3


ANIMATIONS: dict[str, Callable[[Stage], None]] = {
    "keys": lambda s: s.key(s.metallic),
    "keys in a group": lambda s: s.key(s.value.outputs[0]),
    "a driver": Stage.drive,
}


@pytest.mark.parametrize("name", ANIMATIONS)
@pytest.mark.parametrize("is_render", [False, True])
def test_animated_materials_are_compiled_for_each_frame(name: str, is_render: bool) -> None:
    stage = Stage()
    ANIMATIONS[name](stage)
    for frame, x in ((1, 0.2), (20, 0.8)):
        stage.cube.location.x = x
        stage.cube.keyframe_insert("location", frame=frame)
    frames = [1, 4, 4, 9, 2]

    def export_all(cache_of: Callable[[], Any]) -> list[Any]:
        if is_render:
            return [e for frame in frames for e in export_in_render([frame], cache_of())]
        exported = []
        for frame in frames:
            scene().frame_set(frame)
            exported.append(export_now(cache_of()))
        return exported

    cache = export.ExportCache()
    kept = export_in_render(frames, cache) if is_render else export_all(lambda: cache)
    fresh = export_all(export.ExportCache)
    assert [contents(e) for e in kept] == [contents(e) for e in fresh]
    constants = {tuple(np.ravel(e.arrays["program_constants"])) for e in kept}
    tables = {e.arrays["program_operands"].tobytes() for e in kept}
    assert len(constants) > 1 or len(tables) > 1, "nothing was animated"
    # Frame 4 again is the same, and the constant material is compiled once.
    assert cache.statistics.materials_compiled <= len(frames) + 1


def test_images_are_looked_at_again_even_where_programs_are_kept(tmp_path: Any) -> None:
    stage = Stage()
    path = tmp_path / "picture.png"
    picture = stage.texture.image
    picture.filepath_raw, picture.file_format = str(path), "PNG"
    picture.save()
    stage.texture.image = bpy.data.images.load(str(path))
    cache = export.ExportCache()
    before = export_now(cache)
    picture.pixels.foreach_set(np.full(64, 0.25, np.float32))
    picture.save()
    stage.texture.image.reload()
    after = export_now(cache)
    assert contents(after) == contents(export_now())
    assert after.content_hash != before.content_hash


def test_a_mesh_whose_texture_coordinates_nobody_asks_for_any_more_is_another() -> None:
    stage = Stage()
    stage.cube.data.uv_layers.new()
    cache = export.ExportCache()
    export_now(cache)
    stage.cube.material_slots[0].material = stage.other
    stage.cube.data.update_tag()
    assert contents(export_now(cache)) == contents(export_now())
