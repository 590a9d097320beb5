"""The programs beside a served board: its panel for `serve --panel`, and the one of `serve --exec`.

The one of `--exec` is started once the board is served, and its end is the server's.

The panel is a process of its own, `panel.served`. In the server's process the page would make the board late: with it
in a thread, ticks at the 99th percentile were seen 22 ms late instead of 7.6 ms, beside it 5.8 ms (measured with
NiceGUI 3.18 on two cores). It begins before the board is ready, since its imports take longer than the board's.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from signal import Signals
from threading import Event, Thread
from typing import TYPE_CHECKING, Final

import typer

from steptwin.host.cli.options import naming_options, option
from steptwin.host.cli.output import say, warn
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.listening import listen

if TYPE_CHECKING:
    from steptwin.host.cli.live.serve import EndpointOptions
    from steptwin.host.twin.live.served_board import ServedBoard


_END_S: Final = 5.0
"""Time that a program has to end by itself when the server ends before it."""
_TOGETHER_S: Final = 1.0
"""Time within which the panel and its server both end by a Ctrl-C."""
_EVERYWHERE: Final = ("0.0.0.0", "::")


def require_extra() -> None:
    """Raise InputError, with the remedy, unless the extra `panel` is installed."""
    if find_spec("nicegui") is None:
        raise InputError(f"the panel is not installed: {installing('panel')}")


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


_LOOK_EVERY_S: Final = 0.02
_INTERFACE: Final = re.compile(r"v?can\d+")
"""Names of SocketCAN's interfaces, as programs are told them."""
_BY_SIGNAL: Final = 128
"""Added to the number of the signal that has ended a program, as shells do."""
CAN_VARIABLE: Final = "STEPTWIN_CAN"
CONTROL_VARIABLE: Final = "STEPTWIN_CONTROL"


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandOptions:
    """The options that start a program for the served board."""

    words: str | None = option(
        "CMD",
        "Start a program once the board is served; its end is the server's. One that opens SocketCAN, such as candump,"
        " needs --preload.",
        "--exec",
    )
    preload: str | None = option(
        "FILE", "Library that the program of --exec loads first (LD_PRELOAD), such as canshim.so (docs/socketcan.md)."
    )

    def checked(self, interface: str | None) -> list[str]:
        """Return the program and its arguments; none if there is to be none.

        Raises:
            InputError: there is no such program or library, or no server for the library to connect to.
        """
        if self.words is None:
            if self.preload is not None:
                raise InputError("--preload: is for the program of --exec CMD")
            return []
        with prefixed(f"--exec {self.words}: "):
            try:
                words = shlex.split(self.words)
            except ValueError as error:
                raise InputError(str(error).lower()) from error
            if not words:
                raise InputError("names no program, as in --exec 'candump can0'")
            if shutil.which(words[0]) is None:
                raise InputError(f"there is no program {words[0]!r}")
        if self.preload is not None and interface is not None:
            raise InputError("--preload: with -i there is no socketcand server for it")
        if self.preload is not None and not Path(self.preload).is_file():
            raise InputError(f"--preload {self.preload}: is no file")
        return words


class ServedCommand:
    """A program beside a served board.

    Attributes:
        exit_code: its exit code, as shells count; None while it runs, and if the server has ended it.
    """

    def __init__(self, options: CommandOptions, interface: str | None) -> None:
        """Check the options; raises as `CommandOptions.checked`."""
        self._words = options.checked(interface)
        self._preload = options.preload
        self._process: subprocess.Popen[bytes] | None = None
        self.exit_code: int | None = None

    @property
    def wanted(self) -> bool:
        """True if there is a program to start."""
        return bool(self._words)

    def start(self, served: "ServedBoard", host: str | None, *, to_stderr: bool) -> None:
        """Start it, if it is wanted; its end stops the board.

        Args:
            served: the board, which listens already.
            host: address where its server listens, as given.
            to_stderr: let the program print to stderr, because stdout is the document's.

        Raises:
            InputError: the system cannot start it.
        """
        if not self._words:
            return
        variables = dict(os.environ)
        if served.port is not None:
            variables[CAN_VARIABLE] = f"{reached_at(host)}:{served.port}"
        if served.control is not None:
            variables[CONTROL_VARIABLE] = served.control.address
        if self._preload is not None:
            libraries = [str(Path(self._preload).resolve()), variables.get("LD_PRELOAD", "")]
            variables["LD_PRELOAD"] = ":".join(filter(None, libraries))
        try:
            self._process = process = subprocess.Popen(
                self._words, env=variables, stdout=sys.stderr if to_stderr else None
            )
        except OSError as error:
            raise InputError(f"--exec {self._words[0]}: {error.strerror}") from error

        def look() -> None:
            code = process.poll()
            if code is not None and self.exit_code is None:
                self.exit_code = code if code >= 0 else _BY_SIGNAL - code
                served.stop()

        served.call_every(_LOOK_EVERY_S, look)

    def end(self) -> None:
        """End it if it still runs."""
        if self._process is None or self._process.poll() is not None:
            return
        self._process.terminate()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def pass_on(self) -> None:
        """End the command line with the program's exit code, unless it is 0 or the server has ended first."""
        if self.exit_code:
            opened = next(filter(_INTERFACE.fullmatch, self._words), None)
            if opened is not None and self._preload is None:
                say(
                    f"--exec {shlex.join(self._words)}: ended with exit code {self.exit_code}; for it to find the board"
                    f" as {opened}, --preload canshim.so (docs/socketcan.md)",
                    err=True,
                )
            raise typer.Exit(self.exit_code)
