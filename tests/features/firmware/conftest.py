"""Compile firmware for the native interface."""

import shutil
import subprocess
from itertools import count
from pathlib import Path

import pytest

from steptwin.features.firmware.process import interface_files
from tests.features.firmware.compilers import GCC, Build

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def build(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Build:
    """Return a function that compiles C files, the interface's and those of this folder, to a library."""
    folder, numbers = tmp_path_factory.mktemp(request.path.stem), count()
    for name, text in interface_files().items():
        (folder / name).write_text(text, encoding="utf-8")
    for path in HERE.glob("*.c"):
        shutil.copy(path, folder)

    def built(*sources: str, compiler: str | None = GCC, **defined: object) -> Path:
        library = folder / f"fw{next(numbers)}.so"
        macros = [f"-D{name}={value}" for name, value in defined.items()]
        command = [compiler or "", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", *macros]
        files = [str(folder / source) for source in sources]
        subprocess.run([*command, "-o", str(library), *files], check=True, timeout=60)
        return library

    return built
