"""`steptwin doctor ROBOT` and `status ROBOT --connect ...`: check a live machine, and show its state."""

from itertools import groupby
from typing import TYPE_CHECKING, Final

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.options import switch
from steptwin.host.cli.output import (
    Columns,
    cells_of,
    fixed,
    pose_text,
    print_json_line,
    say,
    text_console,
    text_table,
)
from steptwin.host.common.bad_input import printable
from steptwin.host.common.errors import BusError, DeviceFaultError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import NoReturn

    from rich.console import Group

    from steptwin.host.operate.doctor import Check
    from steptwin.host.operate.session import Session
    from steptwin.host.operate.status import AxisStatus, MachineStatus
    from steptwin.host.robots.robot import Robot


@command("ar4-mk3 --connect 127.0.0.1", "ar4-mk3 -i pcan -c PCAN_USBBUS1 -b 500000")
def doctor(live: LiveOptions, robot: RobotName = None) -> None:
    """Check bus, nodes, drives, settings, inputs, supply, temperature and positions.

    It changes nothing. Exit code 4: the bus or a node does not answer; 3: another check fails.
    """
    loaded = live.robot(robot)
    checks = _checks(live, loaded)
    failed = [check for check in checks if not check.passed]
    listed = [{"name": check.name, "passed": check.passed, "found": check.found} for check in checks]
    live.tell_of(loaded, {"passed": not failed, "checks": listed})
    if failed:
        raise typer.Exit(max(check.exit_code for check in failed))


def _checks(live: LiveOptions, robot: "Robot") -> "list[Check]":
    """Make the checks; print each at once, unless the answer is one document."""
    from steptwin.host.operate.doctor import Check, examine
    from steptwin.host.operate.session import Session

    found = live.address.required(robot)
    checks: list[Check] = []

    def add(check: "Check") -> None:
        checks.append(check)
        if not live.as_json:
            say(f"[{' OK ' if check.passed else 'FAIL'}] {check.name}: {check.found}")

    try:
        with live.link(robot) as link:
            add(Check("bus", True, found.title))
            for check in examine(Session(link, robot)):
                add(check)
    except BusError as error:
        add(Check("bus", False, str(error), BusError.exit_code))
    return checks


_WATCH_EVERY_S = 0.5


@command("ar4-mk3 --connect 127.0.0.1", "ar4-mk3 --watch -i socketcan -c can0")
def status(
    live: SessionOptions,
    robot: RobotName = None,
    watch: bool = switch("Refresh twice a second, until Ctrl-C; with --json, a line each time."),
) -> None:
    """Show drives, positions, errors and queues. Exit code 3: a drive is in fault."""
    from steptwin.host.operate.status import read_status

    loaded = live.robot(robot)
    with live.session(loaded) as session:
        if watch:
            _watch(session, as_json=live.as_json)
        seen = read_status(session)
    live.tell(seen.to_dict(), lambda: _print(seen))
    faulty = [axis for axis in seen.axes if axis.in_fault]
    if faulty:
        raise DeviceFaultError(f"{faulty[0].name}: the drive is in {faulty[0].state}: {faulty[0].error or 'no reason'}")


def _watch(session: "Session", *, as_json: bool) -> "NoReturn":
    """Show the state twice a second: in place on a terminal, else one below the other."""
    from rich.live import Live

    from steptwin.host.operate.status import read_status

    console = text_console()
    if as_json or not console.is_terminal or console.is_dumb_terminal:
        while True:
            seen = read_status(session)
            if as_json:
                print_json_line(seen.to_dict())
            else:
                _print(seen)
                say("")
            session.link.wait(_WATCH_EVERY_S)
    with Live(console=console, auto_refresh=False) as place:
        while True:
            place.update(_shown(read_status(session), console.width), refresh=True)
            session.link.wait(_WATCH_EVERY_S)


def _print(seen: "MachineStatus") -> None:
    console = text_console()
    console.print(_shown(seen, console.width), soft_wrap=not console.is_terminal)


def _shown(seen: "MachineStatus", width: int) -> "Group":
    """Return a table of this width, with what does not fit below it."""
    from rich.console import Group
    from rich.text import Text

    table, _ = text_table(width, list(_COLUMNS), cells_of(_COLUMNS, seen.axes), text_columns=len(_COLUMNS) - 1)
    known = all(axis.position_known for axis in seen.axes)  # without a pose in spite of homed joints there is no tool
    lines = [pose_text(seen.pose)] if seen.pose else []
    lines += [] if seen.pose or known else ["tool: unknown, since not every axis knows where it is"]
    lines += [f"{axis.name}: {_health(axis)}" for axis in seen.axes]
    units = {axis.name: axis.unit for axis in seen.axes}
    lines += [
        f"{name}: {skew:+.4g} {units[name]} ahead of its joint's first motor" for name, skew in seen.skews.items()
    ]
    if seen.inputs:
        levels = (f"{name} {'on' if on else 'off'}" for name, on in seen.inputs.items())
        lines.append(f"inputs: {', '.join(levels)}")
    if seen.streaming:
        lines.append("a trajectory is running: no more questions are asked, so that its host is not disturbed")
        lines.append(f"speed: {seen.speed_percent:g} % of the planned one")
    return Group(table, *(Text(printable(line)) for line in lines))


_COLUMNS: Final[Columns] = {
    "axis": "{0.name}",
    "unit": "{0.unit}",
    "state": "{0.state}",
    "mode": "{0.mode}",
    "moves": lambda axis: "yes" if axis.moving else "no",
    "error": lambda axis: axis.error or "-",
    "known": lambda axis: "yes" if axis.position_known else "no",
    "position": lambda axis: fixed(axis.position),
}


def _in_a_row(errors: "Sequence[str]") -> list[str]:
    """Return each error once for consecutive equal ones, with their number."""
    rows = [(error, len(list(same))) for error, same in groupby(errors)]
    return [f"{number} x {error}" if number > 1 else error for error, number in rows]


def _health(axis: "AxisStatus") -> str:
    from steptwin.host.operate.joint_positions import HELD

    said = [HELD] if axis.emergency_stopped else []
    said.append("process data" if axis.operational else "no process data: the node is not OPERATIONAL")
    queue = axis.queue
    if queue is not None:
        closed = queue.free == 0 and "empty" in queue.flags  # after a stop or a profile move, until the host clears it
        places = "queue closed" if closed else f"queue {queue.free} free"
        said.append(places + (f" ({', '.join(queue.flags)})" if queue.flags else ""))
    if queue is not None and queue.gaps is not None:
        said.append(f"{queue.gaps} gaps, {queue.overflows} overflows, {queue.underruns} underruns")
        said.append(f"{queue.delayed_steps} delayed steps")
    if axis.frames_lost:
        said.append(f"{axis.frames_lost} frames of the board lost, the bus was too busy")
    if axis.emergencies_lost:
        said.append(f"{axis.emergencies_lost} EMCYs lost, too many waited: the bus was down, or 0x1015 is too long")
    if axis.supply_v is not None:
        said.append(f"{axis.supply_v:.2f} V, {axis.temperature_degc:.1f} degC")
    if axis.inputs:
        said.append(f"active: {', '.join(axis.inputs)}")
    if axis.history:
        said.append(f"earlier: {', '.join(_in_a_row(axis.history))}")
    return "; ".join(said)
