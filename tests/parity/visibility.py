"""What objects and collections hide from rays."""

from __future__ import annotations

from typing import Any

import bpy

from .rows import table
from .stage import Stage, give, matt, shade


def hidden(stage: Stage, ray: str, thing: str = "ball") -> None:
    """An object that one kind of ray does not see, above a floor that mirrors."""
    material = bpy.data.materials.new("Glossy")
    shade(material, "ShaderNodeBsdfAnisotropic", Color=(0.8, 0.8, 0.8, 1.0), Roughness=0.2)
    give(stage.floor, material)
    setattr(getattr(stage, thing), f"visible_{ray}", False)


def glowing_hidden(stage: Stage, ray: str) -> None:
    """A glowing ball that one kind of ray does not see."""
    hidden(stage, ray)
    glow = shade(bpy.data.materials.new("Glow"), "ShaderNodeEmission", Strength=5.0)
    give(stage.ball, glow)


def flagged(stage: Stage, **flags: Any) -> None:
    for name, value in flags.items():
        setattr(stage.ball, name, value)


def in_collection(stage: Stage, **flags: Any) -> None:
    """The ball in a collection with flags of the view layer."""
    collection = bpy.data.collections.new("Flagged")
    stage.scene.collection.children.link(collection)
    stage.scene.collection.objects.unlink(stage.ball)
    collection.objects.link(stage.ball)
    layer = stage.scene.view_layers[0].layer_collection.children["Flagged"]
    for name, value in flags.items():
        setattr(layer, name, value)


def hidden_in_render(stage: Stage) -> None:
    stage.ball.hide_render = True


def shadow_catcher(stage: Stage) -> None:
    stage.scene.render.film_transparent = True
    stage.floor.is_shadow_catcher = True


def shadow_on_background(stage: Stage) -> None:
    stage.floor.is_shadow_catcher = True


def later_catcher(stage: Stage) -> None:
    """A smooth cube catches the ball's shadow, and is not the first thing of the scene."""
    stage.scene.render.film_transparent = True
    stage.cube.is_shadow_catcher = True
    stage.cube.data.shade_smooth()
    stage.ball.location = (0.7, 0.2, 2.4)
    stage.ball.scale = (0.4, 0.4, 0.4)


def override(stage: Stage) -> None:
    stage.scene.view_layers[0].material_override = matt((0.6, 0.6, 0.2))


ROWS = table(
    "visibility",
    ("object, camera", hidden, {"ray": "camera"}),
    ("object, diffuse", hidden, {"ray": "diffuse"}),
    ("object, glossy", hidden, {"ray": "glossy"}),
    ("object, transmission", hidden, {"ray": "transmission"}),
    ("object, shadow", hidden, {"ray": "shadow"}),
    ("floor, diffuse", hidden, {"ray": "diffuse", "thing": "floor"}),
    ("glowing object, camera", glowing_hidden, {"ray": "camera"}),
    ("glowing object, diffuse", glowing_hidden, {"ray": "diffuse"}),
    ("glowing object, glossy", glowing_hidden, {"ray": "glossy"}),
    ("object, holdout", flagged, {"is_holdout": True}),
    ("object, shadow catcher", shadow_catcher),
    ("object, shadow catcher, background shown", shadow_on_background),
    ("object, shadow catcher among others", later_catcher),
    ("object, hidden in renders", hidden_in_render),
    ("collection, excluded", in_collection, {"exclude": True}),
    ("collection, holdout", in_collection, {"holdout": True}),
    ("collection, indirect only", in_collection, {"indirect_only": True}),
    ("view layer, material override", override),
)
