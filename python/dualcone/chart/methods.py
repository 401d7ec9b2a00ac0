"""The curves of the chart: one line each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Engine = Literal["DUALCONE", "CYCLES"]


@dataclass(frozen=True)
class Method:
    """One curve.

    A budget counts samples of plain path tracing. `cost` says how many of them one sample of this
    method is worth, roughly: it only places the points, for both axes of a plot are measured.
    """

    name: str
    label: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    engine: Engine = "DUALCONE"
    is_denoised: bool = False
    is_plain: bool = False
    cost: int = 1

    def samples(self, budget: int) -> int:
        """Return the samples per pixel to ask for."""
        return max(1, budget // self.cost)


def _split(gathers: int) -> Method:
    settings = {"method": "PATH", "gathers": gathers}
    label = f"path tracing, {gathers} gathers"
    return Method(f"path-split-{gathers}", label, settings, is_plain=True, cost=gathers)


def _paper(recheck: str, window: int, words: str) -> Method:
    name = f"paper-{recheck.lower()}-{words}"
    settings = {"method": "PAPER", "recheck": recheck, "window": window}
    return Method(name, f"paper, {words}-frame, recheck {recheck.lower()}", settings)


METHODS = (
    Method("path", "path tracing", {"method": "PATH"}, is_plain=True),
    _split(2),
    _split(4),
    _split(8),
    Method("dual_cone", "Dual Cone", {"method": "DUAL_CONE"}),
    Method("dual_cone-intra", "Dual Cone, one frame", {"method": "DUAL_CONE", "window": 1}),
    Method(
        "dual_cone-frames", "Dual Cone, frames only", {"method": "DUAL_CONE", "share": "FRAMES"}
    ),
    *(_paper(recheck, 1, "intra") for recheck in ("NONE", "LIT", "ALL")),
    *(_paper(recheck, 3, "inter") for recheck in ("NONE", "LIT", "ALL")),
    Method("bilateral", "bilateral filter", {"method": "BILATERAL"}),
    Method("irradiance_cache", "irradiance cache", {"method": "IRRADIANCE_CACHE"}),
    Method("cycles", "Cycles", engine="CYCLES"),
    Method("cycles-oidn", "Cycles + OIDN", engine="CYCLES", is_denoised=True),
    Method("path-oidn", "path tracing + OIDN", {"method": "PATH"}, is_denoised=True),
    Method(
        "dual_cone-oidn",
        "Dual Cone + OIDN",
        {"method": "DUAL_CONE", "share": "FRAMES"},
        is_denoised=True,
    ),
    Method(
        "dual_cone-all-oidn",
        "Dual Cone, pixels and frames, + OIDN",
        {"method": "DUAL_CONE", "share": "ALL"},
        is_denoised=True,
    ),
)
BY_NAME = {method.name: method for method in METHODS}
PLAIN = tuple(method.name for method in METHODS if method.is_plain)


def chosen(names: Iterable[str]) -> list[Method]:
    """Return methods by name; `all` stands for every one.

    Raises:
        ValueError: there is no method of a name.
    """
    found: dict[str, Method] = {}
    for name in names:
        if name != "all" and name not in BY_NAME:
            raise ValueError(f"no method {name!r}; there are: all, {', '.join(BY_NAME)}")
        found |= BY_NAME if name == "all" else {name: BY_NAME[name]}
    return list(found.values())


def missing_setting(method: Method, contract: Mapping[str, Any]) -> str | None:
    """Name the setting or the word that this build of the renderer does not have."""
    specs = {spec["name"]: spec for spec in contract["settings"]}
    for name, value in method.settings.items():
        if name not in specs:
            return name
        words = [item[0] for item in specs[name].get("items", ())]
        if words and value not in words:
            return str(value)
    return None
