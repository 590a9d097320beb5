"""Results of runs, and the data of their pictures.

A position is reported without a time of the motion, and a pause or a computer that is too slow delays it by any amount.
But the axis also reports which record it executes, and both frames have the time when they were on the bus. The
motion never gets ahead of that clock, or of the clock at the highest speed that it was given on the way, so the
motion's time of each position lies between two bounds. They are some 20 ms apart, through pauses as well: one record of
10 ms, and the time for which a report may wait for the bus.
"""

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import count
from threading import Lock
from typing import Final

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from steptwin.host.client.drive_status import DriveStatus
from steptwin.host.common.arrays import FloatArray
from steptwin.host.operate.running import LiveOutcome
from steptwin.host.operate.session import Session
from steptwin.host.planning.plan import Plan, highest_speed
from steptwin.protocol.frame import COB_TPDO
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import SEQUENCE_MODULUS, VELOCITY_PER_UNIT_PER_MS, PvtStatus

REPORTS_MAX: Final = 1024
"""Reports of each kind that are kept of an axis: more than a picture shows."""


class Thinned:
    """A list of times and whole numbers that keeps each, or each second, fourth ..., so that it stays short."""

    def __init__(self) -> None:
        self.items: list[tuple[float, int]] = []
        self._count = 0
        self._every = 1

    def add(self, time_s: float, number: int) -> None:
        if self._count % self._every == 0:
            if len(self.items) == REPORTS_MAX:
                del self.items[1::2]
                self._every *= 2
            self.items.append((time_s, number))
        self._count += 1


class AxisReports:
    """The reports of one axis during a motion, each with the time when it was on the bus.

    Attributes:
        places: the positions reported by TPDO1, in wire units.
        records: the numbers, from 0 on, of the records that TPDO3 reports as executed.
    """

    def __init__(self) -> None:
        self.places: Thinned = Thinned()
        self.records: Thinned = Thinned()
        self._executing = 0

    def take_place(self, time_s: float, data: bytes) -> None:
        """Take a TPDO1; raise ValueError if it is none."""
        self.places.add(time_s, DriveStatus.decode(data).position_units)

    def take_record(self, time_s: float, data: bytes) -> None:
        """Take a TPDO3, which tells the record's number modulo 256; raise ValueError if it is none."""
        ahead = (PvtStatus.decode(data).executing - self._executing) % SEQUENCE_MODULUS
        if ahead < SEQUENCE_MODULUS // 2:  # otherwise it is an old one
            self._executing += ahead
            self.records.add(time_s, self._executing)


_QUEUED_S: Final = 0.005
"""Longest time for which a report waits for the bus."""
_RATE_MAX: Final = 1.0005
"""Seconds of the motion in a second of the bus' clock, at most: two quartz crystals differ by less."""
_LOOKS: Final = 33
"""Number of instants between the bounds where a report is compared with the plan."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Positions of an axis during a motion; the last place is where it stood after the end.

    Attributes:
        t_s: the motion's time of each report: of those that are possible the one where the plan is nearest.
        units: the positions reported, in wire units.
        error_steps: how far each is from the plan at every time that is possible, in steps; 0 if the plan passes there.
    """

    t_s: FloatArray
    units: FloatArray
    error_steps: FloatArray


def placed(outcome: LiveOutcome, reports: tuple[AxisReports, ...], *, faster: bool = False) -> tuple[Placed, ...]:
    """Return where each axis was during the last repetition of a run, which may have run `faster` than planned."""
    rate_max = _RATE_MAX * (highest_speed(outcome.plan).percent / 100 if faster else 1)
    return tuple(
        _placed(outcome.plan, axis, reported, end.end_units, rate_max)
        for axis, (reported, end) in enumerate(zip(reports, outcome.axes, strict=True))
    )


def _placed(plan: Plan, axis: int, reports: AxisReports, end_units: int, rate_max: float) -> Placed:
    lower_s, upper_s = time_bounds(plan, reports, rate_max)
    last_s = plan.times_ms[-1:] / 1000
    lower_s, upper_s = np.append(lower_s, last_s), np.append(upper_s, last_s)
    units = np.append(_columns(reports.places)[1], end_units)
    looks_s = np.linspace(lower_s, upper_s, _LOOKS, axis=1)
    velocities = plan.velocities[:, axis] * (1000 / VELOCITY_PER_UNIT_PER_MS)
    planned = CubicHermiteSpline(plan.times_ms / 1000, plan.points_units[:, axis], velocities)(looks_s)
    nearest = np.abs(planned - units[:, np.newaxis]).argmin(axis=1)
    t_s = looks_s[np.arange(units.size), nearest]
    error_units = units - np.clip(units, planned.min(axis=1), planned.max(axis=1))
    return Placed(
        np.maximum.accumulate(t_s),  # in their order, also where the plan turns back
        units,
        error_units * plan.robot.axes[axis].transmission.microsteps / UNITS_PER_FULL_STEP,
    )


def time_bounds(plan: Plan, reports: AxisReports, rate_max: float = _RATE_MAX) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest time of the motion, in seconds, when each position can have been taken."""
    begins_s = plan.times_ms / 1000
    place_s, _ = _columns(reports.places)
    record_s, numbers = _columns(reports.records)
    executed = np.minimum(numbers.astype(np.int64), begins_s.size - 2)
    at_s = np.concatenate((place_s, record_s))
    lower_s = np.concatenate((np.zeros(place_s.size), begins_s[executed]))
    upper_s = np.concatenate((np.full(place_s.size, begins_s[-1]), begins_s[executed + 1] + _QUEUED_S))
    order = np.argsort(at_s, kind="stable")
    clock_s = rate_max * (at_s[order] - at_s[order][:1])
    lower_s, upper_s = lower_s[order], upper_s[order]
    upper_s = np.minimum.accumulate(upper_s - clock_s) + clock_s  # not ahead of the clock since an earlier report
    upper_s = np.minimum.accumulate(upper_s[::-1])[::-1]  # nor beyond where a later one still was
    lower_s = np.maximum.accumulate((lower_s - clock_s)[::-1])[::-1] + clock_s
    lower_s = np.maximum.accumulate(lower_s)
    positions = np.argsort(order, kind="stable")[: place_s.size]
    lower_s = np.clip(lower_s[positions] - _QUEUED_S, 0.0, begins_s[-1])
    upper_s = np.clip(upper_s[positions], 0.0, begins_s[-1])
    return np.minimum(lower_s, upper_s), upper_s


def _columns(reports: Thinned) -> tuple[FloatArray, FloatArray]:
    columns = np.array(reports.items, dtype=np.float64).reshape(-1, 2)
    return columns[:, 0], columns[:, 1]


RESULTS_MAX: Final = 20
"""Number of runs that are kept."""


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A run that has ended.

    Attributes:
        number: counts up from 1.
        wall_s: when it ended, in seconds since 1970.
        name: name of the motion.
        passed: True if every axis ended at the planned step; None if the run was stopped or failed.
        why: why it was stopped or failed, in one line; None otherwise.
        outcome: plan, end of each axis and waits; None if the run was stopped or failed.
        placed: where each axis was during the last repetition; empty if the run was stopped or failed.
    """

    number: int
    wall_s: float
    name: str
    passed: bool | None
    why: str | None
    outcome: LiveOutcome | None
    placed: tuple[Placed, ...] = ()


class RunResults:
    """The last runs that have ended, and what the axes report during the one that goes on; any thread may read them."""

    def __init__(self) -> None:
        self._collected: tuple[AxisReports, ...] = ()
        """What each axis has reported since `begin`; nothing while none runs."""
        self._faster = False
        """True once the run that goes on was seen to be faster than planned."""
        self._numbers = count(1)
        self._results: deque[Result] = deque(maxlen=RESULTS_MAX)
        self._lock = Lock()

    def listen(self, session: Session) -> None:
        """Listen to the axes of a session, as long as its link is open."""
        for number, axis in enumerate(session.machine.axes):
            for cob_id, take in ((COB_TPDO[0], AxisReports.take_place), (COB_TPDO[2], AxisReports.take_record)):
                session.link.network.subscribe(cob_id + axis.node_id, partial(self._received, number, take))

    def _received(
        self, axis: int, take: Callable[[AxisReports, float, bytes], None], _cob_id: int, data: bytearray, time_s: float
    ) -> None:
        collected = self._collected
        if collected:
            with suppress(ValueError):
                take(collected[axis], time_s or time.monotonic(), bytes(data))  # some interfaces tell no time

    def begin(self, axes: int) -> None:
        """Collect reports from now on, and forget what was collected before."""
        self._collected = tuple(AxisReports() for _ in range(axes))
        self._faster = False

    def note_faster(self) -> None:
        self._faster = True

    def end(self, name: str, outcome: LiveOutcome | None, why: str | None) -> None:
        """Keep a run that has ended, with its outcome or with the reason why it has none; collect no more."""
        reports, self._collected = self._collected, ()
        result = Result(
            number=next(self._numbers),
            wall_s=time.time(),
            name=name,
            passed=outcome.passed if outcome else None,
            why=why,
            outcome=outcome,
            placed=placed(outcome, reports, faster=self._faster) if outcome and reports else (),
        )
        with self._lock:
            self._results.append(result)

    def all(self) -> tuple[Result, ...]:
        with self._lock:
            return tuple(self._results)
