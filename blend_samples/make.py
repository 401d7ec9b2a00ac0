"""Build the sample scenes again: `python blend_samples/make.py [NAME...]`, with the bpy wheel.

The files in the repository were written with bpy 4.2, so that Blender 4.2 and later open
them. The converted samples need their models: see scripts/converted.py.
"""

from __future__ import annotations

import importlib
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCENES = ("indoor", "loader", "stadium")


def main() -> None:
    sys.path.insert(0, str(HERE / "scripts"))
    import bpy  # noqa: F401  first: see scripts/common.py

    for name in sys.argv[1:] or SCENES:
        importlib.import_module(name).make()
        card = tomllib.loads((HERE / f"{name}.toml").read_text())
        size = (HERE / f"{name}.blend").stat().st_size / 1e6
        print(f"{name}: {card['triangles']:,} triangles, {size:.2f} MB")


if __name__ == "__main__":
    main()
