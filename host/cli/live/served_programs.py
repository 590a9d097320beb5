"""Programs beside a served board: those of features, and the one of `serve --exec`.

The program of `--exec` starts when the board is served, and its end ends the server.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import typer

from steptwin.host.cli.options import option
from steptwin.host.cli.output import say
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.twin.live.served_board import ServedBoard


class ServedPlace(NamedTuple):
    """Address of a served board for other commands.

    Attributes:
        robot: words that name its robot.
        bus: options with its address.
        control: HOST:PORT of its control port; None without one.
    """

    robot: Sequence[str]
    bus: Sequence[str]
    control: str | None


class ServedProgram(ABC):
    """A feature's options of `steptwin serve` and their program: base class of a dataclass."""

    __slots__ = ()

    @property
    @abstractmethod
    def wanted(self) -> bool:
        """True if the program is wanted; raises InputError or BusError if it cannot run.

        The board then has a control port, and the program prints how to end both.
        """

    @abstractmethod
    def running(self, *, to_stderr: bool) -> AbstractContextManager[Callable[[ServedPlace], None]]:
        """Run the program during the block; yield a function that announces the served board to it.

        Args:
            to_stderr: True to let the program print to stderr, because stdout has the document.
        """


_EVERYWHERE: Final = ("0.0.0.0", "::")


def reached_at(host: str | None) -> str:
    """Return the HOST, for HOST:PORT, at which this machine's programs reach a server that listens at `host`."""
    from steptwin.host.client.links import in_url

    return in_url(socketcand.LOOPBACK if host is None or host in _EVERYWHERE else host)


_END_S: Final = 5.0
"""Time for the program of --exec to end when the server ends first."""
_LOOK_EVERY_S: Final = 0.02
_INTERFACE: Final = re.compile(r"v?can\d+")
"""Names of SocketCAN's interfaces for programs."""
_BY_SIGNAL: Final = 128
"""Added to the number of the signal that has ended a program, as in shells."""
CAN_VARIABLE: Final = "STEPTWIN_CAN"
CONTROL_VARIABLE: Final = "STEPTWIN_CONTROL"


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandOptions:
    """Options of the program for the served board."""

    words: str | None = option(
        "CMD",
        "Start a program once the board is served; its end is the server's. One that opens SocketCAN, such as candump,"
        " needs --preload.",
        "--exec",
    )
    preload: str | None = option(
        "FILE", "Library that the program of --exec loads first (LD_PRELOAD), such as canshim.so (docs/masters.md)."
    )

    def checked(self, interface: str | None) -> list[str]:
        """Return the program and its arguments; empty without one.

        Raises:
            InputError: the program or library does not exist, or there is no server for the library to connect to.
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
        exit_code: its exit code, as in shells; None while it runs, and if the server has ended it.
    """

    def __init__(self, options: CommandOptions, interface: str | None) -> None:
        """Check the options; raise as `CommandOptions.checked`."""
        self._words = options.checked(interface)
        self._preload = options.preload
        self._process: subprocess.Popen[bytes] | None = None
        self.exit_code: int | None = None

    @property
    def wanted(self) -> bool:
        """True if there is a program."""
        return bool(self._words)

    def start(self, served: "ServedBoard", host: str | None, *, to_stderr: bool) -> None:
        """Start it, if it is wanted; its end stops the board.

        Args:
            served: the board, already listening.
            host: given address of its server.
            to_stderr: True to let the program print to stderr, because stdout has the document.

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
        """End it if it is still running."""
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
                    f" as {opened}, --preload canshim.so (docs/masters.md)",
                    err=True,
                )
            raise typer.Exit(self.exit_code)
