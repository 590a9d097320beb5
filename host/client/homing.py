"""Homing from the host: tell an axis how, start it, see it through."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.link import Link
from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, ErrorCode, HomingError, Mode, State, Status

_POLL_S: Final = 0.010
_STOP_TIMEOUT_S: Final = 20.0
"""A ramp to rest lasts at most as long as a queue of the longest records, 16.3 s."""

_TEXTS: Final[dict[int, str]] = {
    HomingError.NOT_FOUND: "the switch was not found on the whole way",
    HomingError.STUCK: "the switch did not change where its edge should be, before a limit switch",
    HomingError.WRONG_SWITCH: "a limit switch closed that should not: are the two exchanged?",
    HomingError.TIMEOUT: "it took longer than allowed",
    HomingError.NO_SPEED: "the axis' speed limit leaves no motion",
}


@dataclass(frozen=True, slots=True)
class HomingSettings:
    """How an axis is homed, in the objects' own units.

    Attributes:
        method: object 0x6098.
        search_units_per_s: at which the switch is searched for.
        zero_units_per_s: at which its edge is crossed.
        acceleration_units_per_s2: of all ramps.
        offset_units: the position that the edge has.
        timeout_ms: how long it may take; 0 for ever.
    """

    method: int
    search_units_per_s: int
    zero_units_per_s: int
    acceleration_units_per_s2: int
    offset_units: int
    timeout_ms: int

    def objects(self) -> list[tuple[int, int]]:
        """As (address, value)."""
        return [
            (od.HOMING_METHOD, self.method),
            (od.HOMING_SEARCH_SPEED, self.search_units_per_s),
            (od.HOMING_ZERO_SPEED, self.zero_units_per_s),
            (od.HOMING_ACCELERATION, self.acceleration_units_per_s2),
            (od.HOME_OFFSET, self.offset_units),
            (od.HOMING_TIMEOUT_MS, self.timeout_ms),
        ]


class AxisHoming(NamedTuple):
    """One axis that is to be homed, and how."""

    axis: AxisClient
    settings: HomingSettings


def home(link: Link, homings: Sequence[AxisHoming], ended: Callable[[], None] = lambda: None) -> None:
    """Home some enabled axes at the same time and wait until all are; if one fails the others are stopped.

    Args:
        link: the bus.
        homings: which axes, and how.
        ended: called whenever one of them is homed.

    Raises:
        DeviceFaultError: a homing failed, or a drive is in fault or was switched off; the message says why.
        BusError: no answer, or an axis that neither gets done nor fails.
    """
    for axis, settings in homings:
        axis.write(od.CONTROLWORD, ENABLE_OPERATION)
        axis.write(od.MODE_OF_OPERATION, Mode.HOMING)
        for address, value in settings.objects():
            axis.write(address, value)
    for axis, _ in homings:
        axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
    axes = [axis for axis, _ in homings]
    try:
        _await_all(link, homings, ended)
    except BaseException:
        with suppress(StepTwinError):  # what went wrong first is what counts
            _release(link, axes)
        raise
    _release(link, axes)


def _await_all(link: Link, homings: Sequence[AxisHoming], ended: Callable[[], None]) -> None:
    begun_s = link.now_s()
    waiting = list(homings)
    while waiting:
        for homing in list(waiting):
            if _homed(link, homing.axis):
                waiting.remove(homing)
                ended()
            elif link.now_s() - begun_s > _patience_s(homing.settings):
                raise BusError(f"{homing.axis.name}: homing neither ends nor fails")
        if waiting:
            link.wait(_POLL_S)


def _patience_s(settings: HomingSettings) -> float:
    """Longer than the axis itself: the ramp behind the edge is not in its time."""
    return settings.timeout_ms / 1000 + _STOP_TIMEOUT_S if settings.timeout_ms else float("inf")


def _homed(link: Link, axis: AxisClient) -> bool:
    """Whether an axis is homed and stands.

    Raises:
        DeviceFaultError: it will not be.
    """
    statusword = axis.read(od.STATUSWORD)
    state = State.of(statusword)
    if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        link.wait(_POLL_S)  # let the node say what happened to it
        raise DeviceFaultError(axis.fault_text())
    if state is not State.OPERATION_ENABLED:
        raise DeviceFaultError(f"{axis.name}: homing was cut short, the drive is in {state.name.replace('_', ' ')}")
    if statusword & Status.HOMING_ERROR:
        raise DeviceFaultError(failure_text(axis))
    if not statusword & Status.TARGET_REACHED:
        return False
    if not statusword & Status.HOMING_ATTAINED:
        raise DeviceFaultError(f"{axis.name}: homing was interrupted")
    return True


def failure_text(axis: AxisClient) -> str:
    """One line that says why an axis' last homing has failed."""
    reason = _TEXTS.get(axis.read(od.HOMING_ERROR), "for a reason unknown here")
    return f"{axis.name}: homing failed: {reason} (EMCY 0x{ErrorCode.HOMING_FAILED:04X})"


def _release(link: Link, axes: Sequence[AxisClient]) -> None:
    """Clear the start bits: homings still in progress are aborted by that, and come to rest."""
    for axis in axes:
        if axis.state() is State.OPERATION_ENABLED:
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)
    deadline_s = link.now_s() + _STOP_TIMEOUT_S
    while not all(axis.read(od.STATUSWORD) & Status.TARGET_REACHED for axis in axes):
        if link.now_s() > deadline_s:
            raise BusError("the axes do not come to rest")
        link.wait(_POLL_S)
