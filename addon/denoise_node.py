"""Blender's own Denoise node behind the render, for a Blender that lacks the library."""

from __future__ import annotations

from typing import Any

import bpy

# Input of the Denoise node: pass of the render.
GUIDES = {"Normal": "Normal", "Albedo": "Albedo"}


def compositor(scene: Any) -> Any:
    """Return the scene's compositing nodes, made if there are none."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        if scene.compositing_node_group is None:
            tree: Any = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
            tree.interface.new_socket(name="Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            scene.compositing_node_group = tree
        return scene.compositing_node_group
    scene.use_nodes = True
    return scene.node_tree


def node(tree: Any, kind: str) -> Any:
    """Return the first node of a kind, made if there is none."""
    found = next((n for n in tree.nodes if n.bl_idname == kind), None)
    return found or tree.nodes.new(kind)


def wire(scene: Any, view_layer: Any) -> Any:
    """Put a Denoise node between the render and what shows it; return the node."""
    view_layer.use_pass_normal = True
    view_layer.dualcone.use_pass_albedo = True
    view_layer.update_render_passes()
    scene.render.use_compositing = True
    tree = compositor(scene)
    source = node(tree, "CompositorNodeRLayers")
    source.scene, source.layer = scene, view_layer.name
    is_group = hasattr(scene, "compositing_node_group")
    output = node(tree, "NodeGroupOutput" if is_group else "CompositorNodeComposite")
    denoise = node(tree, "CompositorNodeDenoise")
    denoise.location = (source.location.x + 300, source.location.y)
    output.location = (source.location.x + 600, source.location.y)
    tree.links.new(source.outputs["Image"], denoise.inputs["Image"])
    for socket, render_pass in GUIDES.items():
        if render_pass in source.outputs:
            tree.links.new(source.outputs[render_pass], denoise.inputs[socket])
    tree.links.new(denoise.outputs["Image"], output.inputs[0])
    return denoise


class DUALCONE_OT_denoise_node(bpy.types.Operator):
    """Denoise in the compositor, with Blender's own Denoise node."""

    bl_idname = "render.dualcone_denoise_node"
    bl_label = "Use a Denoise Node"
    bl_description = "Put Blender's Denoise node behind the render, guided by albedo and normal"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Wire the node in place of the engine's own denoising, and share what it can clean."""
        scene: Any = context.scene
        wire(scene, context.view_layer)
        scene.dualcone.denoise = False
        scene.dualcone.share = "FRAMES"
        return {"FINISHED"}


def register() -> None:
    """Add the operator."""
    bpy.utils.register_class(DUALCONE_OT_denoise_node)


def unregister() -> None:
    """Take it away."""
    bpy.utils.unregister_class(DUALCONE_OT_denoise_node)
