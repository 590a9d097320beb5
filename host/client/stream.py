"""Stream a trajectory: preload the queues and start all axes, feed the queues, switch outputs, notice its end."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.links import Link
from steptwin.host.client.queue_feed import QueueFeed, TrajectoryTime, fill
from steptwin.host.client.reports import check_enabled, check_faults
from steptwin.host.client.waiting import POLL_S, REPLY_TIMEOUT_S, require
from steptwin.host.client.waits import MachineWiring, OutputSchedule, Waits, divide
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.planning.trajectory import OutputChange, Wait
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, PVT_SUBMODE, QUICK_STOP, Control, Mode, State, Status
from steptwin.protocol.frame import COB_SYNC
from steptwin.protocol.pvt import QUEUE_DEPTH, PvtFlag


class StreamedMotion(NamedTuple):
    """A trajectory as it is streamed.

    Attributes:
        records: those of each axis; the records of all axes have the same durations.
        start_units: where the axes must stand, in wire units.
        outputs: changes of outputs on the way.
        waits: waits for inputs, in order of time; the axes stand still until each input has its level.
        wiring: where these inputs and outputs are.
        highest_percent: highest speed at which programs may let the axes execute the records, in percent of the planned
            one; the boards refuse the records unless their step rates allow it.
    """

    records: tuple[AxisRecords, ...]
    start_units: list[int]
    outputs: tuple[OutputChange, ...] = ()
    waits: tuple[Wait, ...] = ()
    wiring: MachineWiring = MachineWiring({}, {})
    highest_percent: int = 100


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
_STALL_S: Final = 5.0
"""Time limit for a record: one of 255 ms takes up to sqrt(2 * 0.255 * 16.3) = 2.9 s at the end of a slow halt ramp.

At 10 % of its speed it takes 2.6 s, and before such a halt 3.4 s, of which the ramp takes 1.6 s.
"""


class Stream:
    """A trajectory that the axes execute; `Machine.wait` tends it, and `ended` becomes True at its end.

    Any program on the bus may halt the trajectory. A halt may last as long as it likes: a time limit holds only for
    records that do not go on although nothing halts them.
    """

    def __init__(self, link: Link, axes: tuple[AxisClient, ...], motion: StreamedMotion) -> None:
        """Start a trajectory; raises as `Machine.start`."""
        self.ended: bool = False
        self._link = link
        self._axes = axes
        for axis in axes:
            if not axis.read(od.STATUSWORD) & Status.POSITION_KNOWN:
                raise DeviceFaultError(f"{axis.name}: the position is unknown: home the axis first")
        for axis, start in zip(axes, motion.start_units, strict=True):
            _prepare(axis, start)
            if motion.highest_percent > 100:  # that of a queue that is clear is 100 %
                axis.write(od.GROUP_RATE_HIGHEST_Q16, od.rate_q16(motion.highest_percent))
        legs = divide(motion.records, motion.outputs, motion.waits)
        self.waits: Waits = Waits(axes, motion.wiring, motion.waits, legs)
        self._feeds = [QueueFeed(axis, own, link.now_s()) for axis, own in zip(axes, legs[0].records, strict=True)]
        fed_ms = self.waits.feed_first(self._feeds)
        # full queues leave the bus to the questions that outputs on the way need, from the start on
        promptly = any(change.on_the_way for change in motion.outputs)
        self._least_records = min(QUEUE_DEPTH if promptly else _PRELOAD_RECORDS, len(fed_ms))
        require(link, self._preloaded, "the queues of the motion do not fill", _PRELOAD_TIMEOUT_S)
        self._start_together()
        now_s = link.now_s()
        self._reached = TrajectoryTime(fed_ms, now_s, motion.highest_percent)
        self._schedule = OutputSchedule(axes, motion.wiring, legs[0].outputs, self._reached)
        self._seen = axes[0].pvt_status
        self._progress_s = now_s
        self._progress_at_s = 0.0
        """The trajectory time that was reached at `_progress_s`."""

    def _preloaded(self) -> bool:
        """Send records while there is room; return whether every queue holds enough of them to start."""
        now_s = self._link.now_s()
        for feed in self._feeds:
            feed.update(now_s)
        fill(self._feeds)
        return all(axis.read(od.BUFFER_POSITION) >= self._least_records for axis in self._axes)

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

    @property
    def fraction(self) -> float:
        """The part of the records that has been sent, 0 to 1."""
        return min(feed.fraction for feed in self._feeds)

    @property
    def trajectory_s(self) -> float:
        """The trajectory time reached at least: the beginning of the record last reported as executing."""
        return self._reached.least_s

    @property
    def halted(self) -> bool:
        """True while the last reports say that the machine rests amid its trajectory."""
        return all(axis.halted for axis in self._axes)

    def wait(self, dt_s: float) -> None:
        """Let time pass, and switch outputs that are due on the way as soon as the board is there."""
        looks = self._schedule.times_to_look(self._link.now_s(), dt_s)
        for look in range(1, looks + 1):
            self._link.wait(dt_s / looks)
            if look < looks:
                self._switch_promptly()

    def _switch_promptly(self) -> None:
        """Switch outputs that are due on the way, between two looks."""
        if self._schedule.is_prompt and not self.halted:
            self._schedule.tend(self._link.now_s())

    def tend(self) -> None:
        """Send records, switch outputs that are due and look at the input that is waited for; set `ended` at the end.

        Call it at least as often as the queues' reserve requires, and never from a frame's callback.

        Raises:
            DeviceFaultError: an axis is in fault, was stopped, refuses a record or has run out of records.
            WaitTimeoutError: an input has not got its level in time; the axes rest and the motion is at its end.
            BusError: an axis no longer reports its status, or the motion stalls although nothing halts it.
        """
        now_s = self._link.now_s()
        check_faults(self._link, self._axes)
        check_enabled(self._axes)
        for feed in self._feeds:
            feed.update(now_s)
        fed = self.waits.timed_out or self._fed()
        done = fed and all(axis.done for axis in self._axes)
        halted = self.halted
        self._follow(now_s, done=done, halted=halted)
        self.waits.tend(self._feeds, self._reached, self._schedule, now_s)
        if not halted:
            self._schedule.tend(now_s)
        if done:
            self._link.wait(POLL_S)
            check_faults(self._link, self._axes)
            check_enabled(self._axes)  # a quick stop empties the queues, too
            self.ended = True
            self.waits.check_end()

    def _fed(self) -> bool:
        """Send records; return whether the boards have all of them.

        After a time-out it is not called: the queues then run dry at rest, whatever was lost on the bus.
        """
        for feed in self._feeds:
            feed.check_running()
        fill(self._feeds, self._switch_promptly)
        return all(feed.all_acknowledged for feed in self._feeds)

    def _follow(self, now_s: float, *, done: bool, halted: bool) -> None:
        status = self._axes[0].pvt_status
        if status is not None and status is not self._seen:
            self._seen = status
            self._reached.report(status.executing, now_s)
        if done:
            self._reached.end()
        if halted or self._reached.least_s != self._progress_at_s:
            self._progress_s = now_s
            self._progress_at_s = self._reached.least_s
        elif now_s - self._progress_s > _STALL_S:
            raise BusError(f"the motion has stalled for {_STALL_S:g} s at {self._progress_at_s:g} s of its time")


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
