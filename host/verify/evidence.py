"""Evidence of a run: the pins as the drivers saw them, and the steps that they accepted.

Every instant is an int64 number of counts of the board's timer since power-up.

A pause halts the trajectory's time, and a change of speed makes it slower or faster. A board records each ramp of the
rate of that time; the rate is that of the plan when a motion starts. The integral of the rate is the trajectory's time,
by which a motion is compared with its plan, with or without pauses.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int16Array, Int32Array, Int64Array
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.od import FULL_RATE_Q16
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class RateRamps:
    """Linear changes of the rate of an axis' time, in order of time; all arrays have shape (n,).

    Attributes:
        counts: instant when each begins.
        from_q16: rate at its beginning; 65 536 is that of the plan.
        to_q16: rate at its end, which stays until the next one.
        lasts_counts: its duration, unless the next one begins earlier.
    """

    counts: Int64Array
    from_q16: Int64Array
    to_q16: Int64Array
    lasts_counts: Int64Array

    def trajectory_s(self, counts: Int64Array, start_counts: int) -> FloatArray:
        """Return the trajectory's time at instants, of any shape; t = 0 is at `start_counts`."""
        began = np.searchsorted(self.counts, start_counts)
        since: FloatArray = (counts - start_counts) / COUNTS_PER_SECOND
        if began == self.counts.size:
            return since
        begin_s = np.append(0.0, (self.counts[began:] - start_counts) / COUNTS_PER_SECOND)
        lasts_s = np.append(0.0, self.lasts_counts[began:] / COUNTS_PER_SECOND)
        from_rate = np.append(1.0, self.from_q16[began:] / FULL_RATE_Q16)
        to_rate = np.append(1.0, self.to_q16[began:] / FULL_RATE_Q16)

        def passed_s(ramp: Int64Array, dt_s: FloatArray) -> FloatArray:
            """Return the trajectory's time that has passed since the beginning of a ramp."""
            ramped_s = np.minimum(dt_s, lasts_s[ramp])
            part = np.divide(ramped_s, lasts_s[ramp], out=np.zeros_like(dt_s), where=lasts_s[ramp] > 0)
            mean = from_rate[ramp] + (to_rate - from_rate)[ramp] * part / 2
            return np.asarray(mean * ramped_s + to_rate[ramp] * (dt_s - ramped_s))

        ramps = np.arange(begin_s.size)
        reached_s = np.append(0.0, np.cumsum(passed_s(ramps[:-1], np.diff(begin_s))))
        at = np.maximum(np.searchsorted(begin_s, since, side="right") - 1, 0)
        return np.asarray(reached_s[at] + passed_s(at, np.asarray(since - begin_s[at])))

    def instant_counts(self, t_s: float, start_counts: int, until_counts: int) -> int:
        """Return the first instant, at most `until_counts`, when the trajectory has reached a time."""
        low, high = start_counts, until_counts
        while low < high:
            middle = (low + high) // 2
            if float(self.trajectory_s(np.array(middle), start_counts)) < t_s:
                low = middle + 1
            else:
                high = middle
        return low

    def speeds(self, start_counts: int) -> "tuple[SpeedReport, ...]":
        """Return the speed changes of a motion since its start."""
        began = int(np.searchsorted(self.counts, start_counts))
        since_s = (self.counts[began:] - start_counts) / COUNTS_PER_SECOND
        times_s = self.trajectory_s(self.counts[began:], start_counts)
        return tuple(
            SpeedReport(round(to * 100 / FULL_RATE_Q16, 2), after_s, t_s, lasts / COUNTS_PER_SECOND)
            for to, after_s, t_s, lasts in zip(
                self.to_q16[began:].tolist(),
                since_s.tolist(),
                times_s.tolist(),
                self.lasts_counts[began:].tolist(),
                strict=True,
            )
        )


@dataclass(frozen=True, slots=True)
class SpeedReport:
    """A change of a motion's speed on the way.

    Attributes:
        percent: the new speed in percent of the planned one; 0 for a pause.
        after_s: time since the motion's start when the change began, by the clock.
        at_s: the trajectory's time then.
        ramp_s: time until the new speed was reached, unless another change came first.
    """

    percent: float
    after_s: float
    at_s: float
    ramp_s: float


_NONE: Final = np.empty(0, dtype=np.int64)
AS_PLANNED: Final = RateRamps(_NONE, _NONE, _NONE, _NONE)
"""Ramps of a trajectory time that equals the clock's."""


@dataclass(frozen=True, slots=True)
class LevelEdges:
    """Changes of a pin that is held at a level; the pin is low at power-up.

    Attributes:
        counts: shape (n,), instant of each change, sorted; two changes at one instant are a pulse shorter than a count.
        levels: shape (n,), level after each change, 0 or 1.
    """

    counts: Int64Array
    levels: Int8Array


@dataclass(frozen=True, slots=True)
class DriverLimit:
    """A limit that a driver's data sheet or module sets.

    Attributes:
        rule: short name, for programs.
        broken: the fault when the limit is broken and its consequence, for people.
        limit: the limiting value.
        unit: unit of the limiting value.
        source: document and place that state the limit.
    """

    rule: str
    broken: str
    limit: float
    unit: str
    source: str


@dataclass(frozen=True, slots=True)
class DriverViolations:
    """Violations of one driver's limits, in order of time.

    Attributes:
        limits: the limits of the driver.
        counts: shape (n,), instant of each violation.
        which: shape (n,), index of the broken limit in `limits`.
        values: shape (n,), value that broke the limit, in the limit's unit.
    """

    limits: tuple[DriverLimit, ...]
    counts: Int64Array
    which: Int8Array
    values: FloatArray


SIXTEENTHS: Final = 16
"""Substeps in a full step of a driver without finer modes, such as a TB6560, and in older records of any run."""


@dataclass(frozen=True, slots=True)
class Phases:
    """Electrical angle and phase currents that one driver sets, from each instant on; all arrays have shape (n,).

    Attributes:
        counts: instants of the changes, sorted.
        substeps: electrical angle of the field within its cycle of four full steps; it grows with DIR low.
        a_ma: current to which the driver regulates phase A, in mA.
        b_ma: current to which the driver regulates phase B, in mA.
        per_full_step: substeps in a full step; each step of each of the driver's modes is a whole number of them.
    """

    counts: Int64Array
    substeps: Int32Array
    a_ma: Int16Array
    b_ma: Int16Array
    per_full_step: int = SIXTEENTHS

    @property
    def cycle(self) -> int:
        """Substeps in the field's cycle."""
        return 4 * self.per_full_step


@dataclass(frozen=True, slots=True)
class Slips:
    """Instants of a motor's slips, unseen by its driver; both arrays have shape (n,).

    Attributes:
        counts: the instants, sorted.
        full_steps: full steps by which the rotor jumped, positive towards higher positions.
    """

    counts: Int64Array
    full_steps: Int64Array


NO_SLIPS: Final = Slips(_NONE, _NONE)


@dataclass(frozen=True, slots=True)
class AxisEvidence:
    """Pins of one axis and the steps that its driver accepted; all instants are sorted.

    The board's STEP is the chip's CLK, or its inverse if the falling edge is active.

    Attributes:
        name: name of the joint.
        start_steps: position of the motor at power-up, in steps from the joint's zero.
        clk_rise_counts: shape (pulses,), every rise of STEP, whether the driver accepts the pulse or not.
        clk_fall_counts: shape (pulses,), the fall that ends each pulse.
        active_edge: the edge of STEP with which the chip's CLK rises.
        dir_edge_counts: shape (d,), every change of the DIR pin.
        dir_levels: shape (d,), level after each change of DIR, 0 or 1.
        step_counts: shape (steps,), the rises of the pulses that the driver accepted.
        step_signs: shape (steps,), direction of the motor in each step, +1 or -1.
        violations: violations of the driver's limits.
        phases: electrical angle and currents.
        pins: the axis' other pins by lower-case name: `reset`, `enable`, `m1`, ..., `out1`, `out2`.
        slips: slips of the motor that its driver did not count.
        rates: rate of the axis' trajectory time.
    """

    name: str
    start_steps: int
    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    active_edge: ActiveEdge
    dir_edge_counts: Int64Array
    dir_levels: Int8Array
    step_counts: Int64Array
    step_signs: Int8Array
    violations: DriverViolations
    phases: Phases
    pins: Mapping[str, LevelEdges]
    slips: Slips = NO_SLIPS
    rates: RateRamps = AS_PLANNED

    @property
    def last_counts(self) -> int:
        """Instant of the last edge of any pin; 0 without edges."""
        edges = (self.clk_fall_counts, self.dir_edge_counts, *(pin.counts for pin in self.pins.values()))
        return max((int(counts[-1]) for counts in edges if counts.size), default=0)


@dataclass(frozen=True, slots=True)
class OutputEdge:
    """Change of a digital output to a level, 0 or 1."""

    name: str
    counts: int
    level: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """Evidence of one run: all axes, changes of the outputs in order of time, and evidence of features by name.

    The planned trajectory's t = 0 is the board's instant `start_counts`.
    """

    start_counts: int
    axes: tuple[AxisEvidence, ...]
    outputs: tuple[OutputEdge, ...] = ()
    features: Mapping[str, Any] = field(default_factory=dict)

    def trajectory_s(self, counts: int) -> float:
        """Return the trajectory's time at an instant, by the first axis, whose reports the host follows."""
        return float(self.axes[0].rates.trajectory_s(np.array(counts), self.start_counts))
