"""`steptwin serve ROBOT`: a live board in real time, for every program that speaks CAN."""

import gc
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import (
    AsJson,
    DriverProfileName,
    RobotFile,
    RobotName,
    joint_values,
    one_robot,
    warn_of_settings_left_out,
)
from steptwin.host.cli.connection import SOCKETCAND_PORT
from steptwin.host.cli.output import print_json, print_table, warn
from steptwin.host.cli.report import USUAL_DRIVERS
from steptwin.host.common.errors import BusError, InputError

if TYPE_CHECKING:
    from steptwin.emulator.live_loop import LiveLoop
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.endpoints import Endpoint
    from steptwin.host.twin.live_board import LiveBoard

_LOOPBACK = "127.0.0.1"
_STATUS_EVERY_S = 0.5
_YOUNG_OBJECTS = 700
"""Between two looks for garbage; Python's own choice, and short ones."""


@app.command()
def serve(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    host: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help=f"Where to listen; {_LOOPBACK} by default.")
    ] = None,
    port: Annotated[
        int | None, typer.Option(metavar="PORT", help="29536 by default, which is socketcand's; 0 takes a free one.")
    ] = None,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Listen at an address that other machines reach.")
    ] = False,
    interface: Annotated[
        str | None,
        typer.Option("--interface", "-i", metavar="NAME", help="Put the board on this python-can interface instead."),
    ] = None,
    channel: Annotated[str | None, typer.Option("--channel", "-c", metavar="NAME", help="Of that interface.")] = None,
    bitrate: Annotated[
        int | None, typer.Option("--bitrate", "-b", metavar="BIT/S", help="By default as the robot's file says.")
    ] = None,
    boards: Annotated[
        str | None,
        typer.Option(metavar="N,N,...", help="Axes of each board, in the order of the joints; by default one has all."),
    ] = None,
    speed: Annotated[float, typer.Option(metavar="FACTOR", help="Simulated seconds per second.")] = 1.0,
    stand_at: Annotated[
        str | None, typer.Option(metavar="'Q1 Q2 ...'", help="Where the machine stands; by default at its home.")
    ] = None,
    driver_profile: DriverProfileName = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Record report, edges and bus log into this folder.")
    ] = None,
    log: Annotated[str | None, typer.Option(metavar="FILE", help="Record the bus log into this file.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run a robot's board, or several, in real time, for every program that speaks CAN, until Ctrl-C.

    The board is behind a socketcand server, to which any number of python-can programs connect; they see each other's
    frames. With -i it is on a bus of python-can instead: virtual, socketcan, socketcand, ...
    """
    from steptwin.host.record.folder import prepare_folder
    from steptwin.host.twin.axes_per_board import read_axes_per_board
    from steptwin.host.twin.kernels import fastest_kernel
    from steptwin.host.twin.live_board import LiveBoard

    loaded = one_robot(robot, robot_file)
    standing = list(loaded.home)
    if stand_at is not None:
        standing = joint_values(stand_at.split(), loaded.joint_names, "--stand-at")
        _warn_outside(loaded, standing)
    bits_per_s = _bitrate(loaded, bitrate)
    _check_speed(speed)
    warn_of_settings_left_out(loaded, driver_profile)  # what is wrong with it is said before a port is opened
    axes_per_board = None if boards is None else read_axes_per_board(boards, len(loaded.joints))
    folder = None if out is None else prepare_folder(out)
    with _endpoint(interface, channel, bits_per_s, host, port, allow_remote=allow_remote) as endpoint:
        board = LiveBoard(
            loaded,
            standing,
            fastest_kernel(),
            bitrate=bits_per_s,
            speed=speed,
            axes_per_board=axes_per_board,
            out=folder,
            log=None if log is None else Path(log),
            driver_profile_name=driver_profile,
        )
        failure = _run(board, endpoint, lambda: typer.echo(_banner(board, endpoint), err=as_json))
    document = board.report() | {endpoint.kind: endpoint.figures()}
    board.close(document)
    if as_json:
        print_json(document)
    else:
        _print_report(document, folder)
    if failure:
        raise BusError(failure)


# --- what was asked for


def _warn_outside(robot: "Robot", standing: list[float]) -> None:
    """A machine may stand on its limit switches, beyond what it is sent to; anything else is more likely a slip."""
    from steptwin.host.operate.moving import check_goal

    try:
        check_goal(robot, standing)
    except InputError as error:
        warn(f"--stand-at: {error}")


def _bitrate(robot: "Robot", bitrate: int | None) -> int:
    from steptwin.protocol.frame import BITRATES

    if bitrate is not None and bitrate not in BITRATES:
        raise InputError(f"--bitrate {bitrate}: is none of {', '.join(map(str, BITRATES))}")
    return bitrate or robot.board.bitrate


def _check_speed(speed: float) -> None:
    from steptwin.emulator.pacer import SPEED_MAX, SPEED_MIN

    if not SPEED_MIN <= speed <= SPEED_MAX:
        raise InputError(f"--speed {speed:g}: is not from {SPEED_MIN:g} to {SPEED_MAX:g}")


def _endpoint(
    interface: str | None,
    channel: str | None,
    bitrate: int,
    host: str | None,
    port: int | None,
    *,
    allow_remote: bool,
) -> "Endpoint":
    from steptwin.host.twin.endpoints import CanEndpoint, SocketcandEndpoint

    if interface is None:
        if channel is not None:
            raise InputError(f"--channel {channel}: is for an --interface, and there is none")
        endpoint = SocketcandEndpoint(
            host or _LOOPBACK, SOCKETCAND_PORT if port is None else port, allow_remote=allow_remote
        )
        if endpoint.remote:
            warn(f"{endpoint.title}: other machines can drive this board")
        return endpoint
    more: dict[str, str | int] = {}
    if interface == "socketcand":
        more = {"host": host or _LOOPBACK, "port": port or SOCKETCAND_PORT}
    else:
        for option, value in (("--host", host), ("--port", port)):
            if value is not None:
                raise InputError(f"{option} {value}: is for a socketcand server, not for --interface {interface}")
    if allow_remote:
        raise InputError(f"--allow-remote: is for listening, not for --interface {interface}")
    return CanEndpoint(interface, channel, bitrate, more)


# --- while it runs


def _run(board: "LiveBoard", endpoint: "Endpoint", announce: Callable[[], None]) -> str | None:
    """Announce the board and let it live until a signal, or until the endpoint fails; return why it did."""
    from steptwin.emulator.live_loop import LiveLoop
    from steptwin.host.twin.live_board import RECORD_EVERY_S

    with LiveLoop(board.live) as loop, _until_a_signal(loop):
        endpoint.attach(loop)
        try:
            announce()
            loop.call_every(RECORD_EVERY_S, board.record)
            with _status_line(board, endpoint) as update:
                loop.call_every(_STATUS_EVERY_S, update)
                # Numba's objects are many: looking through them again and again takes many ticks. So may young ones.
                gc.freeze()
                gc.set_threshold(_YOUNG_OBJECTS)
                loop.run()
        finally:
            endpoint.close()
    board.record()
    return endpoint.failure


@contextmanager
def _until_a_signal(loop: "LiveLoop") -> Iterator[None]:
    """Ctrl-C and SIGTERM end the loop in order; a second one interrupts whatever is going on."""

    def stop(_number: int, _frame: object) -> None:
        loop.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _status_line(board: "LiveBoard", endpoint: "Endpoint") -> Iterator[Callable[[], None]]:
    """A line on stderr, if that is a terminal, which says how it goes as often as the callback is called."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda: None
        return
    with Live(console=console, auto_refresh=False, transient=True) as line:
        yield lambda: line.update(Text(_status(board, endpoint), no_wrap=True, overflow="ellipsis"), refresh=True)


def _status(board: "LiveBoard", endpoint: "Endpoint") -> str:
    """In two lines of 80 characters."""
    minutes, seconds = divmod(round(board.wall_s), 60)
    late = ", ".join(f"{what} {text}" for what, text in _late(board.lateness()).items())
    return (
        f"SIMULATED {board.robot.name} {minutes}:{seconds:02d}, {endpoint.status()}, "
        f"{board.bus.frames} frames, {board.bus_load_percent:.1f} % load\nlate, ms (p50 p99 max): {late}"
    )


# --- what is said


def _banner(board: "LiveBoard", endpoint: "Endpoint") -> str:
    name = board.driver_profile.name
    drivers = "" if name == USUAL_DRIVERS else f", drivers: {name}"
    return (
        f"SIMULATED {board.robot.name}: {' '.join(board.robot.joint_names)}, "
        f"nodes {_nodes(board.axes_per_board)}, {board.bus.bitrate // 1000} kbit/s, "
        f"{board.live.pacer.speed:g} x real time{drivers}\n{endpoint.title}\nCtrl-C ends it"
    )


def _nodes(axes_per_board: Sequence[int]) -> str:
    """Each board's node ids."""
    from steptwin.protocol.frame import FIRST_NODE_ID

    lasts = list(accumulate(axes_per_board, initial=FIRST_NODE_ID - 1))[1:]
    ranges = [f"0x{last - axes + 1:02X} to 0x{last:02X}" for axes, last in zip(axes_per_board, lasts, strict=True)]
    return ranges[0] if len(ranges) == 1 else f"{', '.join(ranges)} on {len(ranges)} boards"


def _late(lateness: dict[str, Any]) -> dict[str, str]:
    """p50, p99 and max in ms, of ticks and of frames."""
    return {
        what: " ".join(f"{lateness[what][f'late_us_{key}'] / 1000:.2f}" for key in ("p50", "p99", "max"))
        for what in ("ticks", "frames")
    }


def _print_report(document: dict[str, Any], folder: Path | None) -> None:
    rows = [
        [axis["name"], *(str(axis[key]) for key in ("steps_start", "steps_end", "pulses", "violations"))]
        for axis in document["axes"]
    ]
    print_table(["axis", "start", "end", "pulses", "broken"], rows)
    bus, real_time = document["bus"], document["real_time"]
    typer.echo(f"bus: {bus['frames']} frames at {bus['bitrate'] // 1000} kbit/s, {bus['load_percent']:.1f} % load")
    for what, text in _late(real_time).items():
        typer.echo(f"{what} late, ms (p50 p99 max): {text}, of {real_time[what]['count']}")
    typer.echo(f"SIMULATED {document['simulated_s']:.1f} s in {document['wall_s']:.1f} s")
    if folder is not None:
        typer.echo(f"report, edges and bus log are in {folder}/")
