"""Build, read and install wheels without network: hatchling and all dependencies are installed already."""

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[2]
"""The checkout."""
_LIBRARIES = [path for path in sys.path if path.endswith("site-packages")]


def build(target: str, source: Path, folder: Path) -> Path:
    """Build the `wheel` or the `sdist` of a source folder; return the file."""
    folder.mkdir(exist_ok=True)
    _run([sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)], source)
    (built,) = folder.iterdir()
    return built


def contents(wheel: Path) -> dict[str, bytes]:
    """Return the bytes of each file in a wheel, by name."""
    with ZipFile(wheel) as file:
        return {name: file.read(name) for name in file.namelist()}


def install(wheel: Path, folder: Path) -> Path:
    """Install a wheel into a folder of its own; return the folder."""
    _run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", folder, wheel])
    return folder


def run_installed(installed: Path, *arguments: str, cwd: Path) -> str:
    """Run Python with an installed wheel and return its stdout.

    Without the module `site` there is no editable install of the checkout beside it, only the libraries.
    """
    path = os.pathsep.join([str(installed), *_LIBRARIES])
    return _run([sys.executable, "-S", *arguments], cwd, os.environ | {"PYTHONPATH": path})


def _run(command: list[str | Path], cwd: Path | None = None, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
