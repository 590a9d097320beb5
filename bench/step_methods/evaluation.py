"""Measure every method in the same way: its steps against the exact crossings of the planned motion, step by step.

The position error of a step is the distance of the planned motion, at the time of the step's edge, from the threshold
that the step stands for. Its timing error is the time from the crossing of that threshold to the edge; crossings slower
than 1 % of the axis' fastest are left out, since near a reversal time is ill-defined. Jitter is the error of the
interval between two successive steps at constant speed (planned to change by less than 1 % between them).

Between two passages of the same threshold in the same direction a motion must turn around twice. So a step and a
crossing belong together if they pass the same threshold in the same direction and each is the other's nearest in time.
A step that comes many intervals late, or a step left out at a reversal, does not shift any other pair.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.bench.step_methods import AxisPulses, Method
from steptwin.bench.step_methods.motions import PlannedMotion
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.twin.machine.drivers import driver_profile, fitted_module
from steptwin.host.verify.matching import SLOW_CROSSING
from steptwin.host.verify.oracle import THRESHOLD_STEPS, IdealSteps, IndexArray, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_POWERED: Final = tuple(LevelChange(0, pin, 1) for pin in (*Rail, Pin.RESET, Pin.ENABLE))
_BEGIN_COUNTS: Final = COUNTS_PER_MS
"""The motion's t = 0, in counts after power-up."""
_SETTLED_COUNTS: Final = 1000 * COUNTS_PER_MS
"""Time after the last pulse, longer than any delay within a driver."""


def violations(axis: AxisPulses, microsteps: int, board: BoardSettings) -> int:
    """Feed the pulses to a driver of the board's profile; return the number of broken limits."""
    profile = driver_profile(board)
    driver = Driver(fitted_module(board, profile, microsteps))
    driver.feed(TerminalEdges(NO_COUNTS, NO_COUNTS, NO_COUNTS, NO_LEVELS, _POWERED, _BEGIN_COUNTS))
    rises, falls, turns = (counts + _BEGIN_COUNTS for counts in (axis.rise_counts, axis.fall_counts, axis.dir_counts))
    until_counts = int(np.max(falls, initial=_BEGIN_COUNTS)) + _SETTLED_COUNTS
    driver.feed(TerminalEdges(rises, falls, turns, axis.dir_levels, (), until_counts))
    return driver.violation_count


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """Indices of the paired crossings and steps, both of shape (pairs,), in order of the crossings."""

    ideal: IndexArray
    made: IndexArray
    missing: int
    """Number of crossings without a step."""
    extra: int
    """Number of steps without a crossing."""


def pair(
    start_steps: int, ideal_s: FloatArray, ideal_signs: Int8Array, made_s: FloatArray, made_signs: Int8Array
) -> Pairing:
    """Pair the crossings and the steps of one axis; both are sorted by time."""
    if not (len(ideal_s) and len(made_s)):
        none = np.empty(0, np.intp)
        return Pairing(none, none, len(ideal_s), len(made_s))
    span_s = 4 * (max(ideal_s[-1], made_s[-1]) - min(ideal_s[0], made_s[0]) + 1)
    ideal_keys, made_keys = _passages(start_steps, ideal_signs), _passages(start_steps, made_signs)
    keys = np.unique(np.concatenate((ideal_keys, made_keys)), return_inverse=True)[1]
    # Shift every threshold and direction into a time span of its own, so that one search finds all nearest neighbours.
    ideal_at, made_at = keys[: len(ideal_s)] * span_s + ideal_s, keys[len(ideal_s) :] * span_s + made_s
    to_made, to_ideal = _nearest(ideal_at, made_at), _nearest(made_at, ideal_at)
    mutual = to_ideal[to_made] == np.arange(len(ideal_s))
    ideal = np.flatnonzero(mutual & (np.abs(ideal_at - made_at[to_made]) < span_s / 2))
    return Pairing(ideal, to_made[ideal], len(ideal_s) - len(ideal), len(made_s) - len(ideal))


def _passages(start_steps: int, signs: Int8Array) -> Int64Array:
    """Return for each step a number that identifies its threshold and its direction."""
    after = start_steps + np.cumsum(signs, dtype=np.int64)
    passages: Int64Array = 2 * np.minimum(after, after - signs) + (signs > 0)
    return passages


def _nearest(values: FloatArray, candidates: FloatArray) -> IndexArray:
    """Return for each value the index of the nearest candidate; both may be unsorted."""
    order = np.argsort(candidates, kind="stable")
    ordered = candidates[order]
    right = np.minimum(np.searchsorted(ordered, values), len(ordered) - 1)
    left = np.maximum(right - 1, 0)
    nearer_left = np.abs(values - ordered[left]) <= np.abs(ordered[right] - values)
    nearest: IndexArray = order[np.where(nearer_left, left, right)]
    return nearest


STEADY = 0.01
"""Largest relative change of speed from one step to the next that counts as constant speed."""


@dataclass(frozen=True, slots=True)
class MethodErrors:
    """One row of the table: a method on a motion, all axes together; errors are magnitudes.

    A figure is None if no step of the motion qualifies for it.
    """

    motion: str
    method: str
    steps: int
    missing: int
    extra: int
    error_steps_max: float
    error_steps_rms: float
    timing_us_p50: float | None
    timing_us_p99: float | None
    timing_us_max: float | None
    jitter_us_rms: float | None
    violations: int
    steps_per_s: float
    cortex_m3_percent: float | None
    """Load of the board's processor in the busiest 10 ms, metered; None if it was not."""


@dataclass(frozen=True, slots=True, eq=False)
class StepErrors:
    """Errors of one axis.

    Attributes:
        steps: position error of each step made, signed, shape (steps,).
        timing_us: timing error of each pair but the slow ones, positive if late, shape (fast pairs,).
        jitter_us: interval error of successive pairs at constant speed, shape (intervals,).
    """

    steps: FloatArray
    timing_us: FloatArray
    jitter_us: FloatArray
    pairing: Pairing


def ideal_of(motion: PlannedMotion) -> tuple[IdealSteps, ...]:
    """Return the exact crossings of a motion for each axis."""
    return ideal_steps(motion.exact, motion.steps_per_unit, motion.start_steps)


def figures_of(
    motion: PlannedMotion, ideal: tuple[IdealSteps, ...], method: Method, cortex_m3_percent: float | None = None
) -> MethodErrors:
    """Let a method place a motion and measure the result; its load of the board's processor is metered elsewhere."""
    placed = method.place(motion)
    errors = [step_errors(motion, axis, ideal[axis], pulses) for axis, pulses in enumerate(placed.axes)]
    steps = np.concatenate([axis.steps for axis in errors])
    timing_us = np.abs(np.concatenate([axis.timing_us for axis in errors]))
    p50, p99, worst = np.percentile(timing_us, [50, 99, 100]).tolist() if timing_us.size else [None] * 3
    return MethodErrors(
        motion.name,
        method.key,
        len(steps),
        sum(axis.pairing.missing for axis in errors),
        sum(axis.pairing.extra for axis in errors),
        float(np.abs(steps).max(initial=0.0)),
        _rms(steps) or 0.0,
        p50,
        p99,
        worst,
        _rms(np.concatenate([axis.jitter_us for axis in errors])),
        sum(violations(*axis, motion.board) for axis in zip(placed.axes, motion.microsteps.tolist(), strict=True)),
        len(steps) / placed.wall_s,
        cortex_m3_percent,
    )


def step_errors(motion: PlannedMotion, axis: int, ideal: IdealSteps, pulses: AxisPulses) -> StepErrors:
    """Measure the pulses of one axis."""
    made_s, signs = pulses.rise_counts / COUNTS_PER_SECOND, pulses.signs
    pairing = pair(ideal.start_steps, ideal.time_s, ideal.signs, made_s, signs)
    late_us = (made_s[pairing.made] - ideal.time_s[pairing.ideal]) * 1e6
    speeds_hz = ideal.speeds_hz[pairing.ideal]
    fast = speeds_hz >= SLOW_CROSSING * ideal.speeds_hz.max(initial=0.0)
    neighbours = (np.diff(pairing.ideal) == 1) & (np.diff(pairing.made) == 1)
    same_way = np.diff(ideal.signs[pairing.ideal]) == 0
    steady = np.abs(np.diff(speeds_hz)) < STEADY * speeds_hz[1:]
    thresholds = ideal.start_steps + np.cumsum(signs, dtype=np.int64) - signs + signs * THRESHOLD_STEPS
    planned = _positions(motion, axis, made_s)
    return StepErrors(
        planned - thresholds, late_us[fast], np.diff(late_us)[neighbours & same_way & steady & fast[1:]], pairing
    )


def _positions(motion: PlannedMotion, axis: int, t_s: FloatArray) -> FloatArray:
    """Return the planned position of an axis in steps; after its end the motion stands at its last position."""
    chunk = 16_384
    parts = [np.empty(0)]
    for first in range(0, len(t_s), chunk):
        within = np.minimum(t_s[first : first + chunk], motion.exact.duration_s)
        parts.append(motion.exact.positions(within)[:, axis] * motion.steps_per_unit[axis])
    return np.concatenate(parts)


def _rms(values: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None
