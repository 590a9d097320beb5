"""`serve --panel`: the panel of a served board, as a process of its own.

In the server's process the page would make the board late: with it in a thread, ticks at the 99th percentile were seen
22 ms late instead of 7.6 ms, beside it 5.8 ms (measured with NiceGUI 3.18 on two cores).

The process, `served_panel`, begins before the board is ready, since its imports take longer than the board's.
"""

import json
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from signal import Signals
from threading import Event, Thread
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.options import naming_options
from steptwin.host.cli.output import warn
from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import InputError
from steptwin.host.common.listening import listen

if TYPE_CHECKING:
    from steptwin.host.cli.live.serve import EndpointOptions
    from steptwin.host.twin.live.served_board import ServedBoard

_END_S: Final = 5.0
"""Time that the panel has to end by itself."""
_TOGETHER_S: Final = 1.0
"""Time within which the panel and its server both end by a Ctrl-C."""
_EVERYWHERE: Final = ("0.0.0.0", "::")


def require_extra() -> None:
    """Raise InputError, with the remedy, unless the extra `panel` is installed."""
    if find_spec("nicegui") is None:
        raise InputError("the panel is not installed: pip install 'steptwin[panel]'")


def require_free(port: int | None) -> None:
    """Raise InputError or BusError unless the page of a panel can have a port; None is any."""
    if port is not None:
        with naming_options("panel_port"):
            listen(socketcand.LOOPBACK, port, "panel_port").close()


def reached_at(host: str | None) -> str:
    """Return the address at which programs of this machine reach a server that listens at one, for a HOST:PORT."""
    from steptwin.host.client.links import in_url

    return in_url(socketcand.LOOPBACK if host is None or host in _EVERYWHERE else host)


def panel_words(
    served: "ServedBoard", robot: Sequence[str], endpoint: "EndpointOptions", port: int | None
) -> list[str]:
    """Return the words of the command that opens the panel of a served board.

    Args:
        served: the board.
        robot: the words that name the robot.
        endpoint: where the board is, as given.
        port: port of the page; None lets the panel choose it.
    """
    words = ["panel", *robot]
    if endpoint.interface is None:
        words += ["--connect", f"{reached_at(endpoint.host)}:{served.port}"]
    else:
        words += ["-i", endpoint.interface, *(() if endpoint.channel is None else ("-c", endpoint.channel))]
    if port is not None:
        words += ["--port", str(port)]
    return words if served.control is None else [*words, "--control", served.control.address]


@contextmanager
def panel_process(*, wanted: bool, to_stderr: bool) -> Iterator[Callable[[Sequence[str]], None]]:
    """Run a process for a panel while the block runs, or none; yield a function that opens it by its words.

    The panel prints its address to stderr, or to this process' stdout. What it makes the machine do stops before its
    end. If it ends before the block does, this is said: its page cannot say it.
    """
    if not wanted:
        yield lambda _words: None
        return
    process = subprocess.Popen(
        [sys.executable, "-m", "steptwin.host.cli.live.served_panel"],
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

    def open_panel(words: Sequence[str]) -> None:
        assert process.stdin
        opened_by[:] = words
        with suppress(BrokenPipeError):  # the process has failed, and said so
            process.stdin.write(json.dumps(words) + "\n")
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
