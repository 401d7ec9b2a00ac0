"""Cross-build the extension for every platform that Blender runs on.

Rust's standard library for each target comes from rustup, C's from the ziglang wheel.
"""

import subprocess
import sys
from pathlib import Path

from build_extension import pack

WHEELS = Path("build") / "wheel-all"

# Rust's name of each target and maturin's arguments beyond it.
TARGETS = {
    "x86_64-unknown-linux-gnu": ["--compatibility", "manylinux_2_28"],
    "aarch64-unknown-linux-gnu": ["--compatibility", "manylinux_2_28"],
    "x86_64-pc-windows-gnu": [],
    "aarch64-apple-darwin": [],
    "x86_64-apple-darwin": [],
}


def build(target: str, arguments: list[str]) -> Path | None:
    """Return the wheel for a target, or None after its tools have said why there is none."""
    folder = WHEELS / target
    install = ["rustup", "target", "add", target]
    command = ["maturin", "build", "--release", "--locked", "--zig", "--target", target]
    for step in (install, [*command, *arguments, "--out", str(folder)]):
        print("+", *step, flush=True)
        if subprocess.run(step, check=False).returncode != 0:
            return None
    return max(folder.glob("*.whl"), key=lambda wheel: wheel.stat().st_mtime)


def main() -> None:
    """Build and pack every target that can be built here, then name those that cannot."""
    wheels = {target: build(target, arguments) for target, arguments in TARGETS.items()}
    for target, wheel in wheels.items():
        print(f"{target}: {pack(wheel) if wheel else 'NOT BUILT, see its messages above'}")
    if None in wheels.values():
        sys.exit(1)


if __name__ == "__main__":
    main()
