"""`serve --panel`: the panel of a served board, as a process beside it.

In the server's process the page would make the board late: with it in a thread, ticks at the 99th percentile were seen
22 ms late instead of 7.6 ms, beside it 5.8 ms (measured with NiceGUI 3.18 on two cores). The process begins before the
board is ready, since its imports take longer than the board's.
"""

import json
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from signal import Signals
from threading import Event, Thread
from typing import Final

from steptwin.host.cli.live.served_programs import ServedPlace, ServedProgram
from steptwin.host.cli.options import naming_options, option, switch
from steptwin.host.cli.output import warn
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.listening import LOOPBACK, listen

_END_S: Final = 5.0
"""Time for the process to end when the server ends first."""
_TOGETHER_S: Final = 1.0
"""Time within which the panel and its server both end after Ctrl-C."""


def require_extra() -> None:
    """Raise InputError, with the remedy, if the extra `panel` is not installed."""
    if find_spec("nicegui") is None:
        raise InputError(f"the panel is not installed: {installing('panel', make='panel')}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelOptions(ServedProgram):
    """Options that open a panel for the served board."""

    panel: bool = switch("Show the machine in a browser, too; with a control port for its hardware.")
    panel_port: int | None = option(
        "PORT", "Port of its page, with --panel or instead of it; by default 8090, or a free one; 0 is free."
    )

    @property
    def wanted(self) -> bool:
        """True if a panel is wanted; raises InputError or BusError if it is impossible."""
        wanted = self.panel or self.panel_port is not None
        if wanted:
            require_extra()
        if self.panel_port is not None:
            with naming_options("panel_port"):
                listen(LOOPBACK, self.panel_port, "panel_port").close()
        return wanted

    def command(self, place: ServedPlace) -> list[str]:
        """Return the words of the command that opens the panel of a served board."""
        words = ["panel", *place.robot, *place.bus]
        words += [] if self.panel_port is None else ["--port", str(self.panel_port)]
        return words if place.control is None else [*words, "--control", place.control]

    @contextmanager
    def running(self, *, to_stderr: bool) -> Iterator[Callable[[ServedPlace], None]]:
        """Run the process during the block; yield a function that opens the panel of a board.

        The panel prints its address to stderr, or to this process' stdout. It stops its own motions before it ends. If
        it ends before the block does, a line says so, since its page cannot.
        """
        process = subprocess.Popen(
            [sys.executable, "-m", "steptwin.features.panel.served"],
            stdin=subprocess.PIPE,
            stdout=sys.stderr if to_stderr else None,
            text=True,
        )
        ending = Event()
        opened_by: list[str] = []

        def watch() -> None:
            code = process.wait()
            if opened_by and not ending.wait(_TOGETHER_S):
                again = f"the board goes on; `{shlex.join(['steptwin', *opened_by])}` opens it again"
                how = f"by {Signals(-code).name}" if code < 0 else f"with exit code {code}"
                warn(f"the panel has ended {how}: its page and its E-STOP are dead; {again}")

        Thread(target=watch, name="panel", daemon=True).start()

        def open_panel(place: ServedPlace) -> None:
            assert process.stdin
            opened_by[:] = self.command(place)
            with suppress(BrokenPipeError):  # the process has failed and has printed why
                process.stdin.write(json.dumps(opened_by) + "\n")
                process.stdin.flush()

        try:
            yield open_panel
        finally:
            ending.set()
            process.terminate()
            try:
                process.communicate(timeout=_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
