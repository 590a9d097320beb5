"""Frame of the commands for a live board: their common options, their session, their answer."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.host.cli.arguments import RobotOptions
from steptwin.host.cli.options import LIVE_PANEL, option, switch
from steptwin.host.cli.output import Columns, fixed, print_rows
from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import digits_in

if TYPE_CHECKING:
    from steptwin.host.client import Link
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.operate.recovering import AxisState
    from steptwin.host.operate.session import Session
    from steptwin.host.robots.robot import Robot
live_option: Callable[..., Any] = partial(option, rich_help_panel=LIVE_PANEL)
live_switch: Callable[..., Any] = partial(switch, rich_help_panel=LIVE_PANEL)


@dataclass(frozen=True, slots=True)
class BoardAddress:
    """Address of a live board from a command's options; without any option there is none."""

    connect: str | None = live_option(
        "HOST[:PORT]", "Board behind a socketcand server; port 29536 by default.", "--connect"
    )
    interface: str | None = live_option(
        "NAME", "Board on an interface of python-can, such as socketcan.", "--interface", "-i"
    )
    channel: str | None = live_option("NAME", "Channel of the interface or of the server.", "--channel", "-c")
    bitrate: int | None = live_option(
        "BIT/S", "Bit rate of the interface; by default the robot file's.", "--bitrate", "-b"
    )

    def connection(self, robot: "Robot | None") -> "Connection | None":
        """Return the connection of the options; None without any.

        Raises:
            InputError: options exclude each other, or python-can has no such interface.
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
        from steptwin.host.client.links.bus_link import check_interface

        check_interface("--interface", self.interface)
        return Connection(self.interface, self.channel, self.bitrate or (robot.board.bitrate if robot else None))

    def required(self, robot: "Robot | None") -> "Connection":
        """Return the connection of the options; raise InputError also without any."""
        found = self.connection(robot)
        if found is None:
            raise InputError("which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL")
        return found


Force = Annotated[
    bool, live_switch("Go on although the board carries another robot's name, or has other units.", "--force")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOptions(RobotOptions):
    """Options of every command for a live board: the robot's file, the board's address, the form of the answer."""

    address: BoardAddress

    @contextmanager
    def link(self, robot: "Robot") -> "Iterator[Link]":
        """Open a link and close it after the block; BusError if the bus cannot be opened."""
        from steptwin.host.client.links.bus_link import BusLink, open_bus

        found = self.address.required(robot)
        with BusLink(open_bus(found), found.title) as link:
            yield link

    def report_states(self, robot: "Robot", states: "list[AxisState]", *, positions: bool = True) -> None:
        """Print each axis' state, as a document or a table; `positions` is False if they are unknown."""
        unknown = {} if positions else {"position": None, "position_known": False}
        columns = dict(list(_STATES.items())[: None if positions else 2])
        self.tell_of(
            robot,
            {"axes": [asdict(state) | unknown for state in states]},
            lambda: print_rows(columns, states, text_columns=min(3, len(columns))),
        )


_STATES: Final[Columns] = {
    "axis": "{0.name}",
    "state": "{0.state}",
    "known": lambda state: "yes" if state.position_known else "no",
    "position": lambda state: fixed(state.position),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions(LiveOptions):
    """Options of a command that first checks that the board is this robot's."""

    force: Force = False

    @contextmanager
    def session(self, robot: "Robot", *, waking: bool = False) -> "Iterator[Session]":
        """Open a link with a session of the robot, and close it after the block.

        The block is one action: a stop ends all of it. `waking` starts nodes that another master has stopped. Raise
        InputError, unless forced, if the board has another robot's name or units.
        """
        from steptwin.host.operate.recovering import wake
        from steptwin.host.operate.session import Session

        with self.link(robot) as link:
            session = Session(link, robot)
            with session.one_action():
                if waking:
                    wake(session)
                self._check_board(session)
                yield session

    @contextmanager
    def lasting_session(self, robot: "Robot") -> "Iterator[Session]":
        """Open a link with a session for several actions, each ended by a stop; otherwise as `session`."""
        from steptwin.host.operate.session import Session

        with self.link(robot) as link:
            session = Session(link, robot)
            self._check_board(session)
            yield session

    def _check_board(self, session: "Session") -> None:
        foreign = None if self.force else session.foreign_board()
        if foreign:
            raise InputError(f"{foreign}; --force goes on all the same")


def host_and_port(option: str, text: str, usual_port: int, *, optional: bool = False) -> tuple[str, int]:
    """Split HOST:PORT; an IPv6 address is in brackets, as in URLs (RFC 3986), since it has colons itself.

    Args:
        option: name of the option in messages.
        text: its value.
        usual_port: port in examples, and the default.
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
    number = digits_in(port)
    if not host or number is None or not 0 < number < 1 << 16:
        raise InputError(f"{option} {text}: is not of the form HOST:PORT, such as {socketcand.LOOPBACK}:{usual_port}")
    return host, number
