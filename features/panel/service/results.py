"""Results of runs, and the data of their pictures.

A reported position has no motion time, and pauses or a slow computer delay the motion by any amount. But the axis also
reports its present record, and both frames have their bus time. The motion never runs ahead of that clock, scaled by
the highest speed override. So the motion time of each position has two bounds. They are some 20 ms apart, even through
pauses: one record of 10 ms, and the time for which a report may wait for the bus.
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
"""Number of reports of each kind kept of an axis: more than a picture shows."""


class Thinned:
    """A list of times and whole numbers that stays short: it keeps each, or each second, fourth ... entry."""

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
    """Reports of one axis during a motion, with their bus times.

    Attributes:
        places: positions from TPDO1, in wire units.
        records: numbers, from 0 on, of executed records from TPDO3.
    """

    def __init__(self) -> None:
        self.places: Thinned = Thinned()
        self.records: Thinned = Thinned()
        self._executing = 0

    def take_place(self, time_s: float, data: bytes) -> None:
        """Add a TPDO1; raise ValueError for other data."""
        self.places.add(time_s, DriveStatus.decode(data).position_units)

    def take_record(self, time_s: float, data: bytes) -> None:
        """Add a TPDO3, which has the record's number modulo 256; raise ValueError for other data."""
        ahead = (PvtStatus.decode(data).executing - self._executing) % SEQUENCE_MODULUS
        if ahead < SEQUENCE_MODULUS // 2:  # otherwise it is an old record
            self._executing += ahead
            self.records.add(time_s, self._executing)


_QUEUED_S: Final = 0.005
"""Longest wait of a report for the bus."""
_RATE_MAX: Final = 1.0005
"""Largest motion seconds per second of the bus' clock: two quartz crystals differ by less."""
_LOOKS: Final = 33
"""Number of instants between the bounds where a report is compared with the plan."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Positions of an axis during a motion; the last one is after its end.

    Attributes:
        t_s: motion time of each report: the possible one with the smallest error.
        units: reported positions in wire units.
        error_steps: least distance in steps from the plan within the bounds; 0 if the plan passes there.
    """

    t_s: FloatArray
    units: FloatArray
    error_steps: FloatArray


def placed(outcome: LiveOutcome, reports: tuple[AxisReports, ...], *, faster: bool = False) -> tuple[Placed, ...]:
    """Return the positions of each axis in a run's last repetition; `faster` if it may have run above planned speed."""
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
        np.maximum.accumulate(t_s),  # keep their order even where the plan reverses
        units,
        error_units * plan.robot.axes[axis].transmission.microsteps / UNITS_PER_FULL_STEP,
    )


def time_bounds(plan: Plan, reports: AxisReports, rate_max: float = _RATE_MAX) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest possible motion time of each position, in seconds."""
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
    upper_s = np.minimum.accumulate(upper_s[::-1])[::-1]  # nor beyond a later report's position
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
    """An ended run.

    Attributes:
        number: counts up from 1.
        wall_s: time of its end in seconds since 1970.
        name: name of the motion.
        passed: True if every axis ended at the planned step; None if the run was stopped or failed.
        why: reason of a stop or failure, in one line; otherwise None.
        outcome: plan, end of each axis and waits; None if the run was stopped or failed.
        placed: positions of each axis in the last repetition; empty if the run was stopped or failed.
    """

    number: int
    wall_s: float
    name: str
    passed: bool | None
    why: str | None
    outcome: LiveOutcome | None
    placed: tuple[Placed, ...] = ()


class RunResults:
    """The last ended runs, and the axes' reports during the present one; thread-safe."""

    def __init__(self) -> None:
        self._collected: tuple[AxisReports, ...] = ()
        """Reports of each axis since `begin`; empty without a run."""
        self._faster = False
        """True once the present run was faster than planned."""
        self._numbers = count(1)
        self._results: deque[Result] = deque(maxlen=RESULTS_MAX)
        self._lock = Lock()

    def listen(self, session: Session) -> None:
        """Listen to the axes of a session while its link is open."""
        for number, axis in enumerate(session.machine.axes):
            for cob_id, take in ((COB_TPDO[0], AxisReports.take_place), (COB_TPDO[2], AxisReports.take_record)):
                session.link.network.subscribe(cob_id + axis.node_id, partial(self._received, number, take))

    def _received(
        self, axis: int, take: Callable[[AxisReports, float, bytes], None], _cob_id: int, data: bytearray, time_s: float
    ) -> None:
        collected = self._collected
        if collected:
            with suppress(ValueError):
                take(collected[axis], time_s or time.monotonic(), bytes(data))  # some interfaces give no time

    def begin(self, axes: int) -> None:
        """Start to collect reports; drop earlier ones."""
        self._collected = tuple(AxisReports() for _ in range(axes))
        self._faster = False

    def note_faster(self) -> None:
        self._faster = True

    def end(self, name: str, outcome: LiveOutcome | None, why: str | None) -> None:
        """Store an ended run with its outcome or the reason for none; stop collecting."""
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
