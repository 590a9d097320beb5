"""Stream a trajectory: preload the queues, start all axes, feed the queues, switch outputs, detect the end."""

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
from steptwin.host.planning.motion import OutputChange, Wait
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, PVT_SUBMODE, QUICK_STOP, Control, Mode, State, Status
from steptwin.protocol.frame import COB_SYNC
from steptwin.protocol.pvt import QUEUE_DEPTH, PvtFlag


class StreamedMotion(NamedTuple):
    """A trajectory for streaming.

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


def stop_others(axes: Sequence[AxisClient]) -> None:
    """Quick-stop the axes that may still follow a trajectory after it has ended for others.

    The axes of one board stop together by themselves; those of another board do not.
    """
    with suppress(BusError):  # the error that has ended the trajectory is more important
        for axis in axes:
            if axis.drive_status is None or axis.drive_status.state is State.OPERATION_ENABLED:
                axis.send_interpolation_controlword(QUICK_STOP)


_PRELOAD_RECORDS: Final = 32
_PRELOAD_TIMEOUT_S: Final = 5.0
"""Time limit for filling the queues; lost records can be sent again a few times."""
_STALL_S: Final = 5.0
"""Time limit of a record: one of 255 ms takes up to sqrt(2 * 0.255 * 16.3) = 2.9 s at the end of a slow halt ramp.

At 10 % of its speed it takes 2.6 s; with such a halt 3.4 s, of which the ramp takes 1.6 s.
"""


class Stream:
    """A trajectory that the axes execute; `Machine.wait` feeds it, and `ended` becomes True at its end.

    Any program on the bus may halt the trajectory for any time. A time limit applies only to records that do not
    progress although the trajectory is not halted.
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
            if motion.highest_percent > 100:  # 100 % is the default of a cleared queue
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
        """Trajectory time reached at `_progress_s`."""

    def _preloaded(self) -> bool:
        """Send records to free places; return whether every queue has enough records to start."""
        now_s = self._link.now_s()
        for feed in self._feeds:
            feed.update(now_s)
        fill(self._feeds)
        return all(axis.read(od.BUFFER_POSITION) >= self._least_records for axis in self._axes)

    def _start_together(self) -> None:
        """Latch every axis' start bit, then send one SYNC: all axes start in the same servo tick."""
        for axis in self._axes:
            axis.send_latched_controlword(ENABLE_OPERATION | Control.START)
            axis.pvt_status = None  # a report from before the start must not be used
        self._link.network.send_message(COB_SYNC, b"")
        try:
            require(self._link, lambda: all(map(_started, self._axes)), "not all axes start", REPLY_TIMEOUT_S)
        except BusError:
            stop_others([axis for axis in self._axes if _started(axis)])
            raise

    @property
    def fraction(self) -> float:
        """Fraction of the records that has been sent, 0 to 1."""
        return min(feed.fraction for feed in self._feeds)

    @property
    def trajectory_s(self) -> float:
        """Lower bound of the trajectory time: the begin of the record last reported as executing."""
        return self._reached.least_s

    @property
    def halted(self) -> bool:
        """True if, by the last reports, the machine is at standstill within its trajectory."""
        return all(axis.halted for axis in self._axes)

    def wait(self, dt_s: float) -> None:
        """Wait, and switch outputs during the motion as soon as the board has reached their time."""
        looks = self._schedule.times_to_look(self._link.now_s(), dt_s)
        for look in range(1, looks + 1):
            self._link.wait(dt_s / looks)
            if look < looks:
                self._switch_promptly()

    def _switch_promptly(self) -> None:
        """Switch due outputs between two polls."""
        if self._schedule.is_prompt and not self.halted:
            self._schedule.tend(self._link.now_s())

    def tend(self) -> None:
        """Send records, switch due outputs and check the input of a wait; set `ended` at the end.

        Call it at least as often as the queues' reserve requires, and never in a frame's callback.

        Raises:
            DeviceFaultError: an axis is in fault, was stopped, refuses a record or has run out of records.
            WaitTimeoutError: an input has not reached its level in time; the axes are at standstill and the motion has
                ended.
            BusError: an axis no longer reports its status, or the motion stalls although it is not halted.
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

        It is not called after a time-out: then the queues run empty at standstill.
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
    """Check the axis' position, then clear its queue and its start bit, whose rise starts a trajectory."""
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
    """Return whether an axis runs or has run: a short trajectory may already have ended."""
    running = axis.pvt_status is not None and bool(axis.pvt_status.flags & PvtFlag.RUNNING)
    return axis.done or (running and axis.interpolating)
