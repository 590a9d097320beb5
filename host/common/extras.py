"""Return the command that installs a missing extra, depending on how StepTwin was installed."""

import json
import os
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

_NAME: Final = "steptwin"


def installing(*extras: str, make: str | None = None) -> str:
    """Return the command that installs extras, such as `pip install 'steptwin[plot]'`.

    It names the folder of a checkout, or the file or repository from which the package was installed. `make` is a
    target of a checkout's Makefile that installs them, too.
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
    """Return the folder of the checkout that contains this package; None if there is none."""
    folder = Path(__file__).resolve().parents[2]
    return folder if (folder / "pyproject.toml").is_file() and (folder / _NAME).is_dir() else None


def _source() -> str:
    """Return the address from which the package was installed (PEP 610); empty for the index."""
    try:
        text = distribution(_NAME).read_text("direct_url.json")
        document = json.loads(text) if text else {}
    except (PackageNotFoundError, ValueError):
        return ""
    address = str(document.get("url", ""))
    repository = document.get("vcs_info")
    return f"{repository['vcs']}+{address}@{repository['commit_id']}" if repository else address


def _pip() -> str:
    """Return the pip command of this Python: `pip` only if that belongs to it, as in an active venv."""
    found = shutil.which("pip")
    if sys.prefix == sys.base_prefix or (found and Path(found).parent == Path(sys.executable).parent):
        return "pip"
    python = Path(sys.executable)
    return f"{os.path.relpath(python) if python.is_relative_to(Path.cwd()) else python} -m pip"
