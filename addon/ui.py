"""Panels in Render Properties and View Layer Properties, and Blender's own panels made to show."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from . import core, denoise, passes
from .engine import DualConeEngine
from .properties import place_of, settings_of

ENGINE = DualConeEngine.bl_idname

# Panels for which Blender asks each engine by name, that show only what DualCone renders.
WELCOME_PANELS = {
    "DATA_PT_EEVEE_light",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
}
# Panels for any engine, that show what DualCone does not render or repeat the type of a light.
UNWELCOME_PANELS = {
    "DATA_PT_light",
    "MATERIAL_PT_freestyle_line",
    "NODE_DATA_PT_light",
    "RENDER_PT_freestyle",
}
UNWELCOME_PREFIXES = ("VIEWLAYER_PT_freestyle", "DATA_PT_lightprobe", "DATA_PT_context_lightprobe")


class RenderPanel:
    """What the panels in Render Properties have in common."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_order = -1  # Above Simplify, which Blender registered first.
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show with DualCone as the engine, unless its compiled part is missing."""
        return context.engine in cls.COMPAT_ENGINES and core.problem() is None


def labelled_rows(panel: bpy.types.Panel) -> bpy.types.UILayout:
    """Return a panel's layout with the labels on the left, as everywhere in Blender."""
    layout: Any = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def draw_warning(layout: bpy.types.UILayout, text: str) -> None:
    """Draw a text of any length below a warning sign."""
    column = layout.column(align=True)
    for row, line in enumerate(textwrap.wrap(text, 48)):
        column.label(text=line, icon="BLANK1" if row else "ERROR")


class DUALCONE_PT_sampling_presets(PresetPanel, bpy.types.Panel):
    """Preview, Animation, Final and the user's own."""

    bl_label = "DualCone Presets"
    preset_subdir = "dualcone"
    preset_operator = "script.execute_preset"
    preset_add_operator = "render.dualcone_preset_add"
    COMPAT_ENGINES = {ENGINE}


class DUALCONE_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Add or remove a DualCone preset."""

    bl_description = "Add or remove a DualCone preset"
    bl_idname = "render.dualcone_preset_add"
    bl_label = "Add DualCone Preset"
    preset_menu = "DUALCONE_PT_sampling_presets"
    preset_subdir = "dualcone"
    preset_defines = ["settings = bpy.context.scene.dualcone"]

    @property
    def preset_values(self) -> list[str]:
        """The settings that the shipped presets hold too."""
        names = (
            "samples",
            "method",
            "block",
            "window",
            "max_bounces",
            "diffuse_bounces",
            "glossy_bounces",
            "transmission_bounces",
            "volume_bounces",
            "transparent_max_bounces",
        )
        return [f"settings.{name}" for name in names]


class DUALCONE_PT_problem(bpy.types.Panel):
    """Why DualCone cannot render."""

    bl_label = "DualCone Cannot Render"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show when the compiled part is missing or another version."""
        return context.engine in cls.COMPAT_ENGINES and core.problem() is not None

    def draw(self, _context: bpy.types.Context) -> None:
        """Show the problem in lines that fit a narrow panel."""
        draw_warning(self.layout, core.problem() or "")


class DUALCONE_PT_sampling(RenderPanel, bpy.types.Panel):
    """How long to look at each pixel."""

    bl_label = "Sampling"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        """Draw the preset button."""
        DUALCONE_PT_sampling_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings."""
        layout = labelled_rows(self)
        settings = context.scene.dualcone
        layout.prop(settings, "samples")
        layout.prop(settings, "noise_threshold")
        layout.prop(settings, "time_limit")
        layout.prop(settings, "denoise")
        problem = denoise.problem() if settings.denoise else None
        if problem is not None:
            draw_warning(layout, problem)
            layout.operator("render.dualcone_denoise_node")
        layout.prop(settings, "seed")


class DUALCONE_PT_reuse(RenderPanel, bpy.types.Panel):
    """What pixels and frames lend each other."""

    bl_label = "Reuse"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings; those without effect on the chosen method are greyed out."""
        layout = labelled_rows(self)
        settings = context.scene.dualcone
        layout.prop(settings, "method")
        own = layout.column()
        own.active = settings.method == "PATH"
        own.prop(settings, "gathers")
        shared = layout.column()
        shared.active = settings.method != "PATH"
        share = shared.column()
        share.active = settings.method == "DUAL_CONE"
        share.prop(settings, "share")
        shared.prop(settings, "block")
        shared.prop(settings, "window")
        recheck = shared.column()
        recheck.active = settings.method == "PAPER"
        recheck.prop(settings, "recheck")
        shared.prop(settings, "still_window")
        shared.prop(settings, "frames_together")


class DUALCONE_PT_light_paths(RenderPanel, bpy.types.Panel):
    """How often light bounces."""

    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings."""
        layout = labelled_rows(self)
        scene, settings = context.scene, context.scene.dualcone
        column = layout.column(align=True)
        for kind in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
            name = f"{kind}_bounces"
            column.prop(*place_of(scene, name), text=settings.bl_rna.properties[name].name)
        column = layout.column(heading="Caustics", align=True)
        column.prop(*place_of(scene, "caustics_reflective"), text="Reflective")
        column.prop(*place_of(scene, "caustics_refractive"), text="Refractive")
        layout.prop(*place_of(scene, "blur_glossy"), text="Filter Glossy")
        column = layout.column(align=True)
        column.prop(*place_of(scene, "clamp_direct"), text="Clamp Direct")
        column.prop(*place_of(scene, "clamp_indirect"), text="Clamp Indirect")


class DUALCONE_PT_film(RenderPanel, bpy.types.Panel):
    """The pixel filter and what is behind the scene."""

    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings."""
        layout = labelled_rows(self)
        scene = context.scene
        if hasattr(scene, "cycles"):
            layout.prop(scene.cycles, "film_exposure", text="Exposure")
        layout.prop(scene.render, "film_transparent", text="Transparent")
        if hasattr(scene, "cycles"):
            glass = layout.column()
            glass.active = scene.render.film_transparent
            glass.prop(scene.cycles, "film_transparent_glass", text="Transparent Glass")
            glass.prop(scene.cycles, "film_transparent_roughness", text="Roughness Threshold")
        layout.prop(*place_of(scene, "filter"), text="Pixel Filter")
        width = layout.column()
        width.active = settings_of(scene)["filter"] != "BOX"
        width.prop(*place_of(scene, "filter_width"), text="Width")


class DUALCONE_PT_motion_blur(RenderPanel, bpy.types.Panel):
    """When the shutter is open: Blender's own settings, which Cycles reads too."""

    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the switch."""
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings."""
        layout = labelled_rows(self)
        render = context.scene.render
        layout.active = render.use_motion_blur
        layout.prop(render, "motion_blur_position", text="Position")
        layout.prop(render, "motion_blur_shutter")


class DUALCONE_PT_motion_blur_curve(RenderPanel, bpy.types.Panel):
    """How the shutter opens and closes."""

    bl_label = "Shutter Curve"
    bl_parent_id = "DUALCONE_PT_motion_blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the curve."""
        render = context.scene.render
        self.layout.active = render.use_motion_blur
        self.layout.template_curve_mapping(render, "motion_blur_shutter_curve")


class DUALCONE_PT_object_motion_blur(bpy.types.Panel):
    """Motion blur of one object or camera. The settings belong to Cycles."""

    bl_label = "Motion Blur"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show for what may be blurred, where Cycles is enabled: otherwise all is blurred."""
        return context.engine in cls.COMPAT_ENGINES and hasattr(context.object, "cycles")

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the object's switch."""
        blurred: Any = context.object
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(blurred.cycles, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the object's settings."""
        layout = labelled_rows(self)
        blurred: Any = context.object
        settings = blurred.cycles
        layout.active = context.scene.render.use_motion_blur and settings.use_motion_blur
        layout.prop(settings, "motion_steps", text="Steps")
        if blurred.type != "CAMERA":
            layout.prop(settings, "use_deform_motion", text="Deformation")


class DUALCONE_PT_performance(RenderPanel, bpy.types.Panel):
    """Threads."""

    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings."""
        layout = labelled_rows(self)
        scene = context.scene
        layout.prop(scene.render, "threads_mode")
        threads = layout.column()
        threads.enabled = scene.render.threads_mode == "FIXED"
        threads.prop(scene.render, "threads")


class PassesPanel(RenderPanel):
    """What the panels below Passes have in common."""

    bl_context = "view_layer"
    bl_parent_id = "DUALCONE_PT_passes"

    def draw_switches(
        self,
        layout: bpy.types.UILayout,
        view_layer: Any,
        heading: str,
        sources: Iterable[str],
        *,
        is_short: bool = False,
    ) -> None:
        """Draw a switch for each pass; short ones go by the last word of their name."""
        column = layout.column(heading=heading, align=True)
        for source in sources:
            owner, switch = passes.switch(view_layer, source)
            column.prop(owner, switch, text=source.split()[-1] if is_short else source)


class DUALCONE_PT_passes(RenderPanel, bpy.types.Panel):
    """Which passes a view layer delivers."""

    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, _context: bpy.types.Context) -> None:
        """Leave it to the panels below."""


class DUALCONE_PT_passes_data(PassesPanel, bpy.types.Panel):
    """Passes of what the camera sees, whatever light falls on it."""

    bl_label = "Data"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the switches: those that Cycles has too, then DualCone's own."""
        layout = labelled_rows(self)
        known = [p.source for p in passes.all_passes() if p.source in passes.BLENDER_SWITCH]
        data = [source for source in known if source not in passes.LIGHT]
        self.draw_switches(layout, context.view_layer, "Include", data)
        own = [p.source for p in passes.own_passes() if p.source not in passes.LIGHT]
        self.draw_switches(layout, context.view_layer, "DualCone", own)
        layout.prop(context.view_layer, "pass_alpha_threshold", text="Alpha Threshold")


class DUALCONE_PT_passes_light(PassesPanel, bpy.types.Panel):
    """Passes of light that add up to the picture, as Cycles divides it."""

    bl_label = "Light"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the switches."""
        layout = labelled_rows(self)
        for part, sources in passes.SCATTERED_LIGHT.items():
            self.draw_switches(layout, context.view_layer, part, sources, is_short=True)
        self.draw_switches(layout, context.view_layer, "Other", passes.OTHER_LIGHT)


class DUALCONE_PT_passes_cryptomatte(PassesPanel, bpy.types.Panel):
    """Masks of things by their names."""

    bl_label = "Cryptomatte"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's own switches."""
        layout = labelled_rows(self)
        view_layer: Any = context.view_layer
        column = layout.column(heading="Include", align=True)
        for source, switch in passes.CRYPTOMATTE.items():
            column.prop(view_layer, switch, text=source.removeprefix("Crypto"))
        levels = layout.column()
        levels.active = any(getattr(view_layer, name) for name in passes.CRYPTOMATTE.values())
        levels.prop(view_layer, "pass_cryptomatte_depth", text="Levels")


class DUALCONE_PT_passes_aov(PassesPanel, bpy.types.Panel):
    """Passes that AOV Output nodes fill."""

    bl_label = "Shader AOV"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's own list."""
        layout = labelled_rows(self)
        layer: Any = context.view_layer
        row = layout.row()
        row.column().template_list(
            "VIEWLAYER_UL_aov", "aovs", layer, "aovs", layer, "active_aov_index", rows=2
        )
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_aov", icon="ADD", text="")
        buttons.operator("scene.view_layer_remove_aov", icon="REMOVE", text="")
        if layer.active_aov and not layer.active_aov.is_valid:
            layout.label(text="Conflicts with another pass of this name", icon="ERROR")


class DUALCONE_PT_passes_lightgroups(PassesPanel, bpy.types.Panel):
    """Passes of light groups."""

    bl_label = "Light Groups"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's own list."""
        row = labelled_rows(self).row()
        layer: Any = context.view_layer
        names = ("lightgroups", layer, "active_lightgroup_index")
        row.column().template_list("UI_UL_list", "lightgroups", layer, *names, rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        buttons.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")
        buttons.menu("VIEWLAYER_MT_lightgroup_sync", icon="DOWNARROW_HLT", text="")


class LightGroupPanel:
    """The light group of what gives off light."""

    bl_label = "Light Group"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show with DualCone as the engine."""
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the choice among the view layer's groups."""
        owner: Any = getattr(context, self.bl_context)
        row = labelled_rows(self).row()
        row.prop_search(owner, "lightgroup", context.view_layer, "lightgroups", text="Light Group")


class DUALCONE_PT_object_lightgroup(LightGroupPanel, bpy.types.Panel):
    """Light group of a lamp or glowing thing."""

    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}


class DUALCONE_PT_world_lightgroup(LightGroupPanel, bpy.types.Panel):
    """Light group of the world."""

    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}


CLASSES = (
    DUALCONE_OT_preset_add,
    DUALCONE_PT_sampling_presets,
    DUALCONE_PT_problem,
    DUALCONE_PT_sampling,
    DUALCONE_PT_reuse,
    DUALCONE_PT_light_paths,
    DUALCONE_PT_film,
    DUALCONE_PT_motion_blur,
    DUALCONE_PT_motion_blur_curve,
    DUALCONE_PT_object_motion_blur,
    DUALCONE_PT_performance,
    DUALCONE_PT_passes,
    DUALCONE_PT_passes_data,
    DUALCONE_PT_passes_light,
    DUALCONE_PT_passes_cryptomatte,
    DUALCONE_PT_passes_aov,
    DUALCONE_PT_passes_lightgroups,
    DUALCONE_PT_object_lightgroup,
    DUALCONE_PT_world_lightgroup,
)


def is_shown(name: str, engines: set[str]) -> bool:
    """Whether one of Blender's own panels shall appear with DualCone."""
    if name in UNWELCOME_PANELS or name.startswith(UNWELCOME_PREFIXES):
        return False
    return name in WELCOME_PANELS or "BLENDER_RENDER" in engines


_joined: list[set[str]] = []


def register() -> None:
    """Add the panels and join Blender's own."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if isinstance(engines, set) and ENGINE not in engines and is_shown(panel.__name__, engines):
            engines.add(ENGINE)
            _joined.append(engines)


def unregister() -> None:
    """Leave Blender's panels as they were found."""
    while _joined:
        _joined.pop().discard(ENGINE)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
