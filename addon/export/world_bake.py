"""Worlds of any nodes as equirectangular images, rendered by Cycles in a Blender of its own.

Blender renders no second picture while it renders, so another process does it: it opens a file that
holds the world alone, renders it with a panoramic camera and leaves the pixels in an array. That
takes seconds, so what was baked is kept for as long as the world stays the same.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .report import ExportStopped, Warnings

# A sun of half a degree covers a pixel and a half.
WIDTH = 1024
SECONDS_MAX = 120.0
POLL_SECONDS = 0.05
KEPT = 8

_baked: dict[bytes, Baked] = {}


@dataclass(frozen=True)
class Baked:
    """Radiance of the world as it lights, and as the camera sees it where that differs."""

    light: np.ndarray  # (H, W, 4)
    camera: np.ndarray | None


def bake(
    world: bpy.types.World, frame: float, warnings: Warnings, should_stop: Callable[[], bool]
) -> Baked | None:
    """The image of an evaluated world; None, with a warning, where that fails."""
    key = content_of(world)
    if key not in _baked:
        try:
            baked = _bake(world, frame, should_stop)
        except (OSError, subprocess.SubprocessError, ValueError) as error:
            warnings.add(world.name, f"its nodes could not be baked and it is left black ({error})")
            return None
        while len(_baked) >= KEPT:
            _baked.pop(next(iter(_baked)))
        _baked[key] = baked
    return _baked[key]


def _bake(world: bpy.types.World, frame: float, should_stop: Callable[[], bool]) -> Baked:
    with tempfile.TemporaryDirectory(prefix="dualcone-") as name:
        folder = Path(name)
        bpy.data.libraries.write(str(folder / "world.blend"), {world.original}, fake_user=True)
        arguments = [name, world.original.name, str(frame), str(WIDTH)]
        with open(folder / "log.txt", "w", encoding="utf-8") as log:
            process = subprocess.Popen(
                [
                    *_blender(),
                    str(Path(__file__).with_name("world_bake_child.py")),
                    "--",
                    *arguments,
                ],
                stdout=log,
                stderr=subprocess.STDOUT,
            )
            _wait(process, should_stop)
        light = folder / "light.npy"
        if not light.exists():
            lines = (folder / "log.txt").read_text(encoding="utf-8", errors="replace").splitlines()
            raise ValueError(lines[-1] if lines else f"exit code {process.returncode}")
        camera = folder / "camera.npy"
        return Baked(np.load(light), np.load(camera) if camera.exists() else None)


def _blender() -> list[str]:
    """The command that runs a script in a Blender like this one."""
    if bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--factory-startup", "--python"]
    return [sys.executable]  # Blender is a module of Python's.


def _wait(process: subprocess.Popen, should_stop: Callable[[], bool]) -> None:
    deadline = time.monotonic() + SECONDS_MAX
    try:
        while process.poll() is None:
            if should_stop():
                raise ExportStopped
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(process.args, SECONDS_MAX)
            time.sleep(POLL_SECONDS)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def content_of(world: bpy.types.World) -> bytes:
    """Hash of everything in an evaluated world's nodes, images and groups included."""
    content = hashlib.blake2b(digest_size=16)
    for text in _tree_content(world.node_tree, set()):
        content.update(text.encode())
    return content.digest()


def _tree_content(tree: Any, seen: set[str]) -> Iterator[str]:
    if tree is None or tree.name_full in seen:
        return
    seen.add(tree.name_full)
    for node in tree.nodes:
        yield f"{node.name} {node.bl_idname} {_values(node)}"
        for socket in node.inputs:
            yield f"{socket.identifier} {_value(getattr(socket, 'default_value', None))}"
        for socket in node.outputs:
            yield f"{socket.identifier} {_value(getattr(socket, 'default_value', None))}"
        yield from _tree_content(getattr(node, "node_tree", None), seen)
    for link in tree.links:
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name)
        yield f"{ends} {link.to_socket.identifier} {link.is_muted}"


# Where a node stands and how it is drawn.
LOOKS = {"location", "location_absolute", "width", "height", "select", "dimensions", "color"}


def _values(node: Any) -> list[str]:
    names = [p.identifier for p in node.bl_rna.properties if p.identifier not in LOOKS]
    return [f"{name}={_value(getattr(node, name))}" for name in names]


def _value(value: Any) -> str:
    """A property as text; of things with properties of their own those that matter here."""
    if isinstance(value, bpy.types.Image):
        return (
            f"{value.name_full} {value.filepath} {value.colorspace_settings.name} {value.size[:]}"
        )
    if isinstance(value, bpy.types.ID):
        return value.name_full
    if isinstance(value, bpy.types.ColorRamp):
        stops = [(e.position, e.color[:]) for e in value.elements]
        return f"{value.color_mode} {value.interpolation} {stops}"
    if isinstance(value, bpy.types.CurveMapping):
        return str([[p.location[:] for p in curve.points] for curve in value.curves])
    if isinstance(value, (bool, int, float, str)):
        return str(value)
    return str(value[:]) if hasattr(value, "__getitem__") else ""


def depends_on_ray(tree: Any, seen: set[str] | None = None) -> bool:
    """Whether a Light Path node is anywhere in a tree: the camera may see another world."""
    seen = set() if seen is None else seen
    if tree is None or tree.name_full in seen:
        return False
    seen.add(tree.name_full)
    return any(
        node.bl_idname == "ShaderNodeLightPath"
        or depends_on_ray(getattr(node, "node_tree", None), seen)
        for node in tree.nodes
    )
