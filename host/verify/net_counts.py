"""Match the steps of a controller with an unknown step rule to the ideal crossings, run by run.

A run is a stretch of the motion in one direction. Another rule shifts all steps of a direction by about the same
fraction of a step, and a timer's grid delays each a little. So a step and a crossing without partners in the same run
are one step at another time. The rest of a run is missing or additional steps.

Near the end of a run, at a turning point or standstill, the rule alone decides whether a last step is made. Such a step
is grazing if the motion passes its threshold by no more than the distance of this axis' other steps from theirs.
"""

from collections.abc import Callable
from dataclasses import replace
from math import nan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.counted import CountedSteps
from steptwin.host.verify.gates import THRESHOLD_TOLERANCE_STEPS
from steptwin.host.verify.matching import SLOW_CROSSING, Matching, match_nearest, match_steps
from steptwin.host.verify.oracle import HYSTERESIS_STEPS, THRESHOLD_STEPS, IdealSteps

PositionAt = Callable[[FloatArray], FloatArray]
"""Returns an axis' planned position in steps, at instants of the trajectory's time of shape (n,)."""


_SAME_STEP: Final = 1.0
"""Largest distance from its threshold of a step that belongs to that crossing, by any rule."""

_LATE_STEPS: Final = 2.0
"""Tolerance from which on a step may be nearer to a neighbouring crossing than to its own."""

_BEYOND_STEPS: Final = 4 * THRESHOLD_TOLERANCE_STEPS
"""Largest additional distance of a step from an end of its run, beyond the rule: two steps' tolerances."""

WHOLE_STEPS: Final = 1.2
"""Largest distance from the plan of a count at whole steps, with a timer's share; after a lost step it is 1.5."""

_ONE_RULE: Final = 0.75
"""Largest difference between the distances of two steps of one direction from their thresholds by one rule. An
additional or missing step changes it by 1.
"""


def match_any_rule(
    ideal: IdealSteps, counted: CountedSteps, position_at: PositionAt, tolerance_steps: float = _SAME_STEP
) -> Matching:
    """Pair one axis' ideal crossings with its steps by any rule; count missing and additional steps.

    Args:
        ideal: the crossings.
        counted: the steps.
        position_at: the planned motion.
        tolerance_steps: largest lateness or earliness of the controller, in steps.

    Returns:
        The pairs. `unmatched` is the sum over the runs of missing and additional steps, `grazing` the number of steps
        that the rule explains.
    """
    at_once = int(np.searchsorted(ideal.time_s, 0.0, side="right"))
    if at_once:  # crossings at t = 0 from a rounded initial count belong to no step
        moved = replace(
            ideal,
            start_steps=ideal.start_steps + int(ideal.signs[:at_once].sum()),
            time_s=ideal.time_s[at_once:],
            signs=ideal.signs[at_once:],
            speeds_hz=ideal.speeds_hz[at_once:],
        )
        matching = match_any_rule(moved, counted, position_at, tolerance_steps)
        return replace(matching, ideal=matching.ideal + at_once, grazing=matching.grazing + at_once)
    matching = match_steps(ideal, counted)
    off = _off_steps(ideal, counted, matching, position_at)
    off_steps = float(np.abs(off).max(initial=0.0))
    if not matching.unmatched and off_steps <= _SAME_STEP and _by_one_rule(off, ideal.signs):
        return replace(matching, off_steps=off_steps)
    matching = match_nearest(ideal, counted)
    matching = match_nearest(_shifted(ideal, counted, matching), counted)
    off_steps = float(np.abs(_off_steps(ideal, counted, matching, position_at)).max(initial=0.0))
    missing = np.setdiff1d(np.arange(ideal.time_s.size), matching.ideal)
    extra = np.setdiff1d(np.arange(counted.time_s.size), matching.counted)
    time_s = np.concatenate([ideal.time_s[missing], counted.time_s[extra]])
    moves = np.concatenate([-ideal.signs[missing], counted.signs[extra]])
    runs = _runs(ideal, time_s)
    grazing = _near_an_end(time_s, ideal, position_at, min(off_steps, 1.0) + _BEYOND_STEPS)
    if _at_whole_steps(counted, position_at):
        grazing |= np.abs(position_at(time_s)) <= 1.0 + WHOLE_STEPS
    left = _net_moves(runs, moves, ~grazing)
    if (
        tolerance_steps >= _LATE_STEPS
    ):  # pairs mean little then; the run's net count matters, apart from one step of its rule
        net = _net_moves(runs, moves, np.ones_like(grazing))
        by_rule = np.sign(_net_moves(runs, moves, grazing))
        left = np.where(by_rule == np.sign(net), net - by_rule, net)
    alone = moves * left[runs] > 0
    told_s = time_s[alone & ~grazing] if (alone & ~grazing).any() else time_s[alone]
    return replace(
        matching,
        unmatched=int(np.abs(left).sum()),
        first_s=float(told_s.min()) if told_s.size else nan,
        grazing=int(np.count_nonzero(grazing)),
        off_steps=off_steps,
    )


def _at_whole_steps(counted: CountedSteps, position_at: PositionAt) -> bool:
    """Return whether no count is further from the plan than with whole steps.

    Truncation towards zero, as by C's `(int)`, makes one step less where the motion passes through zero.
    """
    planned = position_at(counted.time_s)
    off = (counted.positions[:-1] - planned, counted.positions[1:] - planned)
    return max(float(np.abs(each).max(initial=0.0)) for each in off) <= WHOLE_STEPS


def _net_moves(runs: NDArray[np.int64], moves: NDArray[np.int64], chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the sum of the chosen moves in each run."""
    left = np.zeros(int(runs.max(initial=0)) + 1, np.int64)
    np.add.at(left, runs[chosen], moves[chosen])
    return left


def _shifted(ideal: IdealSteps, counted: CountedSteps, matching: Matching) -> IdealSteps:
    """Return the crossings delayed by the usual lateness of the steps in their direction, as a fraction of a step.

    It is a circular mean within a step, since 0.6 late equals 0.4 early.
    """
    time_s = ideal.time_s.copy()
    speeds_hz = np.maximum(ideal.speeds_hz, SLOW_CROSSING * ideal.speeds_hz.max(initial=0.0))
    late_s = counted.time_s[matching.counted] - ideal.time_s[matching.ideal]
    angles = 2.0 * np.pi * late_s * speeds_hz[matching.ideal]
    for sign in (-1, 1):
        own = ideal.signs == sign
        paired = own[matching.ideal]
        if paired.any():
            late_steps = np.angle(np.exp(1j * angles[paired]).mean()) / (2.0 * np.pi)
            time_s[own] += late_steps / speeds_hz[own]
    return replace(ideal, time_s=np.maximum.accumulate(time_s))


def _off_steps(ideal: IdealSteps, counted: CountedSteps, matching: Matching, position_at: PositionAt) -> FloatArray:
    """Return the distance of the planned position from the threshold when each pair's step was made."""
    signs = ideal.signs.astype(np.int64)
    before = ideal.start_steps + np.cumsum(signs) - signs
    thresholds = before + signs * THRESHOLD_STEPS
    off: FloatArray = position_at(counted.time_s[matching.counted]) - thresholds[matching.ideal]
    return off


def _by_one_rule(off_steps: FloatArray, signs: NDArray[np.int8]) -> bool:
    """Return whether one rule explains the distances of all steps of a direction."""
    return all(float(np.ptp(off_steps[signs == sign])) <= _ONE_RULE for sign in np.unique(signs))


def _runs(ideal: IdealSteps, time_s: FloatArray) -> NDArray[np.int64]:
    """Return the number of each instant's run."""
    turns = np.flatnonzero(np.diff(ideal.signs)) + 1
    turned_s = np.searchsorted(ideal.turning_s, ideal.time_s[turns - 1])
    ends_s = ideal.turning_s[np.minimum(turned_s, ideal.turning_s.size - 1)]
    return np.searchsorted(ends_s, time_s)


def _near_an_end(time_s: FloatArray, ideal: IdealSteps, position_at: PositionAt, off_steps: float) -> NDArray[np.bool_]:
    """Return whether each instant is near an end of its run: within the distance that the rule explains.

    After a turn the first crossing is further away, by the hysteresis.
    """
    ends_s = np.concatenate(([0.0], ideal.turning_s))
    after = np.clip(np.searchsorted(ends_s, time_s), 1, ends_s.size - 1)
    here, before, behind = position_at(np.concatenate([time_s, ends_s[after - 1], ends_s[after]])).reshape(3, -1)
    near: NDArray[np.bool_] = np.abs(here - behind) <= off_steps
    near |= np.abs(here - before) <= off_steps + 2 * HYSTERESIS_STEPS
    return near


def any_rule_end(planned_steps: float, off_steps: float, tolerance_steps: float) -> tuple[int, int]:
    """Return the lowest and the highest final count of a motion to a position by any rule."""
    within = min(THRESHOLD_STEPS + off_steps + THRESHOLD_TOLERANCE_STEPS, tolerance_steps)
    return int(np.ceil(planned_steps - within)), int(np.floor(planned_steps + within))
