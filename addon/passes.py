"""The render passes: one list for those who register them, show them and fill them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, cast

import bpy
import numpy as np

from . import core

# Passes that Blender already has a switch for; the others get one at `view_layer.dualcone`.
BLENDER_SWITCH = {
    "Depth": "use_pass_z",
    "Mist": "use_pass_mist",
    "Position": "use_pass_position",
    "Normal": "use_pass_normal",
    "Vector": "use_pass_vector",
    "UV": "use_pass_uv",
    "Object Index": "use_pass_object_index",
    "Material Index": "use_pass_material_index",
    "Diffuse Direct": "use_pass_diffuse_direct",
    "Diffuse Indirect": "use_pass_diffuse_indirect",
    "Diffuse Color": "use_pass_diffuse_color",
    "Glossy Direct": "use_pass_glossy_direct",
    "Glossy Indirect": "use_pass_glossy_indirect",
    "Glossy Color": "use_pass_glossy_color",
    "Transmission Direct": "use_pass_transmission_direct",
    "Transmission Indirect": "use_pass_transmission_indirect",
    "Transmission Color": "use_pass_transmission_color",
    "Emission": "use_pass_emit",
    "Environment": "use_pass_environment",
}
# What Blender called passes before version 5, where that was another name: files and the sockets of
# its compositor go by these.
NAMES_BEFORE_5 = {
    "Object Index": "IndexOB",
    "Material Index": "IndexMA",
    "Diffuse Direct": "DiffDir",
    "Diffuse Indirect": "DiffInd",
    "Diffuse Color": "DiffCol",
    "Glossy Direct": "GlossDir",
    "Glossy Indirect": "GlossInd",
    "Glossy Color": "GlossCol",
    "Transmission Direct": "TransDir",
    "Transmission Indirect": "TransInd",
    "Transmission Color": "TransCol",
    "Emission": "Emit",
    "Environment": "Env",
}
# Passes of light: of what surfaces scatter, and of what is seen where it comes from.
SCATTERED_LIGHT = tuple(
    f"{part} {way}"
    for part in ("Diffuse", "Glossy", "Transmission")
    for way in ("Direct", "Indirect", "Color")
)
OTHER_LIGHT = ("Emission", "Environment")
LIGHT = (*SCATTERED_LIGHT, *OTHER_LIGHT)
# Methods that tell the parts of scattered light apart.
DIVIDING_METHODS = ("DUAL_CONE", "PATH")
# What the denoiser reads.
GUIDES = ("Albedo", "Normal")


class Pass(NamedTuple):
    """A pass as Blender wants it registered."""

    # As the contract has it.
    source: str
    # As this version of Blender has it.
    name: str
    channels: str
    kind: str
    doc: str
    # Whether the exposure of the film scales it.
    is_light: bool
    # What each pixel takes for it beside what it takes in any case.
    extra_bytes: int


def switch_name(name: str) -> str:
    """Name the property of `view_layer.dualcone` that enables a pass."""
    return "use_pass_" + name.lower().replace(" ", "_")


def all_passes() -> Iterator[Pass]:
    """List every pass the renderer can make."""
    renamed = NAMES_BEFORE_5 if bpy.app.version < (5, 0, 0) else {}
    for spec in core.contract()["passes"]:
        source = spec["name"]
        yield Pass(
            source,
            renamed.get(source, source),
            spec["channels"],
            spec["type"],
            spec["doc"],
            spec["is_light"],
            spec["extra_bytes"],
        )


def own_passes() -> Iterator[Pass]:
    """List the passes that Blender has no switch for."""
    return (p for p in all_passes() if p.source not in BLENDER_SWITCH and p.source != "Combined")


def switch(view_layer: bpy.types.ViewLayer, source: str) -> tuple[Any, str]:
    """Return what holds the switch of a pass of the contract, and the switch's name."""
    if source in BLENDER_SWITCH:
        return view_layer, BLENDER_SWITCH[source]
    return cast(Any, view_layer).dualcone, switch_name(source)


def is_enabled(view_layer: bpy.types.ViewLayer, source: str) -> bool:
    """Tell whether a view layer asks for a pass of the contract."""
    return source == "Combined" or getattr(*switch(view_layer, source))


def problems(view_layer: bpy.types.ViewLayer, method: str) -> Iterator[str]:
    """Name the passes that a view layer asks for and will not get."""
    asked = [p.name for p in enabled_passes(view_layer) if p.source in SCATTERED_LIGHT]
    asked = [name for name in asked if not name.endswith(("Color", "Col"))]
    if asked and method not in DIVIDING_METHODS:
        names = ", ".join(asked)
        yield f"{names}: only Dual Cone and Path Tracing make these passes, they are black"


def enabled_passes(view_layer: bpy.types.ViewLayer) -> Iterator[Pass]:
    """List the passes that a view layer asks for."""
    return (p for p in all_passes() if is_enabled(view_layer, p.source))


def wanted(view_layer: bpy.types.ViewLayer, is_denoised: bool) -> Iterator[str]:
    """Name what to render for a view layer, as the contract does; a denoiser needs guides."""
    sources = [p.source for p in enabled_passes(view_layer)]
    yield from sources
    if is_denoised:
        yield from (guide for guide in GUIDES if guide not in sources)


def bytes_per_pixel(view_layer: bpy.types.ViewLayer) -> int:
    """Return what each pixel takes for passes beside what it takes in any case."""
    return sum(p.extra_bytes for p in enabled_passes(view_layer))


class Canvas:
    """The frame's render result in Blender: opened when there is something to put into it."""

    def __init__(
        self,
        engine: bpy.types.RenderEngine,
        view_layer: str,
        shape: tuple[int, int],
        exposure: float = 1.0,
    ) -> None:
        self._engine = engine
        self._view_layer = view_layer
        self._shape = shape
        self._exposure = np.array([exposure, exposure, exposure, 1.0], np.float32)
        self._passes = {p.name: p for p in all_passes()}
        self._result: bpy.types.RenderResult | None = None

    def _opened(self) -> bpy.types.RenderResult:
        if self._result is None:
            rows, columns = self._shape
            # The position is the tile's within the border; there is one tile.
            self._result = self._engine.begin_result(0, 0, columns, rows, layer=self._view_layer)
        return self._result

    def write(self, pixels: Mapping[str, np.ndarray]) -> None:
        """Copy arrays (H, W, channels), rows from the bottom up, into the passes of Blender.

        They go by the names of the contract. With stereo every view has a pass of each name, and
        all get the same picture.

        Raises:
            ValueError: an array does not fit what Blender allocated.
        """
        result = self._opened()
        for target in result.layers[0].passes:
            known = self._passes.get(target.name)
            source = pixels.get(known.source) if known else None
            if known is None or source is None:
                continue
            wanted = (result.resolution_y, result.resolution_x, target.channels)
            if source.shape != wanted:
                raise ValueError(f"pass {target.name}: expected shape {wanted}, got {source.shape}")
            if known.is_light:
                source = source * self._exposure[: target.channels]
            rect: Any = target.rect  # An array property; the stubs call it a float.
            rect.foreach_set(np.ascontiguousarray(source, np.float32).ravel())

    def preview(self, combined: np.ndarray) -> None:
        """Show an unfinished picture."""
        self.write({"Combined": combined})
        self._engine.update_result(self._opened())

    def stamp(self, fields: Mapping[str, str]) -> None:
        """Add fields to the file's metadata, under names that tell view layers apart.

        They belong to the frame's own result: those of an opened one are lost when it is merged.
        """
        result = self._engine.get_result()
        for name, value in fields.items():
            result.stamp_data_add_field(f"dualcone.{self._view_layer}.{name}", value)

    def close(self, *, cancel: bool) -> None:
        """Give the result back to Blender; a cancelled one stays on screen but is no frame."""
        if self._result is not None:
            result, self._result = self._result, None
            self._engine.end_result(result, cancel=cancel, do_merge_results=cancel)
