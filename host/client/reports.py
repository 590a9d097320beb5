"""Follow the axes' own reports, and notice that a fault or another program has ended a motion."""

from collections.abc import Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.links import Clock
from steptwin.host.client.waiting import POLL_S, SILENCE_S, silent, wait_until
from steptwin.host.client.words import state_text, state_words
from steptwin.host.common.errors import DeviceFaultError
from steptwin.protocol.cia402 import ErrorCode, State

_ENABLED: Final = State.OPERATION_ENABLED  # to fetch it from its enum costs time, for every axis at every look
_REPORT_TIMEOUT_S: Final = 0.3
"""Time limit for a report: three times the event timer of an OPERATIONAL node's status reports."""


def await_reports(clock: Clock, axes: Sequence[AxisClient]) -> None:
    """Wait until every axis has reported its drive's status, but no longer than OPERATIONAL nodes need for it."""
    wait_until(clock, lambda: all(axis.drive_status is not None for axis in axes), _REPORT_TIMEOUT_S)


class Listening:
    """Notices when an axis no longer reports its drive's status, which it does ten times a second."""

    def __init__(self, clock: Clock, axes: Sequence[AxisClient]) -> None:
        """Listen from now on."""
        self._clock = clock
        self._heard = [(axis, axis.drive_status, clock.now_s()) for axis in axes]

    def check(self) -> None:
        """Raise BusError if an axis has not reported for SILENCE_S; call it at every look."""
        now_s = self._clock.now_s()
        for i, (axis, report, heard_s) in enumerate(self._heard):
            if axis.drive_status is not report:
                self._heard[i] = axis, axis.drive_status, now_s
            elif now_s - heard_s > SILENCE_S:
                raise silent(axis.name)


def check_faults(clock: Clock, axes: Sequence[AxisClient]) -> None:
    """Raise DeviceFaultError if a drive is in fault, or its node has restarted.

    The message names the axis where the fault began.
    """
    for axis in axes:
        if axis.restarted:
            raise axis.restart()
    faulty = [axis for axis in axes if axis.in_fault]
    if faulty:
        clock.wait(POLL_S)  # until every node has reported its errors
        began = [axis for axis in axes if set(axis.error_codes) - {ErrorCode.GROUP_STOPPED}]
        raise (began or faulty)[0].fault()


def check_enabled(axes: Sequence[AxisClient]) -> None:
    """Raise DeviceFaultError if a drive last reported another state than OPERATION ENABLED: something stopped it."""
    for axis in axes:
        status = axis.drive_status
        if status is not None and status.state is not _ENABLED:
            raise DeviceFaultError(f"{axis.name}: was stopped, the drive is in {state_text(status.state)}").plainly(
                f"{axis.name}: was stopped, it is {state_words(status.state)}"
            )
