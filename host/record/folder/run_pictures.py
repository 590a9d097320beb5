"""Draw the pictures of a run into its folder, here or in a process that gets ready while the run goes on.

They are drawn from the folder, so that `plot` draws the same: the stored motion differs slightly from the planned one
(see `motion`).
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import Final

from steptwin.host.record.folder.reading import StoredRun, read_run

DEFAULT_PICTURES: Final = ("joints", "step-rates", "tool-path", "error", "timing")
"""Pictures that are drawn into every run's folder."""


def can_draw() -> bool:
    """Return whether pictures can be drawn: matplotlib is installed."""
    return find_spec("matplotlib") is not None


def draw_here(folder: Path) -> None:
    """Draw the pictures of the run in a folder; raise OSError if one cannot be written."""
    _draw(read_run(folder), folder, DEFAULT_PICTURES)


@contextmanager
def drawing_apart() -> Iterator[Callable[[Path], None]]:
    """Yield a function that draws as `draw_here`, in a process that imports from now on what it needs.

    Where that process fails, the function draws here, which tells why.
    """
    program = f"from {__name__} import draw_when_told; draw_when_told()"
    with Popen([sys.executable, "-P", "-c", program], stdin=PIPE, stdout=DEVNULL, stderr=DEVNULL) as ahead:

        def draw(folder: Path) -> None:
            ahead.communicate(bytes(folder.absolute()))
            if ahead.returncode:
                draw_here(folder)

        try:
            yield draw
        finally:
            ahead.kill()  # it has ended, unless nothing was drawn


def draw_when_told() -> None:
    """Draw the pictures of the folder that standard input names, in two processes where the system can fork."""
    import scipy.interpolate  # noqa: F401 - reading a run needs it; it takes as long as a picture

    from steptwin.host.record import plots  # noqa: F401 - likewise

    named = sys.stdin.buffer.read()
    if not named:
        return  # the run has failed
    folder, middle = Path(os.fsdecode(named)), len(DEFAULT_PICTURES) // 2 + 1
    stored = read_run(folder)
    if not hasattr(os, "fork"):
        _draw(stored, folder, DEFAULT_PICTURES)
    elif forked := os.fork():
        _draw(stored, folder, DEFAULT_PICTURES[:middle])
        _, status = os.waitpid(forked, 0)
        sys.exit(os.waitstatus_to_exitcode(status) != 0)
    else:
        _draw(stored, folder, DEFAULT_PICTURES[middle:])


def _draw(stored: StoredRun, folder: Path, names: Iterable[str]) -> None:
    from steptwin.host.record.plots import write_plots

    write_plots(folder, stored.comparison, stored.report.run, names)
