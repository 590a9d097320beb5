"""The frame of the commands for a live board: the options that they share, the session that these open, the answer."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from steptwin.host.cli.arguments import AsJson, RobotFile, one_robot, robot_and_rest
from steptwin.host.cli.output import fixed, print_json, print_table, say
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

    def required(self, robot: "Robot | None") -> "Connection":
        """Return the connection that the options describe; raise InputError also when no option is given."""
        found = self.connection(robot)
        if found is None:
            raise InputError("which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL")
        return found


NOT_CONNECTED: Final = BoardAddress()
"""No board is named."""

Force = Annotated[bool, _live_option("--force", help="Go on although the board carries another robot's name.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions:
    """The options of every command for a live board: the robot's file, the board's place, the form of the answer."""

    robot_file: RobotFile = None
    address: BoardAddress
    as_json: AsJson = False

    def robot(self, name: str | None) -> "Robot":
        """Return the robot of a command without further words; raises as `one_robot`."""
        return one_robot(name, self.robot_file)

    def robot_and_rest(self, words: list[str] | None) -> "tuple[Robot, list[str]]":
        """Return the robot of a command with further words, and these; raises as the function of this name."""
        return robot_and_rest(words or [], self.robot_file)

    @contextmanager
    def link(self, robot: "Robot") -> "Iterator[Link]":
        """Open a link and close it after the block; BusError if the bus cannot be opened."""
        from steptwin.host.client.links.bus_link import BusLink, open_bus

        found = self.address.required(robot)
        with BusLink(open_bus(found), found.title) as link:
            yield link

    def tell(self, robot: "Robot", document: dict[str, Any], *lines: str) -> None:
        """Print what has come of a command: a JSON document with the robot's name, or lines."""
        if self.as_json:
            print_json({"robot": robot.name, **document})
        else:
            say(*lines)

    def tell_states(self, robot: "Robot", states: "list[AxisState]", *, positions: bool = True) -> None:
        """Print each axis' state, as a document or a table; without `positions` it says none, the document null."""
        if self.as_json:
            unknown = {} if positions else {"position": None, "position_known": False}
            print_json({"robot": robot.name, "axes": [asdict(state) | unknown for state in states]})
            return
        columns = ["axis", "state", "known", "position"][: None if positions else 2]
        rows = [
            [state.name, state.state, "yes" if state.position_known else "no", fixed(state.position)][: len(columns)]
            for state in states
        ]
        print_table(columns, rows, text_columns=min(3, len(columns)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions(LiveOptions):
    """The options of a command that asks whether the board is this robot's before it does anything."""

    force: Force = False

    @contextmanager
    def session(self, robot: "Robot", *, waking: bool = False) -> "Iterator[Session]":
        """Open a link with a session of the robot on it, and close it after the block.

        All that a command does in it is one action: a stop ends all of it. With `waking`, start nodes that another
        master has stopped. Unless forced, raise InputError if the board carries the name of another robot.
        """
        from steptwin.host.operate.recovering import wake
        from steptwin.host.operate.session import Session

        with self.link(robot) as link:
            session = Session(link, robot)
            with session.one_action():
                if waking:
                    wake(session)
                foreign = None if self.force else session.foreign_board()
                if foreign:
                    raise InputError(f"{foreign}; --force goes on all the same")
                yield session


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
