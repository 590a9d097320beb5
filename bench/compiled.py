"""Measure what compiling the hot modules saves: the drawer pull with them and with their sources, in turns."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from steptwin.emulator import simulation

ROUNDS: Final = 3
_MEASURE: Final = """
import sys
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

package, compiled = sys.argv[1], sys.argv[2] == "compiled"
if not compiled:
    only_sources = FileFinder.path_hook((SourceFileLoader, SOURCE_SUFFIXES))

    def ours(path):
        if not path.startswith(package):
            raise ImportError(path)
        return only_sources(path)

    sys.path_hooks.insert(0, ours)

from steptwin.bench.compiled import compiled_here
from steptwin.bench.drawer_pull import measure
from steptwin.controller.backend import fastest_kernel

assert compiled_here() is compiled
print(measure(fastest_kernel()).emulation_s)
"""


@dataclass(frozen=True)
class CompiledFigure:
    """The shortest of ROUNDS medians of the emulation of a drawer pull, s."""

    compiled_s: float
    sources_s: float


def compiled_here() -> bool:
    """Return whether this installation has its hot modules compiled."""
    return Path(str(simulation.__file__)).suffix != ".py"


def measure() -> CompiledFigure | None:
    """Measure each in processes of its own; return None where nothing is compiled."""
    if not compiled_here():
        return None
    rounds = [[_emulation_s(how) for how in ("compiled", "sources")] for _ in range(ROUNDS)]
    return CompiledFigure(*map(min, zip(*rounds, strict=True)))


def _emulation_s(how: str) -> float:
    package = str(Path(str(simulation.__file__)).parents[1])
    command = [sys.executable, "-c", _MEASURE, package, how]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
