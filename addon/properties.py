"""Properties at `scene.dualcone` and `view_layer.dualcone`, from the renderer's own tables."""

from __future__ import annotations

from typing import Any, cast

import bpy

from . import core, passes

# Settings of the renderer that Blender or Cycles keep themselves.
BLENDER_OWN = {
    "film_transparent": lambda scene: bool(scene.render.film_transparent),
    "film_transparent_glass": lambda scene: bool(_cycles(scene, "film_transparent_glass", False)),
    "film_transparent_roughness": lambda scene: _cycles(scene, "film_transparent_roughness", 0.1),
}

# Settings that are those of Cycles, under its name, until they are set for DualCone: a scene made
# for Cycles then bounces and filters light as it did.
CYCLES_NAMES = {
    "max_bounces": "max_bounces",
    "diffuse_bounces": "diffuse_bounces",
    "glossy_bounces": "glossy_bounces",
    "transmission_bounces": "transmission_bounces",
    "volume_bounces": "volume_bounces",
    "transparent_max_bounces": "transparent_max_bounces",
    "caustics_reflective": "caustics_reflective",
    "caustics_refractive": "caustics_refractive",
    "blur_glossy": "blur_glossy",
    "clamp_direct": "sample_clamp_direct",
    "clamp_indirect": "sample_clamp_indirect",
    "filter": "pixel_filter_type",
    "filter_width": "filter_width",
}


def _cycles(scene: bpy.types.Scene, name: str, default: Any) -> Any:
    """Return a setting of Cycles, whose add-on may be off."""
    return getattr(getattr(scene, "cycles", None), name, default)


def _property(spec: dict[str, Any]) -> object:
    """Make the Blender property of one row of the settings table."""
    common = {
        "name": spec["label"],
        "description": spec["doc"].rstrip("."),
        "default": spec["default"],
    }
    kind = spec["kind"]
    if kind == "int":
        return bpy.props.IntProperty(**common, min=spec["min"], max=spec["max"])
    if kind == "float":
        return bpy.props.FloatProperty(**common, min=spec["min"], max=spec["max"])
    if kind == "enum":
        return bpy.props.EnumProperty(**common, items=[tuple(item) for item in spec["items"]])
    return bpy.props.BoolProperty(**common)


def _passes_changed(_group: object, context: bpy.types.Context) -> None:
    context.view_layer.update_render_passes()


# bpy 4.2 as a Python module crashes at exit over any update callback, even one taken away before.
# It has no windows, and sockets on screen are all that the callback refreshes.
_ON_SWITCH = _passes_changed if bpy.app.binary_path else None


def _group(name: str, annotations: dict[str, object]) -> type:
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations})


def _scene_group() -> type:
    specs = (spec for spec in core.contract()["settings"] if spec["name"] not in BLENDER_OWN)
    return _group("DualConeSceneSettings", {spec["name"]: _property(spec) for spec in specs})


def _view_layer_group() -> type:
    switches: dict[str, object] = {
        passes.switch_name(p.source): bpy.props.BoolProperty(
            name=p.source, description=p.doc.rstrip("."), update=_ON_SWITCH
        )
        for p in passes.own_passes()
    }
    return _group("DualConeViewLayerSettings", switches)


def settings_of(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return every setting of the renderer by name, as plain values."""
    names = [spec["name"] for spec in core.contract()["settings"]]
    return {
        name: BLENDER_OWN[name](scene) if name in BLENDER_OWN else getattr(*place_of(scene, name))
        for name in names
    }


def place_of(scene: bpy.types.Scene, name: str) -> tuple[Any, str]:
    """Return whose property holds a setting, and that property's name."""
    own = cast(Any, scene).dualcone
    cycles_name = CYCLES_NAMES.get(name)
    if cycles_name and hasattr(scene, "cycles") and not own.is_property_set(name):
        return scene.cycles, cycles_name
    return own, name


_registered: list[tuple[Any, type]] = []


def register() -> None:
    """Add the properties."""
    groups = ((bpy.types.Scene, _scene_group()), (bpy.types.ViewLayer, _view_layer_group()))
    for owner, group in groups:
        bpy.utils.register_class(group)
        cast(Any, owner).dualcone = bpy.props.PointerProperty(type=group)
        _registered.append((owner, group))


def unregister() -> None:
    """Take the properties away again."""
    while _registered:
        owner, group = _registered.pop()
        del owner.dualcone
        bpy.utils.unregister_class(group)
