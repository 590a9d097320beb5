"""`steptwin serve ROBOT`: run a live board in real time, for every program that speaks CAN."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, fields
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, RobotName, RobotOptions, machine_for, naming_machine_options
from steptwin.host.cli.live.served_programs import (
    CommandOptions,
    ServedCommand,
    ServedPlace,
    ServedProgram,
    reached_at,
)
from steptwin.host.cli.options import of_features, option, switch
from steptwin.host.cli.output import say, say_compiling, warn
from steptwin.host.cli.run.hooks import tellings
from steptwin.host.cli.run.verdict_text import USUAL_DRIVERS, print_axes
from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import BusError, InputError, RecordingError
from steptwin.host.common.features import giving
from steptwin.host.common.processes import ClockStood, Slowness, collecting_often, on_signals
from steptwin.host.twin.machine.machine_options import MachineOptions

if TYPE_CHECKING:
    from steptwin.host.common.features import LiveWords
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.live.live_board import LiveBoard
    from steptwin.host.twin.live.served_board import ServedBoard


_STATUS_EVERY_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointOptions:
    """Options for the address of a served board, and for its speed."""

    host: str | None = option("ADDRESS", f"Address to listen at; {socketcand.LOOPBACK} by default.")
    port: int | None = option("PORT", f"Port to listen at; {socketcand.PORT} by default; 0 takes a free one.")
    control_port: int | None = option("PORT", "Port for `steptwin inject`, on this machine; 0 takes a free one.")
    allow_remote: bool = switch("Permit an address that other machines reach.")
    interface: str | None = option("NAME", "Put the board on an interface of python-can instead.", "--interface", "-i")
    channel: str | None = option("NAME", "Its channel.", "--channel", "-c")
    speed: float = option("FACTOR", "Simulated seconds in a second.", default=1.0)

    def reached(self, served: "ServedBoard") -> list[str]:
        """Return the words of a live command's options that reach the board from this machine."""
        if self.interface is None:
            return ["--connect", f"{reached_at(self.host)}:{served.port}"]
        return ["-i", self.interface, *(() if self.channel is None else ("-c", self.channel))]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingOptions:
    """Options for the files of a served board."""

    out: str | None = option("DIR", "Folder to record report, edges and bus log in.")
    log: str | None = option("FILE", "File to record the bus log in.")
    replace: bool = switch("Let --out and --log replace what the folder or the file holds.")


_NAMED: Final = (*(each.name for group in (EndpointOptions, RecordingOptions) for each in fields(group)),)
"""Arguments of a served board that errors name as options."""


@command("ar4-mk3 --control-port 0", "ar4-mk3 --machine boards=4,2 --out out/live --port 0")
def serve(
    which: RobotOptions,
    endpoint: EndpointOptions,
    recording: RecordingOptions,
    machine: MachineOptions,
    beside: CommandOptions,
    offered: Sequence[ServedProgram] = of_features("serve_options"),
    robot: RobotName = None,
) -> None:
    """Run a robot's board, or several, in real time until Ctrl-C.

    Any number of python-can programs connect to it through a socketcand server; they see each other's frames. With -i
    the board is on a bus of python-can instead: virtual, socketcan, socketcand, ... With --exec a program runs beside
    it, which finds the server's HOST:PORT in STEPTWIN_CAN and the control port's in STEPTWIN_CONTROL.
    """
    from steptwin.host.twin.live.served_board import ServedBoard
    from steptwin.host.twin.machine.drivers import driver_profile
    from steptwin.host.twin.machine.kernels import telling_of_compiling

    loaded = which.robot(robot)
    wanted = [each for each in offered if each.wanted]
    program = ServedCommand(beside, endpoint.interface)
    machine = machine_for(loaded, machine)  # bad input is reported before a port is opened
    _warn_outside(loaded, machine)
    for lines in machine.warnings(loaded, driver_profile(loaded.board, machine.driver_profile)).values():
        for line in lines:
            warn(line)
    with ExitStack() as running:
        told = [running.enter_context(each.running(to_stderr=which.as_json)) for each in wanted]
        with telling_of_compiling(say_compiling), naming_machine_options(*_NAMED):
            served = ServedBoard(
                loaded,
                host=endpoint.host,
                port=endpoint.port,
                control_port=endpoint.control_port or (0 if wanted else endpoint.control_port),
                allow_remote=endpoint.allow_remote,
                interface=endpoint.interface,
                channel=endpoint.channel,
                speed=endpoint.speed,
                out=recording.out,
                log=recording.log,
                replace=recording.replace,
                **machine.keywords,
            )
        if served.endpoint.remote:
            warn(f"{served.title}: other machines can drive this board")
        file = which.robot_file
        name = ["--robot-file", file] if robot is None and file else [robot or loaded.name]
        control = None if served.control is None else served.control.address
        place = ServedPlace(name, endpoint.reached(served), control)

        def announce() -> None:
            which.add(*banner(served), *(() if wanted else ("Ctrl-C ends it",)))
            for tell in told:
                tell(place)
            program.start(served, endpoint.host, to_stderr=which.as_json)

        try:
            document, failure = _serve(which, served, announce, recording.out, quiet=program.wanted)
        finally:
            program.end()
    if failure:
        raise failure
    missed = [why for each in tellings() if (why := each.served_failure(document))]
    say(*missed, err=True)
    end_unless(not missed)
    program.pass_on()


def _serve(
    answer: AnswerOptions, served: "ServedBoard", announce: Callable[[], None], out: str | None, *, quiet: bool
) -> tuple[dict[str, Any], BusError | RecordingError | None]:
    """Run the board until a signal ends it and print its report; return the report, and the error if any."""
    # A second signal changes nothing: the files are being completed then.
    with on_signals(lambda _number, _frame: served.stop()):
        failure = _run(served, announce, quiet=quiet)
        document = served.report()
        answer.tell(
            document, lambda: print_served(document, None if out is None or served.board.failures else Path(out))
        )
    return document, failure


def _warn_outside(robot: "Robot", machine: MachineOptions) -> None:
    """Warn of joints outside their limits: a machine may be on a limit switch, but a typing error is likelier."""
    from steptwin.host.operate.moving import check_goal

    standing = machine.joints(robot)
    try:
        check_goal(robot, standing)
    except InputError as error:
        warn(f"--machine stand-at: {error}")


def _run(served: "ServedBoard", announce: Callable[[], None], *, quiet: bool) -> BusError | RecordingError | None:
    """Announce the board and run it until it is stopped, or until its bus fails; return the error if any.

    `quiet` leaves the terminal to another program.
    """
    with nullcontext(lambda: None) if quiet else status_line(served) as update:
        announce()
        served.call_every(_STATUS_EVERY_S, update)
        served.call_every(_STATUS_EVERY_S, _warning_of_slowness(served.board))
        served.call_every(_STATUS_EVERY_S, _warning_of_failures(served))
        served.call_every(_STATUS_EVERY_S, _warning_by_features(served.board))
        try:
            with collecting_often():
                served.serve_forever()
        except (BusError, RecordingError) as error:
            return error
    return None


def _warning_of_slowness(board: "LiveBoard") -> Callable[[], None]:
    """Return a function that warns if the computer is too slow for the board."""
    slowness = Slowness()

    def tell() -> None:
        stood = ClockStood(**board.stalls())
        if slowness.worth_telling(stood):
            warn(str(stood))

    return tell


def _warning_of_failures(served: "ServedBoard") -> Callable[[], None]:
    """Return a function that warns of each recording that has ended, once."""
    told: list[RecordingError] = []

    def tell() -> None:
        for failure in served.board.failures:
            if failure not in told:
                told.append(failure)
                warn(f"{failure}; the board runs on")

    return tell


def _warning_by_features(board: "LiveBoard") -> Callable[[], None]:
    """Return a function that prints each warning of a feature once."""
    told: set[str] = set()
    words = [(words, board.parts[name]) for name, words in _words_of(board).items()]

    def tell() -> None:
        for live, part in words:
            for line in live.warnings(part.seen()):
                if line not in told:
                    told.add(line)
                    warn(line)

    return tell


def _words_of(board: "LiveBoard") -> "dict[str, LiveWords]":
    """Return the texts of features about a board with a part of theirs, by name."""
    return {feature.name: live() for feature, live in giving("live") if feature.name in board.parts}


@contextmanager
def status_line(served: "ServedBoard") -> Iterator[Callable[[], None]]:
    """Yield a function that updates a status on stderr; it does nothing if stderr is not a terminal."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda: None
        return
    with Live(console=console, auto_refresh=False, transient=True) as line:
        yield lambda: line.update(Text(_status(served), no_wrap=True, overflow="ellipsis"), refresh=True)


def _status(served: "ServedBoard") -> str:
    """Return the status, in two lines of 80 characters."""
    board = served.board
    minutes, seconds = divmod(round(board.wall_s), 60)
    late = ", ".join(f"{what} {text}" for what, text in _late(board.lateness()).items())
    return (
        f"SIMULATED {board.robot.name} {minutes}:{seconds:02d}, {served.endpoint.status()}, "
        f"{board.bus.frames} frames, {board.bus_load_percent:.1f} % load\nlate, ms (p50 p99 max): {late}"
    )


def banner(served: "ServedBoard") -> list[str]:
    """Return the board's description and address, as lines."""
    board = served.board
    name = board.driver_profile.name
    drivers = "" if name == USUAL_DRIVERS else f", drivers: {name}"
    has = [words for live in _words_of(board).values() if (words := live.banner())]
    drivers += "".join(f", {words}" for words in has)
    control = (
        []
        if served.control is None
        else [f"control port at {served.control.address}, for steptwin inject --control {served.control.address}"]
    )
    besides = [line for part in board.parts.values() for line in part.described()]
    return [
        f"SIMULATED {board.robot.name}: {' '.join(board.robot.joint_names)}, "
        f"nodes {_nodes(board.axes_per_board)}, {board.bus.bitrate // 1000} kbit/s, "
        f"{board.live.pacer.speed:g} x real time{drivers}",
        served.title,
        *besides,
        *control,
    ]


def _nodes(axes_per_board: Sequence[int]) -> str:
    """Return the node ids of each board."""
    from steptwin.protocol.frame import FIRST_NODE_ID

    lasts = list(accumulate(axes_per_board, initial=FIRST_NODE_ID - 1))[1:]
    ranges = [f"0x{last - axes + 1:02X} to 0x{last:02X}" for axes, last in zip(axes_per_board, lasts, strict=True)]
    return ranges[0] if len(ranges) == 1 else f"{', '.join(ranges)} on {len(ranges)} boards"


def _late(lateness: dict[str, Any]) -> dict[str, str]:
    """Return the median, 99th percentile and maximum lateness of ticks and of frames, in ms, as text."""
    return {
        what: " ".join(f"{lateness[what][f'late_us_{key}'] / 1000:.2f}" for key in ("p50", "p99", "max"))
        for what in ("ticks", "frames")
    }


def print_served(document: dict[str, Any], folder: Path | None) -> None:
    """Print the final report of a board, and the folder with its files if there is one."""
    print_axes(document)
    bus, real_time = document["bus"], document["real_time"]
    say(f"bus: {bus['frames']} frames at {bus['bitrate'] // 1000} kbit/s, {bus['load_percent']:.1f} % load")
    for mismatch in document["mismatches"]:
        warn(mismatch)
    for feature, live in giving("live"):
        if feature.name in document:
            live().print_report(document[feature.name])
    for what, text in _late(real_time).items():
        say(f"{what} late, ms (p50 p99 max): {text}, of {real_time[what]['count']}")
    if real_time["stalls"]["count"]:
        say(str(ClockStood(**real_time["stalls"])))
    for each in tellings():
        each.print_served(document)
    say(f"SIMULATED {document['simulated_s']:.1f} s in {document['wall_s']:.1f} s")
    if folder is not None:
        say(f"report, edges and bus log are in {folder}/")
