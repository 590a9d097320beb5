"""Turn a driver's accepted steps into a count over the trajectory's time; check that they follow from its pins.

While no limit of the driver is violated, the pins decide: each CLK rise outside reset is a step, and DIR gives its
direction. After a violation the driver's model decides, and the run has failed anyway.

A driver makes the steps of its own mode, which its pins or its own switches select. A full step is a quarter of an
electrical cycle, so the angle by which a step turns the field shows the mode.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.verify.evidence import AxisEvidence
from steptwin.protocol.drivers import ActiveEdge


def motor_moves(axis: AxisEvidence, planned: int | None) -> FloatArray:
    """Return the motor's move in each step, shape (steps,), in steps of the planned mode.

    It is +1 or -1 if the driver was in that mode. `planned` are microsteps per full step; None means the driver's own
    mode. A step without a record of the field's angle counts as a step of the planned mode.
    """
    moves: FloatArray = axis.step_signs.astype(np.float64)
    if planned is None:
        return moves
    turns, per_full_step = planned * _turns_substeps(axis), axis.phases.per_full_step
    return moves if (turns == per_full_step).all() else moves * np.where(turns, turns / per_full_step, 1.0)


def _turns_substeps(axis: AxisEvidence) -> Int64Array:
    """Return the angle by which each step turned the field, shape (steps,); 0 if the record does not have it."""
    angles, cycle = axis.phases.substeps.astype(np.int64), axis.phases.cycle
    turns = np.abs((np.diff(angles) + cycle // 2) % cycle - cycle // 2)
    turned = np.flatnonzero(turns)
    at = np.searchsorted(axis.phases.counts[turned + 1], axis.step_counts)  # a module turns the field a little later
    substeps: Int64Array = np.append(turns[turned], 0)[at]
    return substeps


def contradictions(axis: AxisEvidence) -> list[str]:
    """Return one line for each contradiction between an axis' pins and its steps."""
    rises, steps = axis.clk_rise_counts, axis.step_counts
    checks = [(int(np.setdiff1d(steps, rises).size), "steps without a CLK rise")]
    if axis.violations.counts.size == 0:
        heard = rises[_levels_at(rises, axis.pins["reset"].counts, axis.pins["reset"].levels) == 1]
        against = 2 * _levels_at(steps, axis.dir_edge_counts, axis.dir_levels) - 1 != axis.step_signs
        checks += [
            (int(np.setdiff1d(heard, steps).size), "CLK rises without a step, though no limit was broken"),
            (int(np.count_nonzero(against)), "steps against the DIR pin, though no limit was broken"),
        ]
    return [f"{axis.name}: {count} {what}" for count, what in checks if count]


def _levels_at(instants: Int64Array, counts: Int64Array, levels: Int8Array) -> Int8Array:
    """Return a pin's level at each instant, after any edge at that instant; the pin is low before its first edge."""
    history = np.concatenate((np.zeros(1, np.int8), levels))
    return history[np.searchsorted(counts, instants, side="right")]


def powerless_steps(axis: AxisEvidence, start_counts: int) -> int:
    """Return the number of steps from an instant on that came while both phases had no current.

    ENABLE only switches the outputs of a TB6560 (its pin 4, docs/driver.md). Evidence without currents has no such
    steps.
    """
    phases = axis.phases
    if not phases.counts.size:
        return 0
    steps = axis.step_counts[np.searchsorted(axis.step_counts, start_counts) :]
    before = np.searchsorted(phases.counts, steps, side="left") - 1
    known = before >= 0
    off = (phases.a_ma[before] == 0) & (phases.b_ma[before] == 0)
    return int(np.count_nonzero(off & known))


@dataclass(frozen=True, slots=True)
class CountedSteps:
    """Steps of one axis that its driver accepted from the trajectory's t = 0 on.

    A slip of the motor between two steps counts from the first of the two on.

    Attributes:
        time_s: shape (steps,), instant of each step in the trajectory's time.
        signs: shape (steps,), direction of each step, +1 or -1.
        counters: shape (steps + 1,), the driver's count before each step and after the last one.
        positions: shape (steps + 1,), the motor's positions at the same instants, in steps of the planned mode from the
            joint's zero. They are the counts, unless the driver made steps of another mode or the motor slipped.
        longer_by: factors, other than 1, of the length of steps to those of the planned mode.
    """

    time_s: FloatArray
    signs: Int8Array
    counters: Int64Array
    positions: FloatArray
    longer_by: tuple[float, ...] = ()

    @property
    def start_steps(self) -> int:
        """The driver's count at t = 0."""
        return int(self.counters[0])

    @property
    def end_steps(self) -> int:
        """The driver's count after the last step."""
        return int(self.counters[-1])

    def around(self, t_s: FloatArray) -> FloatArray:
        """Return the positions just before and just after each of n sorted instants, shape (2, n).

        Search the instants for the steps, not the steps for the instants: the instants are usually the steps of all
        axes, and one axis has far fewer.
        """
        first, last = np.searchsorted(self.time_s, t_s[0], "left"), np.searchsorted(self.time_s, t_s[-1], "right")
        steps_s = self.time_s[first:last]
        seen_at = [np.searchsorted(t_s, steps_s, side) for side in ("right", "left")]
        made = np.cumsum([np.bincount(at, minlength=t_s.size)[: t_s.size] for at in seen_at], axis=1)
        positions: FloatArray = self.positions[first + made]
        return positions


def counted_steps(axis: AxisEvidence, start_counts: int, microsteps: int | None = None) -> CountedSteps:
    """Return the steps from t = 0 on; earlier steps only set the count at the start.

    Args:
        axis: the evidence.
        start_counts: the board's instant t = 0.
        microsteps: microsteps per full step with which the motion was planned; None: the driver's own.
    """
    first = int(np.searchsorted(axis.step_counts, start_counts, side="left"))
    moves = motor_moves(axis, microsteps)
    positions = axis.start_steps + np.concatenate(([0.0], np.cumsum(moves)))[first:]
    start_steps = positions[0]
    if axis.slips.counts.size:
        slipped, slipped_before = _slipped_steps(axis, start_counts, microsteps)
        positions, start_steps = positions + slipped[first:], start_steps + slipped_before
    signs = axis.step_signs[first:]
    return CountedSteps(
        time_s=axis.rates.trajectory_s(axis.step_counts[first:], start_counts),
        signs=signs,
        counters=int(np.floor(start_steps + 0.5)) + np.concatenate(([0], np.cumsum(signs, dtype=np.int64))),
        positions=positions,
        longer_by=tuple(sorted(set(np.abs(moves[first:][np.abs(moves[first:]) != 1.0]).tolist()))),
    )


def _slipped_steps(axis: AxisEvidence, start_counts: int, microsteps: int | None) -> tuple[Int64Array, int]:
    """Return the motor's slip in steps before each step and after the last one, and before t = 0."""
    if microsteps is None:
        raise ValueError(f"{axis.name}: its motor slipped; how many steps that are, only the planned microsteps tell")
    slips = axis.slips
    steps = slips.full_steps * microsteps
    slipped = np.zeros(axis.step_counts.size + 1, dtype=np.int64)
    np.add.at(slipped, np.searchsorted(axis.step_counts, slips.counts), steps)
    return np.cumsum(slipped), int(steps[slips.counts < start_counts].sum())


class ClkDurations(NamedTuple):
    """Durations of the chip's CLK high, low, and from one rise to the next, in counts and in order of time.

    They compare with the drivers' limits: if the falling edge is active, CLK is high while the board's STEP is low.
    """

    high_counts: Int64Array
    low_counts: Int64Array
    period_counts: Int64Array


def clk_durations(axis: AxisEvidence) -> ClkDurations:
    """Return all durations with both ends on record."""
    rises, falls = axis.clk_rise_counts, axis.clk_fall_counts
    pulses_counts, pauses_counts = falls - rises, rises[1:] - falls[:-1]
    if axis.active_edge is ActiveEdge.FALLING:
        return ClkDurations(pauses_counts, pulses_counts, np.diff(falls))
    return ClkDurations(pulses_counts, pauses_counts, np.diff(rises))
