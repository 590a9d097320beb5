"""Halt the trajectory that the axes run, on its path, and resume it.

Another program may be streaming the trajectory, and it goes on doing so. So only process data is sent here: an SDO
request could disturb a dialogue of that program, since a node serves one at a time.
"""

from collections.abc import Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.machine import Machine
from steptwin.host.client.reports import await_reports, check_faults
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, REST_TIMEOUT_S, require
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control

_RUN: Final = ENABLE_OPERATION | Control.START


def pause_trajectory(machine: Machine) -> bool:
    """Halt the trajectory and wait until all axes rest; a trajectory that is halted already stays so.

    Returns:
        True if the machine is halted; False if the trajectory came to its end first.

    Raises:
        InputError: no axis runs a trajectory.
        BusError: the axes do not come to rest.
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
    """Let a halted trajectory go on, whichever program halted it; one that is not halted goes on unchanged.

    Raises:
        InputError: no axis runs a trajectory.
        BusError: the axes do not set off.
        DeviceFaultError: a fault has ended the trajectory meanwhile.
    """
    running = running_axes(machine, "resume")
    send_resume(running)
    require(machine, lambda: not any(axis.halted for axis in running), "the axes do not go on", REPLY_TIMEOUT_S)
    check_faults(machine.link, machine.axes)


def abandon_trajectory(machine: Machine) -> None:
    """Halt the trajectory on its path and give up the rest of it; the axes stay enabled. Raises as `pause_trajectory`.

    The halt is the trajectory's own slower and slower pace, so all axes stay on the path until they rest.
    """
    if pause_trajectory(machine):
        machine.drop_trajectory()


def send_pause(axes: Sequence[AxisClient]) -> None:
    """Tell axes that run a trajectory to halt on its path; wait for nothing, so that any thread may do it."""
    for axis in axes:
        axis.send_interpolation_controlword(_RUN | Control.HALT)


def send_resume(axes: Sequence[AxisClient]) -> None:
    """Tell axes to go on with their trajectory; wait for nothing, so that any thread may do it."""
    for axis in axes:
        axis.send_interpolation_controlword(_RUN)


def running_axes(machine: Machine, what: str) -> list[AxisClient]:
    """Return the axes that execute records; a node that is not OPERATIONAL sends no report and executes none.

    Raises InputError, with what is to be done in it, if no axis does.
    """
    await_reports(machine, machine.axes)
    running = [axis for axis in machine.axes if axis.interpolating]
    if not running:
        raise InputError(f"nothing to {what}: no axis runs a trajectory")
    return running
