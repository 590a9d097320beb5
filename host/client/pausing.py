"""Halt a running trajectory on its path, resume it, and run it slower or faster than planned.

Another program may be streaming the trajectory; it continues to do so. A node serves one SDO transfer at a time, so a
request could disturb that program. Therefore a pause uses process data only, and a request about the speed and its
answer are one frame each. The streaming program has already set the highest allowed speed of its records.
"""

from collections.abc import Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.machine import Machine
from steptwin.host.client.reports import await_reports, check_faults
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, REST_TIMEOUT_S, require
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control
from steptwin.protocol.od import FULL_RATE_Q16, RATE_PERCENT_MAX, RATE_PERCENT_MIN, rate_q16

_RUN: Final = ENABLE_OPERATION | Control.START


def pause_trajectory(machine: Machine) -> bool:
    """Halt the trajectory and wait for standstill; a halted trajectory stays halted.

    Returns:
        True if the machine is halted; False if the trajectory has reached its end first.

    Raises:
        InputError: no axis runs a trajectory.
        BusError: the axes do not stop.
        DeviceFaultError: a fault has ended the trajectory meanwhile.
    """
    running = running_axes(machine, "pause")
    send_pause(running)
    require(
        machine,
        lambda: all(axis.halted or not axis.interpolating for axis in running),
        "the axes do not come to rest",
        REST_TIMEOUT_S,
    )
    check_faults(machine.link, machine.axes)
    if any(axis.halted for axis in running):
        return True
    send_resume(running)  # the next trajectory must not find the halt bit set
    return False


def resume_trajectory(machine: Machine) -> None:
    """Resume a halted trajectory, even if another program has halted it; do nothing if it is not halted.

    Raises:
        InputError: no axis runs a trajectory.
        BusError: the axes do not start.
        DeviceFaultError: a fault has ended the trajectory meanwhile.
    """
    running = running_axes(machine, "resume")
    send_resume(running)
    require(machine, lambda: not any(axis.halted for axis in running), "the axes do not go on", REPLY_TIMEOUT_S)
    check_faults(machine.link, machine.axes)


def abandon_trajectory(machine: Machine) -> None:
    """Halt the trajectory on its path and abandon it; the axes stay enabled. Raises as `pause_trajectory`.

    The halt slows the trajectory time, so all axes stay on the path until standstill.
    """
    if pause_trajectory(machine):
        machine.drop_trajectory()


def send_pause(axes: Sequence[AxisClient]) -> None:
    """Send the command to halt a trajectory on its path; do not wait, so any thread may call it."""
    for axis in axes:
        axis.send_interpolation_controlword(_RUN | Control.HALT)


def send_resume(axes: Sequence[AxisClient]) -> None:
    """Send the command to resume a trajectory; do not wait, so any thread may call it."""
    for axis in axes:
        axis.send_interpolation_controlword(_RUN)


def running_axes(machine: Machine, what: str) -> list[AxisClient]:
    """Return the axes that execute records; raise InputError, which names the action `what`, if none does.

    A node that is not OPERATIONAL sends no report and executes no records.
    """
    await_reports(machine, machine.axes)
    running = [axis for axis in machine.axes if axis.interpolating]
    if not running:
        raise InputError(f"nothing to {what}: no axis runs a trajectory")
    return running


def check_speed(percent: int) -> None:
    """Raise InputError if no trajectory may run at this speed."""
    if not RATE_PERCENT_MIN <= percent <= RATE_PERCENT_MAX:
        nearest = min(max(percent, RATE_PERCENT_MIN), RATE_PERCENT_MAX)
        raise InputError(
            f"speed {percent} %: is not from {RATE_PERCENT_MIN} to {RATE_PERCENT_MAX} %; {nearest} % passes"
        )


def change_speed(machine: Machine, percent: int) -> int:
    """Run the trajectory at a percentage of its planned speed; return the highest allowed percentage.

    The axes change to the new speed together, with the deceleration of a halt. The speed is valid until the end of the
    trajectory, also after a pause; the next trajectory begins as planned.

    Raises:
        InputError: no axis runs a trajectory, the axes are on several boards, or the speed is too low or too high.
        BusError: a node does not answer.
        DeviceFaultError: a node refuses the speed.
    """
    check_speed(percent)
    running = running_axes(machine, "make slower or faster")
    if running[0].read(od.BOARD_AXES) < len(machine.axes):
        raise InputError(f"speed {percent} %: the axes are on several boards, whose times would part; 100 % passes")
    highest = min(axis.read(od.GROUP_RATE_HIGHEST_Q16) for axis in running) * 100 // FULL_RATE_Q16
    if percent > highest:
        raise InputError(
            f"speed {percent} %: this motion can be made at most {highest} % as fast as planned, by its limits;"
            f" {highest} % passes"
        )
    try:
        running[0].write(od.GROUP_RATE_Q16, rate_q16(percent))
    except DeviceFaultError:
        running_axes(machine, "make slower or faster")  # it may have ended meanwhile
        raise
    return highest


def present_speed_percent(axes: Sequence[AxisClient]) -> float | None:
    """Return the trajectory's present speed in percent of the planned one; 0 in a pause, None without trajectory."""
    running = next((axis for axis in axes if axis.interpolating), None)
    return None if running is None else round(running.read(od.GROUP_RATE_NOW_Q16) * 100 / FULL_RATE_Q16, 1)
