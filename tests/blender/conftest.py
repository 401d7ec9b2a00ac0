"""The real Blender with the extension installed from the zip that `make extension` built."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
NOT_ON_THIS_MACHINE = 77

Blender = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the folder of the real Blender 5.2, made by tests/get-blender."""
    folder = Path(os.environ.get("DUALCONE_BLENDER", ROOT / "build" / "blender-5.2"))
    made = subprocess.run(
        [ROOT / "tests" / "get-blender", "5.2", folder],
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode == NOT_ON_THIS_MACHINE:
        reason = f"SKIPPED the tests in the real Blender: {made.stderr.strip()}"
        if os.environ.get("DUALCONE_REQUIRE_BLENDER") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


@pytest.fixture(scope="session")
def shared_folder() -> Iterator[Path]:
    """Return a folder below /tmp: all that the Blender in its folder sees of this machine."""
    folder = Path(tempfile.mkdtemp(prefix="dualcone-", dir="/tmp"))
    yield folder
    shutil.rmtree(folder)


@pytest.fixture(scope="session")
def bare_blender(program: Path, shared_folder: Path) -> Blender:
    """Return a function that runs Blender with its arguments and returns the finished process."""

    def run(*arguments: object, timeout: float = 300) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(word) for word in (ROOT / "tests" / "in-blender", program, *arguments)],
            env={**os.environ, "BLENDER_HOME": str(shared_folder / "home")},
            cwd=shared_folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
            check=False,
        )

    return run


@pytest.fixture(scope="session")
def extension(program: Path, shared_folder: Path) -> Path:
    """Return the zip for this platform, copied to where Blender sees it."""
    (built,) = (ROOT / "dist").glob("dualcone-*-linux-x64.zip")
    return Path(shutil.copy(built, shared_folder))


@pytest.fixture(scope="session")
def blender(bare_blender: Blender, extension: Path) -> Blender:
    """Return the same function for a Blender in which the extension is installed and enabled."""
    installed = bare_blender(
        "--command", "extension", "install-file", "-r", "user_default", "-e", extension
    )
    assert installed.returncode == 0, installed.stdout
    return bare_blender
