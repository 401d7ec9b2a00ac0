"""The render passes: one list for those who register them, show them and fill them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, NamedTuple, cast

import bpy
import numpy as np

from . import core
from .export.linking import GROUPS_MAX, light_groups
from .export.matte import murmur3
from .export.shader.layers import output_key

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
    "Ambient Occlusion": "use_pass_ambient_occlusion",
}
# Passes with a switch of Cycles, which counts too: files that were made for it have it set.
CYCLES_LIGHT_SWITCH = {
    "Volume Direct": "use_pass_volume_direct",
    "Volume Indirect": "use_pass_volume_indirect",
    "Shadow Catcher": "use_pass_shadow_catcher",
}
CYCLES_SWITCH = {
    **CYCLES_LIGHT_SWITCH,
    **dict.fromkeys(
        ("Denoising Normal", "Denoising Albedo", "Denoising Depth"), "denoising_store_passes"
    ),
}
# Blender's switches for rows of the contract of which there are several passes.
CRYPTOMATTE = {
    "CryptoObject": "use_pass_cryptomatte_object",
    "CryptoMaterial": "use_pass_cryptomatte_material",
    "CryptoAsset": "use_pass_cryptomatte_asset",
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
    "Volume Direct": "VolumeDir",
    "Volume Indirect": "VolumeInd",
    "Ambient Occlusion": "AO",
}
# Passes of light: of what surfaces scatter, and of what is seen where it comes from.
PARTS = ("Diffuse", "Glossy", "Transmission")
SCATTERED_LIGHT = {
    part: tuple(f"{part} {way}" for way in ("Direct", "Indirect", "Color")) for part in PARTS
}
OTHER_LIGHT = ("Emission", "Environment", "Ambient Occlusion", *CYCLES_LIGHT_SWITCH)
LIGHT = frozenset((*chain(*SCATTERED_LIGHT.values()), *OTHER_LIGHT))
# Methods that tell the parts of scattered light apart, and the passes that need it.
DIVIDING_METHODS = ("DUAL_CONE", "PATH")
DIVIDED = (
    *(f"{part} {way}" for part in PARTS for way in ("Direct", "Indirect")),
    *("Volume Direct", "Volume Indirect"),
)
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
    blenders = {"Combined", *BLENDER_SWITCH, *KEYS}
    return (p for p in all_passes() if p.source not in blenders)


def switch(view_layer: bpy.types.ViewLayer, source: str) -> tuple[Any, str]:
    """Return what holds the switch of a pass of the contract, and the switch's name."""
    if source in BLENDER_SWITCH:
        return view_layer, BLENDER_SWITCH[source]
    return cast(Any, view_layer).dualcone, switch_name(source)


def is_enabled(view_layer: bpy.types.ViewLayer, source: str) -> bool:
    """Tell whether a view layer asks for a pass of the contract."""
    if source == "Combined" or source in KEYS:
        return True
    cycles = getattr(view_layer, "cycles", None)
    wants_cycles = getattr(cycles, CYCLES_SWITCH.get(source, ""), False)
    return wants_cycles or getattr(*switch(view_layer, source))


def missing(view_layer: bpy.types.ViewLayer) -> Iterator[str]:
    """Name the passes that a view layer asks for and that are not rendered yet."""
    yield from (f"Combined_{group.name}" for group in list(view_layer.lightgroups)[GROUPS_MAX:])


def problems(view_layer: bpy.types.ViewLayer, method: str) -> Iterator[str]:
    """Tell of the passes that a view layer asks for and will not get."""
    if lost := ", ".join(missing(view_layer)):
        yield f"Not rendered yet of the passes of '{view_layer.name}': {lost}"
    divided = ", ".join(p.name for p in enabled_passes(view_layer) if p.source in DIVIDED)
    if divided and method not in DIVIDING_METHODS:
        yield f"{divided}: only Dual Cone and Path Tracing make these passes, they are black"


def enabled_passes(view_layer: bpy.types.ViewLayer) -> Iterator[Pass]:
    """List the passes that a view layer asks for: of some rows of the contract several."""
    for render_pass in all_passes():
        if not is_enabled(view_layer, render_pass.source):
            continue
        if render_pass.source not in KEYS:
            yield render_pass
            continue
        for key, name in KEYS[render_pass.source](view_layer, render_pass.source):
            yield render_pass._replace(source=f"{render_pass.source}.{key}", name=name)


def _levels(view_layer: Any, source: str) -> Iterator[tuple[str, str]]:
    """Cryptomatte keeps two names in each pass."""
    if getattr(view_layer, CRYPTOMATTE[source]):
        for level in range((min(16, view_layer.pass_cryptomatte_depth) + 1) // 2):
            yield f"{level:02}", f"{source}{level:02}"


def _outputs(view_layer: Any, source: str) -> Iterator[tuple[str, str]]:
    """The user's own passes, filled by nodes."""
    for output in view_layer.aovs:
        if output.is_valid and source == f"AOV {output.type.title()}":
            yield str(output_key(output.name)), output.name


def _groups(view_layer: Any, _: str) -> Iterator[tuple[str, str]]:
    """The light groups, called as Cycles calls them."""
    for name, number in light_groups(view_layer).items():
        yield str(number), f"Combined_{name}"


# Rows of the contract of which a view layer may ask for several passes: their keys, and how Blender
# calls them.
KEYS = {
    **dict.fromkeys(CRYPTOMATTE, _levels),
    "AOV Color": _outputs,
    "AOV Value": _outputs,
    "Light Group": _groups,
}


def wanted(view_layer: bpy.types.ViewLayer, is_denoised: bool) -> Iterator[str]:
    """Name what to render for a view layer, as the contract does; a denoiser needs guides."""
    sources = [p.source for p in enabled_passes(view_layer)]
    yield from sources
    if is_denoised:
        yield from (guide for guide in GUIDES if guide not in sources)


def exported(sources: Iterable[str], *, is_target: bool) -> list[str]:
    """Name the passes that matter to the export of a frame.

    Frames that only lend make none; but what materials send to passes is compiled with them, once
    for all frames.
    """
    return [source for source in sources if is_target or source.startswith("AOV")]


def bytes_per_pixel(view_layer: bpy.types.ViewLayer) -> int:
    """Return what each pixel takes for passes beside what it takes in any case."""
    return sum(p.extra_bytes for p in enabled_passes(view_layer))


class Canvas:
    """The frame's render result in Blender: opened when there is something to put into it."""

    def __init__(
        self,
        engine: bpy.types.RenderEngine,
        view_layer: bpy.types.ViewLayer,
        shape: tuple[int, int],
        exposure: float = 1.0,
    ) -> None:
        self._engine = engine
        self._view_layer = view_layer.name
        self._shape = shape
        self._exposure = np.array([exposure, exposure, exposure, 1.0], np.float32)
        self._passes = {p.name: p for p in enabled_passes(view_layer)}
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
        """Add fields to the file's metadata, under names that tell view layers apart."""
        self._stamp(
            {f"dualcone.{self._view_layer}.{name}": value for name, value in fields.items()}
        )

    def stamp_manifests(self, manifests: Mapping[str, Mapping[str, str]]) -> None:
        """Add what Cryptomatte wants to know: the names behind its numbers, by pass."""
        kinds = {p.source.partition(".")[0] for p in self._passes.values()}
        for kind in sorted(kinds & manifests.keys()):
            layer = f"{self._view_layer}.{kind}"
            prefix = f"cryptomatte/{murmur3(layer.encode()):08x}"[:-1]
            manifest = json.dumps(manifests[kind], separators=(",", ":"), ensure_ascii=False)
            self._stamp(
                {
                    f"{prefix}/name": layer,
                    f"{prefix}/hash": "MurmurHash3_32",
                    f"{prefix}/conversion": "uint32_to_float32",
                    f"{prefix}/manifest": manifest,
                }
            )

    def _stamp(self, fields: Mapping[str, str]) -> None:
        # They belong to the frame's own result: those of an opened one are lost when it is merged.
        result = self._engine.get_result()
        for name, value in fields.items():
            result.stamp_data_add_field(name, value)

    def close(self, *, cancel: bool) -> None:
        """Give the result back to Blender; a cancelled one stays on screen but is no frame."""
        if self._result is not None:
            result, self._result = self._result, None
            self._engine.end_result(result, cancel=cancel, do_merge_results=cancel)
