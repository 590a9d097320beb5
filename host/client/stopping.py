"""Stop all axes at once, even if another program moves them, and hold them in an emergency stop.

The quick stop is process data that acts at SYNC, so all axes begin to stop in the same servo tick. If an axis does not
react, because its node is not OPERATIONAL or a frame was lost, it is stopped by SDO. After the stop, the quick stop
option code (605Ah) of the drive determines whether it holds its position (QUICK STOP ACTIVE) or switches its power off.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.links import Link
from steptwin.host.client.waiting import REST_TIMEOUT_S, require, wait_until
from steptwin.host.client.words import state_text, state_words
from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.protocol import od
from steptwin.protocol.cia402 import QUICK_STOP, State, Status
from steptwin.protocol.frame import COB_SYNC

_REACTION_S: Final = 0.05
"""Time limit of a reaction: ten times the longest delay of a changed status report."""
_HELD_S: Final = 1.0
"""Time for which an emergency stop is repeated on drives that do not stay in FAULT."""
UNSURE: Final = "nobody knows whether the machine has stopped: use its own e-stop"
_REACTED: Final = (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED, *FAULT_STATES)


def quick_stop(link: Link, axes: Sequence[AxisClient]) -> None:
    """Stop all axes and wait for standstill.

    Raises:
        BusError: an axis does not answer or does not stop; the others have received the quick stop.
        DeviceFaultError: an axis refuses the quick stop, or another program enables it again. (A drive that holds its
            position after a quick stop can be enabled again.)
    """
    _begin_quick_stop(link, axes)
    wait_until(link, lambda: all(map(_reacted, axes)), _REACTION_S)
    _each([axis for axis in axes if not _reacted(axis)], lambda axis: axis.write(od.CONTROLWORD, QUICK_STOP))
    require(link, lambda: all(map(_stopped, axes)), "the axes do not come to rest", REST_TIMEOUT_S)


def unsure(error: StepTwinError) -> StepTwinError:
    """Return an error of the same type whose message also contains UNSURE."""
    return type(error)(f"{error}; {UNSURE}").plainly(f"{error.plain}; {UNSURE}")


@contextmanager
def saying_if_unsure() -> Iterator[None]:
    """Add UNSURE to the message of a BusError that is raised while the machine is being stopped."""
    try:
        yield
    except BusError as error:
        raise unsure(error) from error


def await_standstill(link: Link, axes: Sequence[AxisClient]) -> None:
    """Wait for standstill of all axes, in any state; raise BusError if they continue to move."""
    require(link, lambda: all(map(_at_standstill, axes)), "the axes do not come to rest", REST_TIMEOUT_S)


def emergency_stop(link: Link, axes: Sequence[AxisClient]) -> None:
    """Stop all axes, switch their power off, and hold them in FAULT until a fault reset.

    This is stop category 1 of IEC 60204-1, by software. All axes begin the quick stop in the same tick. An SDO to each
    axis changes it into an emergency stop, so no other program can start it again. If another program resets a drive
    meanwhile, the drive is stopped again. Raises as `quick_stop`, and DeviceFaultError if a drive does not stay in
    FAULT.
    """
    _begin_quick_stop(link, axes)
    _each(axes, AxisClient.emergency_stop)
    await_standstill(link, axes)
    loose: list[tuple[AxisClient, State]] = []

    def held() -> bool:
        loose[:] = [(axis, state) for axis in axes if (state := axis.state()) is not State.FAULT]
        _each([axis for axis, _ in loose], AxisClient.emergency_stop)
        return not loose

    if not wait_until(link, held, _HELD_S):
        axis, state = loose[0]
        raise DeviceFaultError(
            f"{axis.name}: is not held by the emergency stop, the drive is in {state_text(state)}"
        ).plainly(f"{axis.name}: is not held by the emergency stop, it is {state_words(state)}")


def send_quick_stop(link: Link, axes: Sequence[AxisClient]) -> None:
    """Send the quick stop, which all axes begin in the same tick; do not wait, so any thread may call it.

    Raises BusError if the bus does not accept the frames.
    """
    for axis in axes:
        axis.send_latched_controlword(QUICK_STOP)
    link.network.send_message(COB_SYNC, b"")


def _begin_quick_stop(link: Link, axes: Sequence[AxisClient]) -> None:
    for axis in axes:
        axis.drive_status = None
    send_quick_stop(link, axes)


def _reacted(axis: AxisClient) -> bool:
    return axis.drive_status is not None and axis.drive_status.state in _REACTED


def _stopped(axis: AxisClient) -> bool:
    """Return whether an axis that has reacted is at standstill; raise DeviceFaultError if it is enabled again."""
    statusword = axis.read(od.STATUSWORD)
    if State.of(statusword) is State.OPERATION_ENABLED:
        again = "another program enables the drive again after each stop; `steptwin estop` stops and holds it"
        raise DeviceFaultError(f"{axis.name}: {again}").plainly(
            f"{axis.name}: another program switches it on again after each stop: use the emergency stop"
        )
    return bool(statusword & Status.TARGET_REACHED)


def _at_standstill(axis: AxisClient) -> bool:
    return bool(axis.read(od.STATUSWORD) & Status.TARGET_REACHED)


def _each(axes: Sequence[AxisClient], do: Callable[[AxisClient], None]) -> None:
    """Call `do` with every axis, even after an error; raise the first error at the end."""
    errors = []
    for axis in axes:
        try:
            do(axis)
        except StepTwinError as error:
            errors.append(error)
    if errors:
        raise errors[0]
