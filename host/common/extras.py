"""Say how an extra that is missing gets installed, by how StepTwin itself was installed."""

import json
import os
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

_NAME: Final = "steptwin"


def installing(*extras: str, make: str | None = None) -> str:
    """Return the command that installs extras where it is typed, such as `pip install 'steptwin[plot]'`.

    In a checkout that is the checkout's own folder, and `make` a target of its Makefile that installs them, too. Of a
    package from a file or a repository it is that again.
    """
    wanted = f"[{','.join(extras)}]"
    checkout = _checkout()
    if checkout is not None:
        here = Path.cwd() == checkout
        command = f"{_pip()} install -e '{'.' if here else checkout}{wanted}'"
        return f"make {make}, or {command}" if here and make else command
    source = _source()
    return f"{_pip()} install '{_NAME}{wanted}{f' @ {source}' if source else ''}'"


def _checkout() -> Path | None:
    """Return the folder of the checkout in which this package is, if it is in one."""
    folder = Path(__file__).resolve().parents[2]
    return folder if (folder / "pyproject.toml").is_file() and (folder / _NAME).is_dir() else None


def _source() -> str:
    """Return the address from which the package was installed (PEP 610); empty if it was the index."""
    try:
        text = distribution(_NAME).read_text("direct_url.json")
        document = json.loads(text) if text else {}
    except (PackageNotFoundError, ValueError):
        return ""
    address = str(document.get("url", ""))
    repository = document.get("vcs_info")
    return f"{repository['vcs']}+{address}@{repository['commit_id']}" if repository else address


def _pip() -> str:
    """Return how pip is called for this Python: by its name only if that is this Python's, as in an active venv."""
    found = shutil.which("pip")
    if sys.prefix == sys.base_prefix or (found and Path(found).parent == Path(sys.executable).parent):
        return "pip"
    python = Path(sys.executable)
    return f"{os.path.relpath(python) if python.is_relative_to(Path.cwd()) else python} -m pip"
