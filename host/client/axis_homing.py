"""Run homings from the host: write the settings, start, wait for success or failure.

The client follows a homing by the axes' status reports, and uses SDO only after an axis has reported the end.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES, DriveStatus
from steptwin.host.client.links import Link
from steptwin.host.client.reports import Listening
from steptwin.host.client.stopping import await_standstill
from steptwin.host.client.waiting import POLL_S, REST_TIMEOUT_S, wait_until
from steptwin.host.client.words import state_text, state_words
from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, ErrorCode, HomingError, Mode, State, Status
from steptwin.protocol.frame import COB_SYNC, FIRST_NODE_ID

_TEXTS: Final[dict[int, str]] = {
    HomingError.NOT_FOUND: "the switch was not found on the whole way",
    HomingError.STUCK: "the switch did not change where its edge should be, before a limit switch",
    HomingError.WRONG_SWITCH: "a limit switch closed that should not: are the two exchanged?",
    HomingError.TIMEOUT: "it took longer than allowed",
    HomingError.NO_SPEED: "the axis' speed limit leaves no motion",
}


@dataclass(frozen=True, slots=True)
class HomingSettings:
    """Settings of an axis' homing, in the units of its dictionary entries."""

    method: int
    search_units_per_s: int
    """Speed during the search for the switch."""
    zero_units_per_s: int
    """Speed at which the edge of the switch is crossed."""
    acceleration_units_per_s2: int
    offset_units: int
    """Position of the edge."""
    timeout_ms: int
    """Longest duration; 0 sets no limit."""
    switch_axis: int | None = None
    """Axis whose inputs have the switches, in a homing of several axes together; None for a homing of one axis."""
    reversed: bool = False
    """True if the axis moves down while the switches are passed upwards."""
    partial: bool = False
    """True if the position reference needs a further homing after this one."""

    def objects(self) -> list[tuple[int, int]]:
        """Return the entries of these settings, as (address, value).

        The entries for a homing of several axes are valid for the next homing only.
        """
        together = (
            []
            if self.switch_axis is None
            else [
                (od.HOMING_SWITCH_NODE, FIRST_NODE_ID + self.switch_axis),
                (od.HOMING_REVERSED, self.reversed),
                (od.HOMING_PARTIAL, self.partial),
            ]
        )
        return [
            *together,
            (od.HOMING_METHOD, self.method),
            (od.HOMING_SEARCH_SPEED, self.search_units_per_s),
            (od.HOMING_ZERO_SPEED, self.zero_units_per_s),
            (od.HOMING_ACCELERATION, self.acceleration_units_per_s2),
            (od.HOME_OFFSET, self.offset_units),
            (od.HOMING_TIMEOUT_MS, self.timeout_ms),
        ]


class AxisHoming(NamedTuple):
    """One axis to home, with its settings."""

    axis: AxisClient
    settings: HomingSettings


class HomingPair(NamedTuple):
    """Two axes that drive one joint and must stay together.

    Attributes:
        first, second: numbers of the axes.
        skew_max: largest difference of their travels during homing, in `unit`.
        unit: unit of the joint.
        per_unit: wire units per unit.
    """

    first: int
    second: int
    skew_max: float
    unit: str
    per_unit: float


class PairWatch:
    """Compares the travels of the two axes of a pair since the start of their homings.

    The travel of an axis ends when it is homed: the change of its position to the home offset is no motion.
    """

    def __init__(self, axes: Sequence[AxisClient], pair: HomingPair) -> None:
        self._pair = pair
        self.axes: tuple[AxisClient, AxisClient] = (axes[pair.first], axes[pair.second])
        self._starts_units = [axis.read(od.POSITION_ACTUAL) for axis in self.axes]
        self._travels_units = [0, 0]
        self._seeking = [True, True]

    def look(self) -> None:
        """Raise DeviceFaultError if the travels differ by more than `skew_max`."""
        for i, axis in enumerate(self.axes):
            if self._seeking[i]:
                position_units = axis.read(od.POSITION_ACTUAL)
                self._seeking[i] = not axis.read(od.STATUSWORD) & _ENDED
                if self._seeking[i]:  # else the position was read before the change of coordinates
                    self._travels_units[i] = position_units - self._starts_units[i]
        skew = abs(self._travels_units[1] - self._travels_units[0]) / self._pair.per_unit
        if skew > self._pair.skew_max:
            first, second = (axis.name for axis in self.axes)
            text = (
                f"{second}: homing took it {skew:.4g} {self._pair.unit} apart from {first}, more than skew_max,"
                f" {self._pair.skew_max:g} {self._pair.unit}: is the joint crooked, or does a switch not close?"
            )
            raise DeviceFaultError(text)


_ENDED: Final = Status.TARGET_REACHED | Status.HOMING_ERROR
"""Bits of the statusword, one of which marks the end of a homing."""


def run_homings(
    link: Link, homings: Sequence[AxisHoming], one_homed: Callable[[], None], pairs: Sequence[PairWatch] = ()
) -> None:
    """Home enabled axes at the same time and wait until all are homed; if one fails, stop the others.

    `one_homed` is called after each axis is homed. Axes whose settings name a switch axis start in the same servo tick.

    Raises:
        DeviceFaultError: a homing has failed, the axes of a pair have moved too far apart, or a drive is in fault or
            was switched off; the message gives the reason.
        BusError: a node does not answer, or a homing neither ends nor fails.
    """
    for axis, settings in homings:
        axis.write(od.CONTROLWORD, ENABLE_OPERATION)
        axis.write(od.MODE_OF_OPERATION, Mode.HOMING)
        for address, value in settings.objects():
            axis.write(address, value)
    axes = [axis for axis, _ in homings]
    old_reports = [axis.drive_status for axis in axes]
    for axis, settings in homings:
        if settings.switch_axis is None:
            axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
        else:
            axis.send_latched_controlword(ENABLE_OPERATION | Control.START)
    if any(settings.switch_axis is not None for _, settings in homings):
        link.network.send_message(COB_SYNC, b"")
    try:
        _await_all(link, homings, old_reports, one_homed, pairs)
    except BaseException:
        with suppress(StepTwinError):  # the first error is the one to report
            _release(link, axes)
        raise
    _release(link, axes)


def _await_all(
    link: Link,
    homings: Sequence[AxisHoming],
    old_reports: Sequence[DriveStatus | None],
    one_homed: Callable[[], None],
    pairs: Sequence[PairWatch],
) -> None:
    """Wait until all axes are homed; ignore reports from before the start."""
    waiting = [(axis, old) for (axis, _), old in zip(homings, old_reports, strict=True)]
    listening = Listening(link, [axis for axis, _ in homings])

    def all_homed() -> bool:
        listening.check()
        for pair in pairs:
            pair.look()
        for each in list(waiting):
            axis, old = each
            if _says_it_ended(axis, old) and _homed(link, axis):
                waiting.remove(each)
                one_homed()
        return not waiting

    if not wait_until(link, all_homed, max(_timeout_s(settings) for _, settings in homings)):
        raise BusError(f"{waiting[0][0].name}: homing neither ends nor fails")


def _says_it_ended(axis: AxisClient, old: DriveStatus | None) -> bool:
    """Return whether an axis has reported the end of its homing; `old` is its last report before the start."""
    report = axis.drive_status
    if axis.in_fault or axis.restarted:
        return True
    return report is not None and report is not old and not report.homing


def _timeout_s(settings: HomingSettings) -> float:
    """Return a time limit longer than the axis' own limit, which does not include the ramp behind the edge."""
    return settings.timeout_ms / 1000 + REST_TIMEOUT_S if settings.timeout_ms else inf


def _homed(link: Link, axis: AxisClient) -> bool:
    """Return whether an axis is homed and at standstill; raise DeviceFaultError if its homing has failed."""
    statusword = axis.read(od.STATUSWORD)
    state = State.of(statusword)
    if state in FAULT_STATES:
        link.wait(POLL_S)  # until the node has reported its error
        raise axis.fault()
    if axis.restarted:
        raise axis.restart()
    if state is not State.OPERATION_ENABLED:
        raise DeviceFaultError(f"{axis.name}: homing was cut short, the drive is in {state_text(state)}").plainly(
            f"{axis.name}: homing was cut short, it is {state_words(state)}"
        )
    if statusword & Status.HOMING_ERROR:
        raise failure(axis)
    if not statusword & Status.TARGET_REACHED:
        return False
    if not statusword & Status.HOMING_ATTAINED:
        raise DeviceFaultError(f"{axis.name}: homing was interrupted")
    return True


def failure(axis: AxisClient) -> DeviceFaultError:
    """Return an error with the reason why an axis' last homing has failed."""
    reason = _TEXTS.get(axis.read(od.HOMING_ERROR), "for an unknown reason")
    text = f"{axis.name}: homing failed: {reason}"
    return DeviceFaultError(f"{text} (EMCY 0x{ErrorCode.HOMING_FAILED:04X})").plainly(text)


def _release(link: Link, axes: Sequence[AxisClient]) -> None:
    """Clear the start bits, which aborts homings in progress, and wait for standstill."""
    for axis in axes:
        if axis.state() is State.OPERATION_ENABLED:
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)
    await_standstill(link, axes)
