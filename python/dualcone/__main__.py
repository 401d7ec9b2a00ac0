"""`python -m dualcone --version`: shows that the wheel works, without Blender."""

import argparse

from . import __version__


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="dualcone", description="The renderer of DualCone.")
    parser.add_argument("--version", action="version", version=f"dualcone {__version__}")
    parser.parse_args()
    parser.print_help()


if __name__ == "__main__":
    main()
