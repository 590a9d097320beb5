"""Switch outputs while a trajectory runs, and hold it at standstill until an input has its level.

The time of an output is trajectory time, which does not advance while the machine is halted. An output is switched when
the board reports a record that begins at the output's time or later, never earlier. The board sends reports only ten
times per second, so the client reads the record number by SDO when an output may be due.

A wait feeds records without motion, a limited time ahead. During a wait all axes execute records with displacement and
velocity 0 and equal durations. So they stay synchronous, a wait lasts whole milliseconds, and the executed motion is
the planned one with a standstill in it. When the input has its level, the records already sent are executed before the
next leg.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from math import ceil
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.queue_feed import QueueFeed, TrajectoryTime
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.common.errors import WaitTimeoutError
from steptwin.host.planning.motion import OutputChange, Wait
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, DigitalOutput


class MachineWiring(NamedTuple):
    """Where a machine's inputs and outputs are wired, by their names: the number of the axis, and the bit there."""

    inputs: Mapping[str, tuple[int, DigitalInput]]
    outputs: Mapping[str, tuple[int, DigitalOutput]]


_PROMPT_S: Final = 0.001
"""Polling period while an output is due during the motion."""
_AGE_S: Final = 0.02
"""Highest age of a report when it is processed: a poll and the records that are sent in it."""


class OutputSchedule:
    """The changes of outputs of one run; each is commanded when it is due, and the motion does not wait for it."""

    def __init__(
        self,
        axes: tuple[AxisClient, ...],
        wiring: MachineWiring,
        changes: Iterable[OutputChange],
        reached: TrajectoryTime,
    ) -> None:
        self._axes = axes
        self._wired = wiring.outputs
        self._pending = deque(sorted(changes, key=lambda change: change.from_s))
        self._reached = reached

    def add(self, changes: Iterable[OutputChange]) -> None:
        """Add changes, in order of time, that are all later than those before."""
        self._pending.extend(changes)

    @property
    def is_prompt(self) -> bool:
        """Whether the next output must change promptly."""
        return bool(self._pending) and self._pending[0].on_the_way

    def times_to_look(self, now_s: float, dt_s: float) -> int:
        """Return the number of polls within a time: more than one if an output must soon change promptly."""
        due = self.is_prompt and self._pending[0].from_s <= self._reached.most_s(now_s + dt_s) + _AGE_S
        return ceil(dt_s / _PROMPT_S) if due else 1

    def tend(self, now_s: float) -> None:
        """Command every change that is due by now."""
        while self._pending and has_come(
            self._pending[0].from_s, self._reached, self._axes[0], now_s, _AGE_S if self._pending[0].on_the_way else 0.0
        ):
            change = self._pending.popleft()
            axis, output = self._wired[change.output]
            self._axes[axis].switch_output(output, on=change.on)


def has_come(t_s: float, reached: TrajectoryTime, axis: AxisClient, now_s: float, age_s: float = 0.0) -> bool:
    """Return whether the trajectory has reached a time; poll the board only if the last report is not sufficient.

    `age_s` is the highest age of the report when it was read, for results that are needed at once.
    """
    if reached.least_s < t_s <= reached.most_s(now_s) + age_s:
        reached.report(axis.executing(), now_s)
    return reached.least_s >= t_s


class Leg(NamedTuple):
    """Part of a trajectory between two waits: the records of each axis and the changes of outputs within it.

    Output times count from the start of the trajectory, without the durations of earlier waits.
    """

    records: tuple[AxisRecords, ...]
    outputs: tuple[OutputChange, ...]


def divide(records: tuple[AxisRecords, ...], outputs: Sequence[OutputChange], waits: Sequence[Wait]) -> tuple[Leg, ...]:
    """Return the legs of a trajectory: one more than it has waits.

    Raises:
        ValueError: a wait is not at the begin of a record, or the waits are not in order of time.
    """
    begins_ms = [0, *accumulate(records[0].durations_ms)]
    at_ms = [round(1000 * wait.at_s) for wait in waits]
    cuts = [0, *(begins_ms.index(each_ms) for each_ms in at_ms), len(begins_ms) - 1]
    if cuts != sorted(cuts):
        raise ValueError(f"the waits at {at_ms} ms are not in order of time")
    limits_ms = [-1, *(each_ms - 1 for each_ms in at_ms), begins_ms[-1]]  # an output at a wait comes after it
    return tuple(
        Leg(
            tuple(AxisRecords(*(fields[begin:end] for fields in own)) for own in records),
            tuple(change for change in outputs if after_ms < round(1000 * change.from_s) <= until_ms),
        )
        for (begin, end), (after_ms, until_ms) in zip(pairwise(cuts), pairwise(limits_ms), strict=True)
    )


HOLD_MS: Final = 10
"""Duration of a record without motion."""
LEAD_MS: Final = 250
"""Time for which records are queued ahead during a wait: the highest allowed lateness of this program."""


class Waits:
    """The waits of one stream. It releases a leg's records and outputs at the end of the wait before."""

    def __init__(
        self, axes: tuple[AxisClient, ...], wiring: MachineWiring, waits: Sequence[Wait], legs: Sequence[Leg]
    ) -> None:
        """Prepare the waits; `legs` are the trajectory's, one more than waits."""
        self._axes = axes
        self._wired = wiring.inputs
        self._waits = tuple(waits)
        self._legs = tuple(legs)
        self._over = 0
        """Number of finished waits, and index of the present one."""
        self._holds_ms = [0] * len(self._waits)
        first_ms = sum(self._legs[0].records[0].durations_ms)
        if self._waits:
            while first_ms + self._holds_ms[0] < LEAD_MS:
                self._holds_ms[0] += HOLD_MS
        self._begin_ms = first_ms
        """Executed time at the begin of the present wait."""
        self.title: str = ""
        """Description of the present wait; empty while the machine moves."""
        self.timed_out: bool = False
        """True after the time-out of the present wait: no more records are fed, and the motion ends."""

    @property
    def holds_ms(self) -> tuple[int, ...]:
        """Duration of each wait reached so far; of the present one, the duration of its records so far."""
        return tuple(self._holds_ms[: self._over + 1])

    @property
    def present(self) -> Wait | None:
        """The wait at the end of the records that are released so far; None after the last one."""
        return self._waits[self._over] if self._over < len(self._waits) and not self.timed_out else None

    def feed_first(self, feeds: Sequence[QueueFeed]) -> list[int]:
        """Add further records that must be queued before the start to the feeds, which have the first leg.

        Return the durations, in milliseconds, of all records that the feeds then have.
        """
        later = sum(len(leg.records[0].durations_ms) for leg in self._legs[1:])
        held = sum(self._holds_ms) // HOLD_MS
        for feed in feeds:
            feed.expect(later)
            feed.hold(HOLD_MS, held)
        return self._legs[0].records[0].durations_ms + [HOLD_MS] * held

    def tend(self, feeds: Sequence[QueueFeed], reached: TrajectoryTime, schedule: OutputSchedule, now_s: float) -> None:
        """Check the input if the machine has reached the wait; release the next leg, or more records without motion."""
        wait = self.present
        if wait is None:
            return
        begin_s = self._begin_ms / 1000
        if has_come(begin_s, reached, self._axes[0], now_s):
            axis, bit = self._wired[wait.input]
            if bool(self._axes[axis].read(od.DIGITAL_INPUTS) & bit) is wait.on:
                self.standing = ""
                self._release(feeds, reached, schedule)
                return
            self.title = wait.title
            if has_come(begin_s + wait.timeout_s, reached, self._axes[0], now_s):
                self.timed_out, self.title = True, ""
                return
        released_ms = self._begin_ms + self._holds_ms[self._over]
        while released_ms - 1000 * reached.most_s(now_s) < LEAD_MS:
            released_ms += HOLD_MS
            self._holds_ms[self._over] += HOLD_MS
            reached.extend([HOLD_MS])
            for feed in feeds:
                feed.hold(HOLD_MS)

    def check_end(self) -> None:
        """Raise WaitTimeoutError if the stream has ended by the time-out of a wait."""
        if self.timed_out:
            raise WaitTimeoutError(self._waits[self._over].timeout_message)

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
        schedule.add(replace(change, from_s=change.from_s + held_s) for change in leg.outputs)
