"""Start a stream: let the queues report often enough, clear and preload them, then start all axes with one SYNC."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.links.link import Link
from steptwin.host.client.output_schedule import OutputCommand
from steptwin.host.client.queue_feed import QueueFeed, fill
from steptwin.host.client.stream import Stream
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, require
from steptwin.host.client.waits import HOLD_MS, InputWait, Waits, divide
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, PVT_SUBMODE, QUICK_STOP, Control, Mode, State, Status
from steptwin.protocol.frame import COB_SYNC
from steptwin.protocol.objects import TPDO_DEFAULTS
from steptwin.protocol.pvt import PvtFlag


def stop_the_rest(axes: Sequence[AxisClient]) -> None:
    """Quick-stop the axes that may still follow a trajectory after something has ended it for others.

    The axes of one board stop together by themselves, those of another board do not.
    """
    with suppress(BusError):  # the error that has ended the trajectory is what matters
        for axis in axes:
            if axis.drive_status is None or axis.drive_status.state is State.OPERATION_ENABLED:
                axis.send_interpolation_controlword(QUICK_STOP)


_PRELOAD_RECORDS: Final = 32
_PRELOAD_TIMEOUT_S: Final = 5.0
"""Time limit for filling the queues: on a bad line lost records can be sent again a few times."""
_STATUS_PERIOD: Final = od.address_of(od.TPDO_COMMUNICATION[2], od.PDO_EVENT_TIMER)
"""Address of the event timer with which TPDO3 reports a queue's free places."""
_STATUS_PERIOD_MAX_MS: Final = TPDO_DEFAULTS[2].event_timer_ms
"""Longest period of these reports: the event timer's value after power-up."""
_STATUS_PERIOD_MIN_MS: Final = 10
"""Shortest period of these reports: the inhibit time of TPDO3, at which the client polls."""
_STATUS_PERIOD_SEGMENTS: Final = 20
"""Number of segments from one report to the next: three reports come before a queue of 64 runs dry."""


class StreamStarter:
    """Starts streams on the axes of a machine; remembers which status period the nodes have."""

    def __init__(self, link: Link, axes: tuple[AxisClient, ...]) -> None:
        self._link = link
        self._axes = axes
        self._status_period_ms = _STATUS_PERIOD_MAX_MS

    def start(
        self,
        records: tuple[AxisRecords, ...],
        start_units: list[int],
        outputs: tuple[OutputCommand, ...],
        waits: tuple[InputWait, ...],
    ) -> Stream:
        """Start a trajectory; arguments and errors are those of `Machine.start`."""
        self._set_status_period(min(records[0].durations_ms + [HOLD_MS] * bool(waits)))
        for axis in self._axes:
            if not axis.read(od.STATUSWORD) & Status.POSITION_KNOWN:
                raise DeviceFaultError(f"{axis.name}: the position is unknown: home the axis first")
        for axis, start in zip(self._axes, start_units, strict=True):
            _prepare(axis, start)
        legs = divide(records, outputs, waits)
        first, held = legs[0], Waits(self._axes, waits, legs)
        feeds = [QueueFeed(axis, own, self._link.now_s()) for axis, own in zip(self._axes, first.records, strict=True)]
        fed_ms = held.feed_first(feeds)
        least = min(_PRELOAD_RECORDS, len(fed_ms))
        filled = partial(self._preloaded, feeds, least)
        require(self._link, filled, "the queues of the motion do not fill", _PRELOAD_TIMEOUT_S)
        self._start_together()
        return Stream(self._link, self._axes, feeds, fed_ms, first.outputs, held)

    def _set_status_period(self, shortest_ms: int) -> None:
        """Make the nodes report their queues' free places often enough for segments as short as `shortest_ms`.

        Nodes take PDO parameters only in PRE-OPERATIONAL; their drives keep their state meanwhile.
        """
        period_ms = min(_STATUS_PERIOD_MAX_MS, max(_STATUS_PERIOD_MIN_MS, _STATUS_PERIOD_SEGMENTS * shortest_ms))
        if period_ms == self._status_period_ms:
            return
        self._link.network.nmt.state = "PRE-OPERATIONAL"
        for axis in self._axes:
            axis.write(_STATUS_PERIOD, period_ms)
        self._link.network.nmt.state = "OPERATIONAL"
        self._status_period_ms = period_ms

    def _preloaded(self, feeds: list[QueueFeed], least: int) -> bool:
        """Send records for which there is room; return whether every queue holds at least this many."""
        now_s = self._link.now_s()
        for feed in feeds:
            feed.update(now_s)
        fill(feeds)
        return all(axis.read(od.BUFFER_POSITION) >= least for axis in self._axes)

    def _start_together(self) -> None:
        """Latch every axis' start bit, then send one SYNC: all axes start in the same servo tick."""
        for axis in self._axes:
            axis.send_latched_controlword(ENABLE_OPERATION | Control.START)
            axis.pvt_status = None  # a report from before the start says nothing about it
        self._link.network.send_message(COB_SYNC, b"")
        try:
            require(self._link, lambda: all(map(_started, self._axes)), "not all axes start", REPLY_TIMEOUT_S)
        except BusError:
            stop_the_rest([axis for axis in self._axes if _started(axis)])
            raise


def _prepare(axis: AxisClient, start_units: int) -> None:
    """Check where the axis stands, then clear its queue and its start bit, whose rise is what starts a trajectory."""
    demand = axis.read(od.POSITION_DEMAND)
    if demand != start_units:
        raise DeviceFaultError(
            f"{axis.name}: stands at {demand} units, the trajectory starts at {start_units}"
        ).plainly(f"{axis.name}: does not stand where the trajectory starts: move there first")
    axis.write(od.CONTROLWORD, ENABLE_OPERATION)
    axis.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION)
    axis.write(od.INTERPOLATION_SUBMODE, PVT_SUBMODE)
    axis.write(od.BUFFER_CLEAR, 0)
    axis.pvt_status = None


def _started(axis: AxisClient) -> bool:
    """Return whether an axis runs, or has run: a trajectory may be so short that it is done already."""
    running = axis.pvt_status is not None and bool(axis.pvt_status.flags & PvtFlag.RUNNING)
    return axis.done or (running and axis.interpolating)
