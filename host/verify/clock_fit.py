"""Fit a plan's time to a capture: the instant of its t = 0, and the ratio between the clocks of plan and analyser.

1. The densities of signed steps of plan and capture are correlated at all offsets; the best one is near the motion. The
   sign of each axis' contribution shows whether its DIR is inverted.
2. From there steps are paired: the k-th with the k-th if both make the same steps, else mutual nearest ones. The search
   starts at the offset with the most close pairs, within some steps of the coarse one.
3. A weighted least-squares line through the pairs' instants gives offset and ratio; steps at a high speed have a higher
   weight. Pairs far off the line are removed, and the fit is repeated over a growing part of the motion.

A controller with another step rule makes all steps early or late by a fraction of a step, which looks like an offset in
time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify import Evidence, Expectation
from steptwin.host.verify.clock_line import (
    AxisPairs,
    CapturedSteps,
    ClockLine,
    fitted,
    paired_until,
    residual_steps,
    with_late,
)
from steptwin.host.verify.clock_search import alignments, apart_steps, coarse_offset
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

_AS_MUCH: Final = 0.2
"""Largest difference in correlation of an axis that still moves as planned."""
_NEAR_STEPS: Final = 0.3
_AS_NEAR: Final = 0.97
"""Least fraction of the best line's close pairs with which another line is equivalent."""
_ALL_NEAR: Final = 0.999
_SAME_SPREAD_STEPS: Final = 1e-3
_PAIRINGS_OF_PART: Final = 3
_PAIRINGS: Final = 20
"""Highest number of iterations of pairing and fitting, for a part of the motion and for all of it."""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: time of the capture at the plan's t = 0.
        ratio: seconds of the capture per second of the plan.
        offset_uncertainty_s: standard error of the offset.
        ratio_uncertainty: standard error of the ratio.
        pairs: number of pairs of steps in the fit.
        inverted: indices of the axes that turn in the opposite direction.
        swapped: pairs of indices of axes that are exchanged.
        found: False if no offset matches the plan; then both first steps are aligned.
    """

    offset_s: float
    ratio: float
    offset_uncertainty_s: float
    ratio_uncertainty: float
    pairs: int
    inverted: tuple[int, ...] = ()
    swapped: tuple[tuple[int, int], ...] = ()
    found: bool = True

    @property
    def ppm(self) -> float:
        """Deviation of the analyser's clock from the plan, in ppm; positive if it counts more time."""
        return (self.ratio - 1.0) * 1e6

    def plan_s(self, times_s: FloatArray) -> FloatArray:
        """Convert instants of the capture to the plan's time."""
        planned_s: FloatArray = (times_s - self.offset_s) / self.ratio
        return planned_s


def fit_clock(ideal: Sequence[IdealSteps], seen: Sequence[CapturedSteps]) -> ClockFit:
    """Fit a plan's ideal steps to the captured ones, axis by axis; raise InputError if these are too scattered."""
    coarse_s, likeness = coarse_offset(ideal, seen)
    first = [steps.time_s[0] for steps in seen if steps.time_s.size]
    if coarse_s is None or not first:
        planned = min((steps.time_s[0] for steps in ideal if steps.time_s.size), default=0.0)
        return ClockFit(float(min(first, default=0.0) - planned), 1.0, np.inf, np.inf, 0, found=False)
    moving = [i for i, steps in enumerate(ideal) if steps.time_s.size and seen[i].time_s.size]
    swapped = _swapped(likeness, moving)
    of_plan = {i: i for i in moving} | {i: j for pair in swapped for i, j in (pair, pair[::-1])}
    inverted = tuple(i for i in moving if likeness[i, of_plan[i]] < 0.0)
    turned = [
        CapturedSteps(steps.time_s, -steps.signs if i in inverted else steps.signs) for i, steps in enumerate(seen)
    ]
    pairs = [(ideal[of_plan[i]], turned[i]) for i in moving]
    found: list[_Found] = []
    for line, until_s in alignments(pairs, coarse_s):
        found.append(_fitted(pairs, line, until_s))
        if found[-1].near >= _ALL_NEAR * found[-1].pairs:
            break  # the others cannot be better
    line, errors, count = _best(found)
    return ClockFit(line.offset_s, line.ratio, *errors, count, inverted, swapped)


def begun_by_steps(expected: Expectation, evidence: Evidence) -> Evidence:
    """Return evidence whose t = 0 is determined by its steps, for a controller that does not report its start.

    The clock's ratio does not change. If the plan is not found, both first steps are aligned.
    """
    zeros = tuple(round(float(expected.axis_position(axis, np.zeros(1))[0])) for axis in range(len(evidence.axes)))
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, zeros)
    clock = fit_clock(
        ideal, [CapturedSteps(axis.step_counts / COUNTS_PER_SECOND, axis.step_signs) for axis in evidence.axes]
    )
    return replace(evidence, start_counts=max(round(clock.offset_s * COUNTS_PER_SECOND), 0))


def _swapped(likeness: FloatArray, moving: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of exchanged axes: each moves as planned for the other one."""
    alike = np.abs(np.abs(likeness) - 1.0) < _AS_MUCH
    astray = [i for i in moving if not alike[i, i]]
    return tuple((i, j) for i in astray for j in astray if i < j and alike[i, j] and alike[j, i])


def _best(found: "Sequence[_Found]") -> tuple[ClockLine, tuple[float, float], int]:
    """Return the best line, its errors and the number of its pairs.

    After lost steps the counts differ permanently, but pairs stay close. With an inexact controller few pairs are close
    to any line.
    """
    most = max(each.near for each in found)
    near = [each for each in found if each.near >= _AS_NEAR * most]
    least = min(each.spread_steps for each in near) + _SAME_SPREAD_STEPS
    best = min((each for each in near if each.spread_steps < 2.0 * least), key=attrgetter("apart_steps"))
    return best.line, best.errors, best.pairs


class _Found(NamedTuple):
    """A line and its quality.

    Attributes:
        line: the line.
        errors: errors of its offset and ratio.
        pairs: number of pairs.
        near: number of pairs close to the line.
        spread_steps: typical distance of a pair from the line.
        apart_steps: sum of the differences in counts, over some steps.
    """

    line: ClockLine
    errors: tuple[float, float]
    pairs: int
    near: int
    spread_steps: float
    apart_steps: float


def _fitted(pairs: AxisPairs, line: ClockLine, until_s: float) -> _Found:
    """Extend a line that fits the beginning of the motion to the whole motion."""
    end_s = max(float(plan.time_s[-1]) for plan, _ in pairs)
    line = with_late(pairs, line, until_s)
    while True:
        for _ in range(_PAIRINGS if until_s >= end_s else _PAIRINGS_OF_PART):
            before = line
            paired = paired_until(pairs, line, until_s)
            line, errors = fitted(paired, line)
            if line.agrees(before, until_s):
                break
        if until_s >= end_s:
            off_steps = np.abs(residual_steps(paired, line))
            near, spread = int(np.count_nonzero(off_steps < _NEAR_STEPS)), float(np.median(off_steps))
            return _Found(line, errors(), off_steps.size, near, spread, apart_steps(pairs, line))
        until_s *= 2.0
