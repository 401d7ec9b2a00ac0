"""Reads the inputs of one material's shader nodes: constants, images, and what is left out."""

from __future__ import annotations

from dataclasses import replace

from .image import EXTENSIONS, ImageTable, ImageUse
from .nodes import Color, Constant, Input, Source
from .report import Warnings


class MaterialReader:
    """The inputs of one material. Whatever the renderer leaves out becomes a warning."""

    def __init__(self, name: str, images: ImageTable, warnings: Warnings) -> None:
        self.name = name
        self.images = images
        self.warnings = warnings
        # UV maps that the material asks for by name.
        self.uv_maps: set[str] = set()

    def number(self, node: Source, identifier: str) -> float:
        """A constant; of a texture its average, with a warning."""
        end = _end(node, identifier)
        if isinstance(end, Constant):
            return end.number()
        use = self._image_use(end)
        if use is None:
            self._missing_source(node, identifier, end, "default value")
            return _own_value(node, identifier).number()
        self._missing_source(node, identifier, end, "average")
        return self.images.mean(replace(use, channel=_one_channel(use)))[0]

    def color(self, node: Source, identifier: str) -> Color:
        """A constant colour; of a texture its average, with a warning."""
        end = _end(node, identifier)
        if isinstance(end, Constant):
            return end.color()
        use = self._image_use(end)
        if use is None:
            self._missing_source(node, identifier, end, "default value")
            return _own_value(node, identifier).color()
        self._missing_source(node, identifier, end, "average")
        return self.images.mean(use)[:3]

    def textured_color(self, node: Source, identifier: str) -> tuple[Color, int]:
        """A colour, and the row of the image that replaces it or -1."""
        use = self._image_at(node, identifier)
        if use is None:
            return self.color(node, identifier), -1
        return _own_value(node, identifier).color(), self.images.index(use)

    def textured_number(self, node: Source, identifier: str) -> tuple[float, int]:
        """A number, and the row of the image whose channels all hold what replaces it, or -1."""
        use = self._image_at(node, identifier)
        if use is None:
            return self.number(node, identifier), -1
        use = replace(use, channel=_one_channel(use))
        return _own_value(node, identifier).number(), self.images.index(use)

    def textured_alpha(self, node: Source, identifier: str) -> tuple[float, int]:
        """As `textured_number`; the renderer reads the image's alpha channel.

        An image that lends its alpha here and its colour elsewhere is handed over once.
        """
        use = self._image_at(node, identifier)
        if use is None:
            return self.number(node, identifier), -1
        channel = "COLOR" if use.channel == "ALPHA" else _one_channel(use)
        return 1.0, self.images.index(replace(use, channel=channel))

    def missing(self, what: str, instead: str = "") -> None:
        """Warn that `what` is left out, and say what is shown in its place."""
        suffix = f" ({instead})" if instead else ""
        self.warnings.add(self.name, f"{what} is not rendered yet{suffix}")

    def missing_unless(self, node: Source, identifier: str, neutral: float, what: str) -> None:
        """Warn if an input holds anything but the value at which it does nothing."""
        socket = node.input(identifier)
        if socket is None:
            return
        end = socket.follow()
        if isinstance(end, Source) or any(value != neutral for value in end.color()):
            self.missing(what)

    def missing_normal(self, node: Source) -> None:
        """Warn of whatever bends the normal."""
        socket = node.input("Normal")
        end = socket and socket.follow()
        if isinstance(end, Source):
            self.missing(end.label)

    def _image_at(self, node: Source, identifier: str) -> ImageUse | None:
        end = _end(node, identifier)
        return self._image_use(end) if isinstance(end, Source) else None

    def _missing_source(self, node: Source, identifier: str, end: Source, instead: str) -> None:
        name = _socket(node, identifier).socket.name
        self.missing(f"{end.label} in {name}", f"its {instead} is used")

    def _image_use(self, source: Source) -> ImageUse | None:
        """The image that an output passes on, if it is one."""
        channel = "COLOR"
        if source.node.bl_idname == "ShaderNodeSeparateColor" and source.node.mode == "RGB":
            channel = source.output.identifier.upper()
            end = _end(source, "Color")
            if not isinstance(end, Source):
                return None
            source = end
        node = source.node
        if node.bl_idname != "ShaderNodeTexImage" or node.image is None:
            return None
        if source.output.identifier == "Alpha":
            channel = "ALPHA"
        self._check_texture(source)
        return ImageUse(
            node.image,
            node.extension if node.extension in EXTENSIONS else "REPEAT",
            "Closest" if node.interpolation == "Closest" else "Linear",
            channel,
            multiply_alpha=not node.outputs["Alpha"].is_linked,
        )

    def _check_texture(self, source: Source) -> None:
        node = source.node
        of_image = f"of '{node.image.name}'"
        if node.projection != "FLAT":
            self.missing(f"{node.projection.title()} projection {of_image}")
        if node.extension not in EXTENSIONS:
            self.missing(f"{node.extension.title()} extension {of_image}")
        if node.interpolation not in ("Linear", "Closest"):
            self.missing(f"{node.interpolation} interpolation {of_image}", "Linear is used")
        end = _end(source, "Vector")
        if not isinstance(end, Source):
            return
        kind, output = end.node.bl_idname, end.output.identifier
        if kind == "ShaderNodeUVMap" and not end.node.from_instancer:
            self.uv_maps |= {end.node.uv_map} - {""}
        elif (kind, output) != ("ShaderNodeTexCoord", "UV"):
            what = f"{output} coordinate" if kind == "ShaderNodeTexCoord" else end.label
            self.missing(f"{what} {of_image}", "the active UV map is used")


def _one_channel(use: ImageUse) -> str:
    return "GREY" if use.channel == "COLOR" else use.channel


def _socket(node: Source, identifier: str) -> Input:
    socket = node.input(identifier)
    if socket is None:
        raise KeyError(f"{node.node.bl_idname} has no input '{identifier}'")
    return socket


def _end(node: Source, identifier: str) -> Source | Constant:
    return _socket(node, identifier).follow()


def _own_value(node: Source, identifier: str) -> Constant:
    """The value in the input's own field, which a link hides."""
    return Constant(_socket(node, identifier).socket)
