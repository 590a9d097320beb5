"""The options that say which live board a command talks to, and the link and session that they open."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

import typer

from steptwin.host.cli.live.axis_states import print_axis_states
from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.client import Link
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.operate.recovering import AxisState
    from steptwin.host.operate.session import Session
    from steptwin.host.robots.robot import Robot

LIVE_PANEL: Final = "Live board"
"""Title of the group of options, in a command's help, that only a live board has."""

_live_option = partial(typer.Option, rich_help_panel=LIVE_PANEL)


@dataclass(frozen=True, slots=True)
class BoardAddress:
    """The place of a live board, as the options of a command give it; no option: none is meant."""

    connect: Annotated[
        str | None,
        _live_option(
            "--connect", metavar="HOST[:PORT]", help="Board behind a socketcand server; port 29536 by default."
        ),
    ] = None
    interface: Annotated[
        str | None,
        _live_option(
            "--interface", "-i", metavar="NAME", help="Board on an interface of python-can, such as socketcan."
        ),
    ] = None
    channel: Annotated[
        str | None, _live_option("--channel", "-c", metavar="NAME", help="Channel of the interface or of the server.")
    ] = None
    bitrate: Annotated[
        int | None,
        _live_option(
            "--bitrate", "-b", metavar="BIT/S", help="Bit rate of the interface; by default the robot file's."
        ),
    ] = None

    def connection(self, robot: "Robot | None") -> "Connection | None":
        """Return the connection that the options describe; None when no option is given.

        Raises:
            InputError: options contradict each other, or python-can has no such interface.
        """
        from steptwin.host.client.links.bus_link import Connection

        if self.connect is not None and self.interface is not None:
            raise InputError(f"--connect {self.connect} and --interface {self.interface}: give only one of them")
        if self.bitrate is not None and self.bitrate <= 0:
            raise InputError(f"--bitrate {self.bitrate}: is not above 0 bit/s")
        if self.connect is not None:
            if self.bitrate is not None:
                raise InputError(f"--bitrate {self.bitrate}: is for --interface; the server of --connect has its own")
            host, port = host_and_port("--connect", self.connect, socketcand.PORT, optional=True)
            return Connection("socketcand", self.channel, None, host, port)
        if self.interface is None:
            for option, value in (("--channel", self.channel), ("--bitrate", self.bitrate)):
                if value is not None:
                    raise InputError(f"{option} {value}: is for a live board: --connect HOST:PORT or --interface NAME")
            return None
        from steptwin.host.client.links.can_bus import check_interface

        check_interface("--interface", self.interface)
        return Connection(self.interface, self.channel, self.bitrate or (robot.board.bitrate if robot else None))


NOT_CONNECTED: Final = BoardAddress()
"""The default of commands: no board is named."""

Force = Annotated[bool, _live_option("--force", help="Go on although the board carries another robot's name.")]


def host_and_port(option: str, text: str, usual_port: int, *, optional: bool = False) -> tuple[str, int]:
    """Split HOST:PORT; an IPv6 address stands in brackets, as in URLs (RFC 3986), since it has colons itself.

    Args:
        option: name of the option in messages.
        text: its value.
        usual_port: the port in examples, and that of a text without one.
        optional: allow a text without a port.

    Raises:
        InputError: the text has another form.
    """
    host, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        host, port = text, str(usual_port) if optional else ""
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        raise InputError(f"{option} {text}: put an IPv6 address in brackets, such as [::1]:{usual_port}")
    if not host or not (port.isascii() and port.isdecimal()) or not 0 < int(port) < 1 << 16:
        raise InputError(f"{option} {text}: is not of the form HOST:PORT, such as {socketcand.LOOPBACK}:{usual_port}")
    return host, int(port)


def required(found: "Connection | None") -> "Connection":
    """Return the connection; raise InputError when there is none."""
    if found is None:
        raise InputError("which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL")
    return found


@contextmanager
def opened_link(found: "Connection") -> "Iterator[Link]":
    """Open a link and close it after the block; BusError if the bus cannot be opened."""
    from steptwin.host.client.links.bus_link import BusLink, open_bus

    with BusLink(open_bus(found), found.title) as link:
        yield link


@contextmanager
def opened_session(
    robot: "Robot",
    board: BoardAddress,
    *,
    force: bool,
    waking: bool = False,
) -> "Iterator[Session]":
    """Open the link that the options describe, with a session of the robot on it, and close it after the block.

    With `waking`, start nodes that another master has stopped. Unless forced, raise InputError if the board carries the
    name of another robot.
    """
    found = required(board.connection(robot))
    with session_at(found, robot, force=force, waking=waking) as session:
        yield session


@contextmanager
def session_at(found: "Connection", robot: "Robot", *, force: bool, waking: bool = False) -> "Iterator[Session]":
    """Open a session as `opened_session` does. All that a command does in it is one action: a stop ends all of it."""
    from steptwin.host.operate.recovering import wake
    from steptwin.host.operate.session import Session

    with opened_link(found) as link:
        session = Session(link, robot)
        with session.one_action():
            if waking:
                wake(session)
            foreign = None if force else session.foreign_board()
            if foreign:
                raise InputError(f"{foreign}; --force goes on all the same")
            yield session


def stop_axes(
    robot: "Robot",
    stop: "Callable[[Session], list[AxisState]]",
    board: BoardAddress,
    *,
    as_json: bool,
) -> None:
    """Stop all axes of a live board, whichever robot's it is, and print their states.

    Only then look whose the board is, so that a stop is never refused. If it is another robot's, print no positions,
    which would be in the wrong units, and raise InputError: that robot may have more axes.
    """
    from steptwin.host.client.stopping import saying_if_unsure

    with (
        saying_if_unsure(),
        opened_session(robot, board, force=True) as session,
    ):
        states = stop(session)
        foreign = session.foreign_board()
        print_axis_states(robot, states, positions=not foreign, as_json=as_json)
        if foreign:
            raise InputError(f"{foreign}; {robot.name}'s axes were stopped, but the board may have others that move")
