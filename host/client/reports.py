"""Check the axes' status reports for a fault, or a stop by another program."""

from collections.abc import Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.links import Clock
from steptwin.host.client.waiting import POLL_S, SILENCE_S, silent, wait_until
from steptwin.host.client.words import state_text, state_words
from steptwin.host.common.errors import DeviceFaultError
from steptwin.protocol.cia402 import ErrorCode, State

_ENABLED: Final = State.OPERATION_ENABLED  # bound once: fast for every axis at every poll
_REPORT_TIMEOUT_S: Final = 0.3
"""Time limit for a report: three periods of an OPERATIONAL node's status reports."""


def await_reports(clock: Clock, axes: Sequence[AxisClient]) -> None:
    """Wait until every axis has reported its status, at most for the time that OPERATIONAL nodes need."""
    wait_until(clock, lambda: all(axis.drive_status is not None for axis in axes), _REPORT_TIMEOUT_S)


class Listening:
    """Detects an axis that no longer reports its status, which it does ten times per second."""

    def __init__(self, clock: Clock, axes: Sequence[AxisClient]) -> None:
        """Start to measure the time since each axis' last report."""
        self._clock = clock
        self._heard = [(axis, axis.drive_status, clock.now_s()) for axis in axes]

    def check(self) -> None:
        """Raise BusError if an axis has not reported for SILENCE_S; called at every poll."""
        now_s = self._clock.now_s()
        for i, (axis, report, heard_s) in enumerate(self._heard):
            if axis.drive_status is not report:
                self._heard[i] = axis, axis.drive_status, now_s
            elif now_s - heard_s > SILENCE_S:
                raise silent(axis.name)


def check_faults(clock: Clock, axes: Sequence[AxisClient]) -> None:
    """Raise DeviceFaultError if a drive is in fault or its node has restarted.

    The message names the axis at which the fault began.
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
    """Raise DeviceFaultError if a drive has left OPERATION ENABLED by its last report, because it was stopped."""
    for axis in axes:
        status = axis.drive_status
        if status is not None and status.state is not _ENABLED:
            raise DeviceFaultError(f"{axis.name}: was stopped, the drive is in {state_text(status.state)}").plainly(
                f"{axis.name}: was stopped, it is {state_words(status.state)}"
            )
