"""Make the trajectory that the axes run slower or faster than planned, on its path, by the time that pausing halts.

Another program may be streaming the trajectory, and it goes on doing so. It has told the axes how fast its records may
be run. Each question here is one frame, and so is its answer, as SDO dialogues must be beside those of that program.
"""

from collections.abc import Sequence

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.machine import Machine
from steptwin.host.client.pausing import running_axes
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.protocol import od
from steptwin.protocol.od import FULL_RATE_Q16, RATE_PERCENT_MAX, RATE_PERCENT_MIN, rate_q16


def check_speed(percent: int) -> None:
    """Raise InputError unless a speed is one that a trajectory may have, if its own limits allow it."""
    if not RATE_PERCENT_MIN <= percent <= RATE_PERCENT_MAX:
        nearest = min(max(percent, RATE_PERCENT_MIN), RATE_PERCENT_MAX)
        raise InputError(
            f"speed {percent} %: is not from {RATE_PERCENT_MIN} to {RATE_PERCENT_MAX} %; {nearest} % passes"
        )


def change_speed(machine: Machine, percent: int) -> int:
    """Let the trajectory run at a percentage of its planned speed; return the highest that it may have, in percent.

    The axes come to the new speed within the deceleration of a halt, all in step. The speed stays to the trajectory's
    end, also through a pause; the next one begins as planned.

    Raises:
        InputError: no axis runs a trajectory, the axes are on several boards, or the speed is too low or too high.
        BusError: a node does not answer.
        DeviceFaultError: a node refuses.
    """
    check_speed(percent)
    running = running_axes(machine, "make slower or faster")
    if running[0].read(od.BOARD_AXES) < len(machine.axes):
        raise InputError(f"speed {percent} %: the axes are on several boards, whose times would part; 100 % passes")
    highest = _highest_percent(running)
    if percent > highest:
        raise InputError(
            f"speed {percent} %: this motion can be made at most {highest} % as fast as planned, by its limits;"
            f" {highest} % passes"
        )
    try:
        running[0].write(od.GROUP_RATE_Q16, rate_q16(percent))
    except DeviceFaultError:
        running_axes(machine, "make slower or faster")  # it may have come to its end meanwhile
        raise
    return highest


def _highest_percent(running: Sequence[AxisClient]) -> int:
    return min(axis.read(od.GROUP_RATE_HIGHEST_Q16) for axis in running) * 100 // FULL_RATE_Q16


def present_speed_percent(axes: Sequence[AxisClient]) -> float | None:
    """Return the present speed of the trajectory in percent of the planned one; 0 in a pause, None without one."""
    running = next((axis for axis in axes if axis.interpolating), None)
    return None if running is None else round(running.read(od.GROUP_RATE_NOW_Q16) * 100 / FULL_RATE_Q16, 1)
