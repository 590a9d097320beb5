"""Find a plan's time in a capture: when its t = 0 was, and how much faster or slower the analyser's clock runs.

1. The density of signed steps, of plan and capture, is correlated at all offsets; the best is near the motion. The sign
   of each axis' part tells whether its DIR is inverted.
2. From there steps are paired: the k-th with the k-th where both make the same steps, else those that are each other's
   nearest. The offset at which most are near is taken first, within some steps of the coarse one.
3. A weighted line of least squares through the pairs' instants gives offset and ratio; a step at a high speed tells the
   time better. Pairs far off the line are left out, and the fit is repeated, over a growing part of the motion.

Steps of another rule are all early or late by a part of a step, which looks like an offset in time.
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
    ClockLine,
    SeenSteps,
    fitted,
    paired_until,
    residual_steps,
    with_late,
)
from steptwin.host.verify.clock_search import alignments, apart_steps, coarse_offset
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

_AS_MUCH: Final = 0.2
"""Difference in likeness up to which an axis moves as a plan says."""
_NEAR_STEPS: Final = 0.3
_AS_NEAR: Final = 0.97
"""Part of the most pairs near a line that another line must have near it to be taken for it."""
_ALL_NEAR: Final = 0.999
_SAME_SPREAD_STEPS: Final = 1e-3
_PAIRINGS_OF_PART: Final = 3
_PAIRINGS: Final = 20
"""Times that a part of the motion, and at last all of it, is paired and fitted until both settle."""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: the capture's time at the plan's t = 0.
        ratio: seconds of the capture in a second of the plan.
        offset_uncertainty_s: standard error of the offset.
        ratio_uncertainty: likewise of the ratio.
        pairs: number of pairs of steps that tell it.
        inverted: the axes that turn the other way, by index.
        swapped: pairs of axes, by index, each of which moves as the other should.
        found: False if no offset shows the plan; the first step then stands for its first.
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
        """How much more time the analyser counts than the plan, in parts per million."""
        return (self.ratio - 1.0) * 1e6

    def plan_s(self, times_s: FloatArray) -> FloatArray:
        """Return instants of the capture in the plan's time."""
        planned_s: FloatArray = (times_s - self.offset_s) / self.ratio
        return planned_s


def fit_clock(ideal: Sequence[IdealSteps], seen: Sequence[SeenSteps]) -> ClockFit:
    """Fit a plan's ideal steps to those seen, axis by axis; raise InputError if they lie too far apart in time."""
    coarse_s, likeness = coarse_offset(ideal, seen)
    first = [steps.time_s[0] for steps in seen if steps.time_s.size]
    if coarse_s is None or not first:
        planned = min((steps.time_s[0] for steps in ideal if steps.time_s.size), default=0.0)
        return ClockFit(float(min(first, default=0.0) - planned), 1.0, np.inf, np.inf, 0, found=False)
    moving = [i for i, steps in enumerate(ideal) if steps.time_s.size and seen[i].time_s.size]
    swapped = _swapped(likeness, moving)
    of_plan = {i: i for i in moving} | {i: j for pair in swapped for i, j in (pair, pair[::-1])}
    inverted = tuple(i for i in moving if likeness[i, of_plan[i]] < 0.0)
    turned = [SeenSteps(steps.time_s, -steps.signs if i in inverted else steps.signs) for i, steps in enumerate(seen)]
    pairs = [(ideal[of_plan[i]], turned[i]) for i in moving]
    found: list[_Found] = []
    for line, until_s in alignments(pairs, coarse_s):
        found.append(_fitted(pairs, line, until_s))
        if found[-1].near >= _ALL_NEAR * found[-1].pairs:
            break  # the others cannot be better
    line, errors, count = _best(found)
    return ClockFit(line.offset_s, line.ratio, *errors, count, inverted, swapped)


def begun_by_steps(expected: Expectation, evidence: Evidence) -> Evidence:
    """Return evidence whose t = 0 is where its steps show the plan, for a controller that tells nobody when it begins.

    Its clock is the evidence's. Where the plan is not found, its first step stands for the plan's first.
    """
    zeros = tuple(round(float(expected.axis_position(axis, np.zeros(1))[0])) for axis in range(len(evidence.axes)))
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, zeros)
    clock = fit_clock(
        ideal, [SeenSteps(axis.step_counts / COUNTS_PER_SECOND, axis.step_signs) for axis in evidence.axes]
    )
    return replace(evidence, start_counts=max(round(clock.offset_s * COUNTS_PER_SECOND), 0))


def _swapped(likeness: FloatArray, moving: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of axes each of which moves as the other should, and not as itself should."""
    alike = np.abs(np.abs(likeness) - 1.0) < _AS_MUCH
    astray = [i for i in moving if not alike[i, i]]
    return tuple((i, j) for i in astray for j in astray if i < j and alike[i, j] and alike[j, i])


def _best(found: "Sequence[_Found]") -> tuple[ClockLine, tuple[float, float], int]:
    """Return the best line, its errors and the number of its pairs.

    Steps lost put counts off for good, but leave the pairs near; a rough controller leaves few of them near any line.
    """
    most = max(each.near for each in found)
    near = [each for each in found if each.near >= _AS_NEAR * most]
    least = min(each.spread_steps for each in near) + _SAME_SPREAD_STEPS
    best = min((each for each in near if each.spread_steps < 2.0 * least), key=attrgetter("apart_steps"))
    return best.line, best.errors, best.pairs


class _Found(NamedTuple):
    """A line, and what speaks for it.

    Attributes:
        line: the line.
        errors: of its offset and ratio.
        pairs: number of pairs.
        near: how many of them are near the line.
        spread_steps: how far off it they usually are.
        apart_steps: how far the counts are off on it, added over some steps.
    """

    line: ClockLine
    errors: tuple[float, float]
    pairs: int
    near: int
    spread_steps: float
    apart_steps: float


def _fitted(pairs: AxisPairs, line: ClockLine, until_s: float) -> _Found:
    """Return the line of the whole motion that grows from one of its beginning."""
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
