"""Compile the modules that take most of a run's time to C, for a wheel that asks for it: see docs/evidence.md.

mypyc translates the sources as they are. A compiled module lies beside its source in the wheel, and Python loads it
instead. What is not listed in `pyproject.toml` stays Python, and so does every wheel without this hook.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from hatchling.builders.config import BuilderConfig
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PACKAGE: Final = "steptwin"
_BUILD: Final = f"""
import sys
from setuptools import setup
from mypyc.build import mypycify

options = ["--config-file=", "--ignore-missing-imports", "--follow-imports=silent"]
compiled = mypycify(options + sys.argv[1:], group_name="{_PACKAGE}.compiled", debug_level="0")
setup(name="{_PACKAGE}", packages=[], ext_modules=compiled, script_args=["--quiet", "build_ext", "--inplace"])
"""
"""Builds all modules as one library, since calls between compiled modules are then those of C."""
_WITHIN: Final = "-fvisibility=hidden -fno-semantic-interposition"
"""Lets gcc and clang call from one compiled module into another without a table that other libraries could change."""


class CompileHook(BuildHookInterface[BuilderConfig]):
    """Adds the compiled modules to the wheel; its option `modules` has their paths without `steptwin/`."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._staging = TemporaryDirectory()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, unless the install is editable: there the sources are what runs.

        Raises:
            RuntimeError: a listed module does not exist, or mypyc or the C compiler has failed.
        """
        if version == "editable":
            return
        folder = Path(self._staging.name)
        _stage(Path(self.root), folder, self.config["folders"])
        missing = [module for module in self.config["modules"] if not (folder / _PACKAGE / module).is_file()]
        if missing:
            raise RuntimeError(f"pyproject.toml lists modules to compile that do not exist: {', '.join(missing)}")
        _compile(folder, [f"{_PACKAGE}/{module}" for module in self.config["modules"]])
        libraries = [path for path in (folder / _PACKAGE).rglob("*") if path.suffix in (".so", ".pyd")]
        build_data["force_include"] |= {str(path): str(path.relative_to(folder)) for path in libraries}
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, _version: str, _build_data: dict[str, Any], _artifact_path: str) -> None:
        """Remove what the build has left."""
        self._staging.cleanup()


def _stage(root: Path, folder: Path, names: list[str]) -> None:
    """Copy the sources as they are imported: each folder within the package, whether the checkout has links or not."""
    package = folder / _PACKAGE
    package.mkdir()
    for path in (root / _PACKAGE).iterdir():
        if path.suffix in (".py", ".typed"):
            shutil.copy(path, package)
    for name in names:
        shutil.copytree(root / name, package / name, ignore=shutil.ignore_patterns("__pycache__"))


def _compile(folder: Path, modules: list[str]) -> None:
    command = [sys.executable, "-c", _BUILD, *modules]
    environment = os.environ | ({"CFLAGS": f"{_WITHIN} {os.environ.get('CFLAGS', '')}"} if os.name == "posix" else {})
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"mypyc or the C compiler has failed:\n{done.stdout}{done.stderr}")
