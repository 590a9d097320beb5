"""Bringing all axes to rest at once, whoever moves them, and taking their power away.

A quick stop goes out as process data that waits for SYNC, so that all axes begin to stop in the same servo tick; an
axis that does not react, because its node is not OPERATIONAL or a frame was lost, is told by SDO. What follows is the
drive's own matter, by 0x605A: it holds its position (QUICK STOP ACTIVE) or switches its power off.
"""

from collections.abc import Callable, Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient, state_text
from steptwin.host.client.link import Link
from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.protocol import od
from steptwin.protocol.cia402 import QUICK_STOP, State, Status
from steptwin.protocol.frame import COB_SYNC

_POLL_S: Final = 0.010
_REACTION_S: Final = 0.05
"""Ten times what a changed status waits for, at most, before it is sent."""
_REST_TIMEOUT_S: Final = 20.0
"""A ramp to rest lasts at most as long as a queue of the longest records, 16.3 s."""
_REACTED: Final = (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED, State.FAULT, State.FAULT_REACTION_ACTIVE)


def quick_stop(link: Link, axes: Sequence[AxisClient]) -> None:
    """Stop all axes and wait until they rest.

    Raises:
        BusError: an axis does not answer or does not come to rest; the others have been stopped.
        DeviceFaultError: an axis refuses.
    """
    for axis in axes:
        axis.drive_status = None
        axis.send_latched_controlword(QUICK_STOP)
    link.network.send_message(COB_SYNC, b"")
    _wait(link, _REACTION_S, lambda: all(map(_reacted, axes)))
    _each([axis for axis in axes if not _reacted(axis)], _stop_by_sdo)
    if not _wait(link, _REST_TIMEOUT_S, lambda: all(map(_rests, axes))):
        raise BusError("the axes do not come to rest")


def power_off(link: Link, axes: Sequence[AxisClient]) -> None:
    """Stop all axes, then take their power away: stop category 1 of IEC 60204-1, by software.

    Whatever goes wrong with the stop, the power is taken away. Raises as `quick_stop` does, and DeviceFaultError if a
    drive stays on.
    """
    try:
        quick_stop(link, axes)
    finally:
        _each(axes, AxisClient.disable)
    for axis in axes:
        state = axis.state()
        if state not in (State.SWITCH_ON_DISABLED, State.FAULT):
            raise DeviceFaultError(f"{axis.name}: stays on, the drive is in {state_text(state)}")


def _reacted(axis: AxisClient) -> bool:
    return axis.drive_status is not None and axis.drive_status.state in _REACTED


def _rests(axis: AxisClient) -> bool:
    statusword = axis.read(od.STATUSWORD)
    return State.of(statusword) is not State.OPERATION_ENABLED and bool(statusword & Status.TARGET_REACHED)


def _stop_by_sdo(axis: AxisClient) -> None:
    axis.write(od.CONTROLWORD, QUICK_STOP)


def _each(axes: Sequence[AxisClient], do: Callable[[AxisClient], None]) -> None:
    """Do it to every axis; the first error is raised when all have had their turn."""
    errors = []
    for axis in axes:
        try:
            do(axis)
        except StepTwinError as error:
            errors.append(error)
    if errors:
        raise errors[0]


def _wait(link: Link, timeout_s: float, condition: Callable[[], bool]) -> bool:
    """Whether it came true in time."""
    deadline_s = link.now_s() + timeout_s
    while not condition():
        if link.now_s() > deadline_s:
            return False
        link.wait(_POLL_S)
    return True
