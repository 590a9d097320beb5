"""Draw the pictures of a run into its folder, here or in processes that get ready while the run goes on.

They are drawn from the folder, so that `plot` draws the same: the stored motion differs slightly from the planned one
(see `motion`).
"""

import signal
from collections.abc import Callable, Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from steptwin.host.record.folder.reading import read_run

DEFAULT_PICTURES: Final = ("joints", "step-rates", "tool-path", "error", "timing")
"""Pictures that are drawn into every run's folder."""

_PROCESSES: Final = 2
_NEEDED: Final = ("steptwin.host.record.folder.run_pictures", "steptwin.host.record.plots", "scipy.interpolate")
"""What takes longer to import than a picture to draw."""

_stored = cache(read_run)


def can_draw() -> bool:
    """Return whether pictures can be drawn: matplotlib is installed."""
    return find_spec("matplotlib") is not None


def draw_here(folder: Path, names: Iterable[str] = DEFAULT_PICTURES) -> None:
    """Draw pictures of the run in a folder; raise OSError if one cannot be written."""
    from steptwin.host.record.plots import write_plots

    stored = read_run(folder)
    write_plots(folder, stored.comparison, stored.report.run, names)


def draw_apart() -> Callable[[Path], None]:
    """Return a function that draws as `draw_here`, in two processes.

    Both are forked from a process that imports from now on what they need. Where the system cannot fork, the function
    is `draw_here` itself.
    """
    from multiprocessing import forkserver, get_all_start_methods, get_context

    if "forkserver" not in get_all_start_methods():
        return draw_here
    context = get_context("forkserver")
    context.set_forkserver_preload(list(_NEEDED))
    forkserver.ensure_running()

    def draw(folder: Path) -> None:
        with context.Pool(_PROCESSES, _leave_signals) as pool:
            pool.starmap(_draw, [(folder, name) for name in DEFAULT_PICTURES], chunksize=1)

    return draw


def _leave_signals() -> None:
    """Leave Ctrl-C to the program that waits for the pictures."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _draw(folder: Path, name: str) -> None:
    """Draw one picture, in a process that reads its run once."""
    from steptwin.host.record.plots import write_plots

    stored = _stored(folder)
    write_plots(folder, stored.comparison, stored.report.run, [name])
