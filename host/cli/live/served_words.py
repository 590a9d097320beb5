"""What `steptwin serve` prints of its board: the banner, the line of its status, the report at its end."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.cli.output import Columns, print_rows, say, warn
from steptwin.host.cli.run.faults_on_purpose import print_struck
from steptwin.host.cli.run.verdict_text import USUAL_DRIVERS
from steptwin.host.common.processes import ClockStood

if TYPE_CHECKING:
    from steptwin.host.twin.live.served_board import ServedBoard


@contextmanager
def status_line(served: "ServedBoard") -> Iterator[Callable[[], None]]:
    """Yield a callback that updates a status on stderr; it does nothing where stderr is not a terminal."""
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
    """Return what the board is and where, in lines."""
    board = served.board
    name = board.driver_profile.name
    drivers = "" if name == USUAL_DRIVERS else f", drivers: {name}"
    drivers += "" if board.rotors is None else ", motors turn with it ([A] masses)"
    control = (
        []
        if served.control is None
        else [f"control port at {served.control.address}, for steptwin inject --control {served.control.address}"]
    )
    return [
        f"SIMULATED {board.robot.name}: {' '.join(board.robot.joint_names)}, "
        f"nodes {_nodes(board.axes_per_board)}, {board.bus.bitrate // 1000} kbit/s, "
        f"{board.live.pacer.speed:g} x real time{drivers}",
        served.title,
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


_ROTORS: Final[Columns] = {
    "motor": "{0[name]}",
    "load angle deg": "{0[load_angle_deg]:.1f}",
    "at s": "{0[load_angle_at_s]:.3f}",
    "first slip s": lambda joint: "-" if joint["first_slip_s"] is None else f"{joint['first_slip_s']:.3f}",
    "lost steps": "{0[lost_full_steps]:g}",
    "winding degC": "{0[winding_celsius]:.1f}",
}
_AXES: Final[Columns] = {
    "axis": "{0[name]}",
    "start": "{0[steps_start]}",
    "end": "{0[steps_end]}",
    "pulses": "{0[pulses]}",
    "broken": "{0[violations]}",
}


def print_served(document: dict[str, Any], folder: Path | None) -> None:
    """Print the final report of a board, and the folder with its files if there is one."""
    print_rows(_AXES, document["axes"])
    bus, real_time = document["bus"], document["real_time"]
    say(f"bus: {bus['frames']} frames at {bus['bitrate'] // 1000} kbit/s, {bus['load_percent']:.1f} % load")
    for mismatch in document["mismatches"]:
        warn(mismatch)
    if "motors" in document:
        print_rows(_ROTORS, document["motors"]["joints"])
    for what, text in _late(real_time).items():
        say(f"{what} late, ms (p50 p99 max): {text}, of {real_time[what]['count']}")
    if real_time["stalls"]["count"]:
        say(str(ClockStood(**real_time["stalls"])))
    print_struck(document)
    say(f"SIMULATED {document['simulated_s']:.1f} s in {document['wall_s']:.1f} s")
    if folder is not None:
        say(f"report, edges and bus log are in {folder}/")
