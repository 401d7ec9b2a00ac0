"""A flame graph: who called whom, as wide as it took. After Gregg, "The Flame Graph", CACM 2016."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape

WIDTH, ROW, LETTER = 1200, 17, 6.6  # pixels
LEAST_WIDTH = 1.0  # pixels: what is narrower is left out, with all above


@dataclass
class Node:
    """A function, called along one way."""

    count: int = 0
    calls: dict[str, Node] = field(default_factory=dict)

    def add(self, stack: tuple[str, ...], count: int) -> None:
        """Count a stack that begins here."""
        self.count += count
        if stack:
            self.calls.setdefault(stack[0], Node()).add(stack[1:], count)


def drawn(stacks: Mapping[tuple[str, ...], int], title: str) -> str:
    """Return an SVG of counted stacks, each from its outermost call."""
    root = Node()
    for stack, count in stacks.items():
        root.add(stack, count)
    boxes = list(_boxes(root, 0.0, 0, WIDTH / root.count))
    height = (max(level for level, *_ in boxes) + 2) * ROW
    rows = [_box(height, root.count, *box) for box in boxes]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}"'
        ' font-family="monospace" font-size="11">'
    )
    return "\n".join([head, f'<text x="4" y="12">{escape(title)}</text>', *rows, "</svg>", ""])


def _boxes(
    node: Node, left: float, level: int, scale: float
) -> Iterator[tuple[int, float, float, str, int]]:
    """Yield (level, left, width, name, count) of all that is called from a node."""
    for name, call in sorted(node.calls.items()):
        width = call.count * scale
        if width >= LEAST_WIDTH:
            yield level, left, width, name, call.count
            yield from _boxes(call, left, level + 1, scale)
        left += width


def _box(
    height: int, total: int, level: int, left: float, width: float, name: str, count: int
) -> str:
    top = height - (level + 1) * ROW
    hue = zlib.crc32(name.rpartition("::")[0].encode()) % 55  # one for each module, red to yellow
    room = int((width - 4) / LETTER)
    label = name if len(name) <= room else name.rpartition("::")[2][:room]
    text = f'<text x="{left + 2:.1f}" y="{top + 12}">{escape(label)}</text>' if room > 2 else ""
    return (
        f'<g><title>{escape(name)}: {count / total:.1%}</title><rect x="{left:.1f}" y="{top}"'
        f' width="{width:.1f}" height="{ROW - 1}" fill="hsl({hue} 85% 65%)"/>{text}</g>'
    )
