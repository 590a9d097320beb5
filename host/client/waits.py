"""Hold a stream at rest until an input has its level: feed records without motion, a bounded time ahead.

While it waits, all axes go on executing records, of displacement and velocity 0 and of the same duration. So they stay
in phase, the time that has passed is a whole number of milliseconds, and the executed motion is the planned one with a
standstill in it. The records already sent when the input gets its level are executed before the next leg.
"""

from collections.abc import Sequence
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.input_wait import InputWait, Leg
from steptwin.host.client.output_schedule import OutputSchedule, has_come
from steptwin.host.client.queue_feed import QueueFeed
from steptwin.host.client.trajectory_time import TrajectoryTime
from steptwin.host.common.errors import WaitTimeoutError
from steptwin.protocol import od

HOLD_MS: Final = 10
"""Duration of a record without motion."""
LEAD_MS: Final = 250
"""Least time for which records are queued ahead while a wait lasts: so late may this program be."""


class Waits:
    """The waits of one stream: releases a leg's records and outputs when the wait before it is over."""

    def __init__(self, axes: tuple[AxisClient, ...], waits: Sequence[InputWait], legs: Sequence[Leg]) -> None:
        """Prepare the waits; `legs` are the trajectory's, one more than waits."""
        self._axes = axes
        self._waits = tuple(waits)
        self._legs = tuple(legs)
        self._over = 0
        """Number of waits that are over; this is also the number of the present one."""
        self._holds_ms = [0] * len(self._waits)
        first_ms = sum(self._legs[0].records[0].durations_ms)
        if self._waits:
            while first_ms + self._holds_ms[0] < LEAD_MS:
                self._holds_ms[0] += HOLD_MS
        self._begin_ms = first_ms
        """Executed time at which the present wait begins."""
        self._timed_out = False

    @property
    def holds_ms(self) -> tuple[int, ...]:
        """Duration of the standstill at each wait that has begun, the present one as far as its records go."""
        return tuple(self._holds_ms[: self._over + 1])

    @property
    def present(self) -> InputWait | None:
        """The wait before which the records end that are released so far; None after the last one."""
        return self._waits[self._over] if self._over < len(self._waits) and not self._timed_out else None

    def feed_first(self, feeds: Sequence[QueueFeed]) -> None:
        """Give the feeds, which hold the first leg, what else must be queued before the start."""
        later = sum(len(leg.records[0].durations_ms) for leg in self._legs[1:])
        for feed in feeds:
            feed.expect(later)
            feed.hold(HOLD_MS, sum(self._holds_ms) // HOLD_MS)

    def tend(self, feeds: Sequence[QueueFeed], reached: TrajectoryTime, schedule: OutputSchedule, now_s: float) -> None:
        """Look at the input if the machine has come to the wait; release the next leg, or more records to hold."""
        wait = self.present
        if wait is None:
            return
        begin_s = self._begin_ms / 1000
        if has_come(begin_s, reached, self._axes[0], now_s):
            if bool(self._axes[wait.axis].read(od.DIGITAL_INPUTS) & wait.input) is wait.on:
                self._release(feeds, reached, schedule)
                return
            if has_come(begin_s + wait.timeout_s, reached, self._axes[0], now_s):
                self._timed_out = True
                for feed in feeds:
                    feed.expect(0)  # the queues run dry at rest, which ends the motion
                return
        released_ms = self._begin_ms + self._holds_ms[self._over]
        while released_ms - 1000 * reached.most_s(now_s) < LEAD_MS:
            released_ms += HOLD_MS
            self._holds_ms[self._over] += HOLD_MS
            reached.extend([HOLD_MS])
            for feed in feeds:
                feed.hold(HOLD_MS)

    def check_end(self) -> None:
        """Raise WaitTimeoutError if the stream has ended at a wait whose time-out has passed."""
        if self._timed_out:
            raise WaitTimeoutError(self._waits[self._over].timeout_text)

    def _release(self, feeds: Sequence[QueueFeed], reached: TrajectoryTime, schedule: OutputSchedule) -> None:
        """Release the leg after the present wait."""
        held_s = sum(self._holds_ms) / 1000
        self._begin_ms += self._holds_ms[self._over]
        self._over += 1
        leg = self._legs[self._over]
        for feed, records in zip(feeds, leg.records, strict=True):
            feed.add(records)
        durations_ms = leg.records[0].durations_ms
        reached.extend(durations_ms)
        self._begin_ms += sum(durations_ms)
        schedule.add(command._replace(from_s=command.from_s + held_s) for command in leg.outputs)
