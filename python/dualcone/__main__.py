"""`python -m dualcone --version`."""

import argparse

import dualcone


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m dualcone", description=dualcone.__doc__)
    parser.add_argument("--version", action="version", version=f"DualCone {dualcone.__version__}")
    parser.parse_args()
    parser.print_help()


if __name__ == "__main__":
    main()
