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
from steptwin.controller.motion.backend import fastest_kernel

assert compiled_here() is compiled
figure = measure(fastest_kernel())
print(figure.emulation_s, figure.bare_bus_ratio)
"""


@dataclass(frozen=True)
class CompiledFigure:
    """The shortest of ROUNDS medians of the emulation of a drawer pull, s, and the ratios to a bare bus then."""

    compiled_s: float
    compiled_ratio: float
    sources_s: float
    sources_ratio: float


def compiled_here() -> bool:
    """Return whether this installation has its hot modules compiled."""
    return Path(str(simulation.__file__)).suffix != ".py"


def measure() -> CompiledFigure | None:
    """Measure each in processes of its own; return None where nothing is compiled."""
    if not compiled_here():
        return None
    rounds = [(_measured("compiled"), _measured("sources")) for _ in range(ROUNDS)]
    compiled, sources = map(min, zip(*rounds, strict=True))
    return CompiledFigure(*compiled, *sources)


def _measured(how: str) -> tuple[float, float]:
    """Return the emulation's time, s, and its ratio to a bare bus, measured in a process of its own."""
    package = str(Path(str(simulation.__file__)).parents[1])
    command = [sys.executable, "-c", _MEASURE, package, how]
    emulation_s, ratio = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(emulation_s), float(ratio)
