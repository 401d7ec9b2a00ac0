"""Pack addon/ and a wheel into an extension that Blender can install.

python scripts/build_extension.py WHEEL...                  one zip per wheel, in dist/
python scripts/build_extension.py --full WHEEL DENOISER     one "full" zip that holds both
"""

import sys
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon"
MANIFEST = "blender_manifest.toml"

# Blender's name of a platform, by the system and machine in a wheel's file name.
PLATFORMS = {
    ("manylinux", "x86_64"): "linux-x64",
    ("manylinux", "aarch64"): "linux-arm64",
    ("win", "amd64"): "windows-x64",
    ("macosx", "arm64"): "macos-arm64",
    ("macosx", "x86_64"): "macos-x64",
}


def wheel_version(wheel: Path) -> str:
    """Return the version in a wheel's file name."""
    return wheel.name.split("-")[1]


def blender_platform(wheel: Path) -> str:
    """Return Blender's name of the platform a wheel was built for."""
    tag = wheel.stem.rsplit("-", 1)[1]
    for (system, machine), platform in PLATFORMS.items():
        if tag.startswith(system) and tag.endswith(machine):
            return platform
    sys.exit(f"{wheel.name}: no Blender platform is known for {tag}")


def complete_manifest(wheel: Path, others: Sequence[Path]) -> str:
    """Return the manifest with the lines that depend on the wheels."""
    manifest = (ADDON / MANIFEST).read_text("utf-8")
    version = tomllib.loads(manifest)["version"]
    if version != wheel_version(wheel):
        sys.exit(f"addon/{MANIFEST} says {version}, Cargo.toml {wheel_version(wheel)}")
    platforms = f'platforms = ["{blender_platform(wheel)}"]'
    wheels = ", ".join(f'"./wheels/{each.name}"' for each in (wheel, *others))
    return f"{manifest}{platforms}\nwheels = [{wheels}]\n"


def addon_files() -> list[Path]:
    """Return what goes into the zip as it is."""
    files = (path for path in ADDON.rglob("*") if path.is_file() and path.name != MANIFEST)
    return sorted(path for path in files if "__pycache__" not in path.parts)


def pack(wheel: Path, others: Sequence[Path] = ()) -> Path:
    """Write dist/dualcone-VERSION-PLATFORM.zip, "-full" with other wheels, and return its path."""
    manifest = complete_manifest(wheel, others)
    name = f"dualcone-{wheel_version(wheel)}-{blender_platform(wheel)}"
    target = ROOT / "dist" / f"{name}{'-full' if others else ''}.zip"
    target.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(MANIFEST, manifest)
        archive.write(ROOT / "LICENSE", "LICENSE")
        for each in (wheel, *others):
            archive.write(each, f"wheels/{each.name}")
        for path in addon_files():
            archive.write(path, path.relative_to(ADDON).as_posix())
    return target


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    if sys.argv[1] == "--full":
        own, *further = (Path(argument) for argument in sys.argv[2:])
        print(pack(own, further).relative_to(ROOT))
        sys.exit()
    for argument in sys.argv[1:]:
        print(pack(Path(argument)).relative_to(ROOT))
