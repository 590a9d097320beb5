"""`steptwin pause|resume|speed|stop|estop|reset|outputs ROBOT --connect ...`: halt a live board, let it go on."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import print_table
from steptwin.host.common.bad_input import shortened
from steptwin.host.common.choices import LEVELS
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import digits_in

if TYPE_CHECKING:
    from steptwin.host.operate.recovering import AxisState
    from steptwin.host.operate.session import Session

_EXAMPLES: Final = ("ar4-mk3 --connect 127.0.0.1", "ar4-mk3 -i socketcan -c can0")
_CLOCKS_S: Final = 0.5
"""Longest stop of an emulated board's clock since a fault, on a slow computer."""


@command(*_EXAMPLES)
def pause(live: SessionOptions, robot: RobotName = None) -> None:
    """Halt the running trajectory on its path; the program that streams it keeps the queue filled."""
    from steptwin.host.client.pausing import pause_trajectory
    from steptwin.host.client.stopping import saying_if_unsure

    loaded = live.robot(robot)
    with saying_if_unsure(), live.session(loaded) as session:
        session.require_present()
        halted = pause_trajectory(session.machine)
    live.tell_of(loaded, {"halted": halted}, "halted" if halted else "not halted: the trajectory ended first")


@command(*_EXAMPLES)
def resume(live: SessionOptions, robot: RobotName = None) -> None:
    """Continue a halted trajectory."""
    from steptwin.host.client.pausing import resume_trajectory

    loaded = live.robot(robot)
    with live.session(loaded) as session:
        session.require_present()
        resume_trajectory(session.machine)
    live.tell_of(loaded, {"halted": False}, "goes on")


@command("ar4-mk3 50 --connect 127.0.0.1", "ar4-mk3 120 --json --connect 127.0.0.1")
def speed(
    live: SessionOptions,
    words: list[str] | None = argument(
        "ROBOT PERCENT", "The robot, and the percentage of the planned speed, 10 to 150."
    ),
) -> None:
    """Make the running trajectory slower or faster, on its path; the next one begins at 100 %.

    No joint or driver exceeds its limits: more than the motion allows is refused, with the highest speed that passes.
    """
    from steptwin.host.client.pausing import change_speed, check_speed

    loaded, rest = live.robot_and_rest(words)
    text = rest[0].removesuffix("%") if rest else ""
    percent = digits_in(text)
    if len(rest) != 1 or percent is None:
        shown = shortened(" ".join(rest)) or "nothing"
        raise InputError(f"after the robot: a whole number of percent, such as 50, not {shown}")
    check_speed(percent)
    with live.session(loaded) as session:
        session.require_present()
        highest = change_speed(session.machine, percent)
    document = {"speed_percent": percent, "highest_percent": highest}
    live.tell_of(loaded, document, f"goes on at {percent} % of the planned speed")


@command(*_EXAMPLES)
def stop(live: LiveOptions, robot: RobotName = None) -> None:
    """Stop all axes together by a quick stop; they hold their positions afterwards."""
    from steptwin.host.operate.recovering import stop

    _stop_axes(live, robot, stop)


@command(*_EXAMPLES)
def estop(live: LiveOptions, robot: RobotName = None) -> None:
    """Stop all axes together, switch their power off and hold them until `steptwin reset`.

    This is stop category 1 of IEC 60204-1, in software: it does not replace an emergency stop switch.
    """
    from steptwin.host.operate.recovering import emergency_stop

    _stop_axes(live, robot, emergency_stop)


def _stop_axes(live: LiveOptions, name: str | None, stop: "Callable[[Session], list[AxisState]]") -> None:
    """Stop all axes of a live board, whichever robot's it is, and print their states.

    Only then check whose board it is, so a stop is never refused. For another robot's board, print no positions, whose
    units would be wrong, and raise InputError: that robot may have more axes.
    """
    from steptwin.host.client.stopping import saying_if_unsure

    robot = live.robot(name)
    unasked = SessionOptions(address=live.address, force=True)
    with saying_if_unsure(), unasked.session(robot) as session:
        states = stop(session)
        foreign = session.foreign_board()
        live.report_states(robot, states, positions=not foreign)
        if foreign:
            raise InputError(f"{foreign}; {robot.name}'s axes were stopped, but the board may have others that move")


@command("ar4-mk3 --connect 127.0.0.1", "ar4-mk3 --json --connect 127.0.0.1")
def reset(live: SessionOptions, robot: RobotName = None) -> None:
    """Reset the drives' faults, and start nodes that are stopped; the drives are off afterwards.

    Nodes that another master has stopped (NMT), or whose board has restarted, are started. A fault or an emergency stop
    that comes after this command was started stays. Exit code 3: a cause persists, or a later fault stays.
    """
    asked_s = time.monotonic()
    from steptwin.host.operate.recovering import reset

    loaded = live.robot(robot)
    with live.session(loaded, waking=True) as session:
        states = reset(session, age_s=max(0.0, time.monotonic() - asked_s - _CLOCKS_S))
    live.report_states(loaded, states)


@command("corexy-gantry --connect 127.0.0.1", "corexy-gantry gripper on --connect 127.0.0.1")
def outputs(
    live: SessionOptions,
    words: list[str] | None = argument(
        "ROBOT [NAME on|off]", "The robot, and an output by its name in the robot's file."
    ),
) -> None:
    """List the digital outputs by their names in the robot's file, or switch one."""
    from steptwin.host.operate.inputs_outputs import no_such_output, read_outputs, switch_output

    loaded, rest = live.robot_and_rest(words)
    if rest and (len(rest) != 2 or rest[1] not in LEVELS):
        raise InputError(f"after the robot: nothing, or NAME and on or off, not {' '.join(rest)}")
    if rest and rest[0] not in loaded.outputs:
        raise no_such_output(loaded.name, rest[0], list(loaded.outputs))
    with live.session(loaded) as session:
        levels = switch_output(session, rest[0], on=LEVELS[rest[1]]) if rest else read_outputs(session)
    rows = [
        [name, output.joint, f"OUT{output.out}", "on" if levels[name] else "off"]
        for name, output in loaded.outputs.items()
    ]
    columns = ["output", "axis", "number", "is"]
    live.tell_of(loaded, {"outputs": levels}, lambda: print_table(columns, rows, text_columns=4))
