"""The compilers of this computer, None for one that is not installed."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

GCC: Final = shutil.which("gcc") or shutil.which("cc")
CPP: Final = shutil.which("g++") or shutil.which("c++")
NEEDS_GCC: Final = pytest.mark.skipif(GCC is None, reason="no C compiler is installed")
Build = Callable[..., Path]
"""Compiles C files, by their names, with macros."""
