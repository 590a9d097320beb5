"""Stream a trajectory: feed the queues, switch outputs, notice faults, a halt and the end."""

from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.faults import check_enabled, check_faults
from steptwin.host.client.links.link import Link
from steptwin.host.client.output_schedule import OutputCommand, OutputSchedule
from steptwin.host.client.queue_feed import QueueFeed, TrajectoryTime, fill
from steptwin.host.client.waiting import POLL_S
from steptwin.host.client.waits import Waits
from steptwin.host.common.errors import BusError

_STALL_S: Final = 5.0
"""Time limit for a record: one of 255 ms takes up to sqrt(2 * 0.255 * 16.3) = 2.9 s at the end of a slow halt ramp."""


class Stream:
    """A trajectory that the axes execute; `Machine.wait` tends it, and `ended` becomes True at its end.

    Any program on the bus may halt the trajectory. A halt may last as long as it likes: a time limit holds only for
    records that do not go on although nothing halts them.
    """

    def __init__(
        self,
        link: Link,
        axes: tuple[AxisClient, ...],
        feeds: list[QueueFeed],
        fed_ms: list[int],
        outputs: tuple[OutputCommand, ...],
        waits: Waits,
    ) -> None:
        """Follow a motion that has just been started.

        `fed_ms` has the durations of all records that the feeds have so far, `outputs` the commands within them.
        """
        self.ended = False
        self.waits = waits
        self._link = link
        self._axes = axes
        self._feeds = feeds
        now_s = link.now_s()
        self._reached = TrajectoryTime(fed_ms, now_s)
        self._schedule = OutputSchedule(axes, outputs, self._reached)
        self._seen = axes[0].pvt_status
        self._progress_s = now_s
        self._progress_at_s = 0.0
        """The trajectory time that was reached at `_progress_s`."""

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
        fill(self._feeds)
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
