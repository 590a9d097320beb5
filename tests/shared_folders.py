"""Folders that are dear to make: of several workers the first that asks makes one, and the others copy it."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Return a folder of this process with what `make` writes; workers of one run call `make` once for all."""
    folder = factory.mktemp(name)
    if "PYTEST_XDIST_WORKER" not in os.environ:
        make(folder)
        return folder
    shared = factory.getbasetemp().parent / name  # beside the workers' own folders
    with FileLock(shared.with_suffix(".lock")):
        if not shared.exists():
            make(folder)
            shutil.copytree(folder, shared)
            return folder
    return shutil.copytree(shared, folder, dirs_exist_ok=True)
