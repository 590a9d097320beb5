"""The step rules of controllers: how far the counts of their steps may be from the path, on it and at standstill."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.bad_input import shortened
from steptwin.host.common.errors import InputError

_EXACT_STEPS: Final = 2e-3
"""Rounding error of a position in steps."""


class Rest(StrEnum):
    """The count at standstill."""

    NEAREST = "the nearest one"
    FLOOR = "the one below"
    CEIL = "the one above"
    WHOLE = "the one below or above"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRule:
    """A step rule.

    Attributes:
        name: name of the rule.
        half_steps: largest distance of a count from the path, from its middle.
        rest: the count at standstill.
        rest_steps: largest distance of the nearest count at standstill.
        turn_steps: largest distance of the count where an axis turns around, from that at standstill.
        early_s: how much too early a step may come; adds to `half_steps` in proportion to the step rate.
        chord_mm: distance of the chords from the arcs for which it goes them; adds to `half_steps` on curved paths.
        long_chords: True if its chords of arcs may be a step or more away from them.
        both_edges: False if the controller never steps at both edges of STEP.
        says: what makes a step, and its jitter.
        source: where that is written.
    """

    name: str
    half_steps: float
    rest: Rest = Rest.NEAREST
    rest_steps: float = 0.51
    turn_steps: float = 1.07
    early_s: float = 0.0
    chord_mm: float = 0.0
    long_chords: bool = False
    both_edges: bool = True
    says: str
    source: str

    @property
    def middle_steps(self) -> float:
        """Middle of count minus position."""
        return {Rest.FLOOR: -0.5, Rest.CEIL: 0.5}.get(self.rest, 0.0)

    def half_at(self, rate_hz: float, chord_steps_per_mm: float) -> float:
        """Return the largest distance from the path's middle.

        Args:
            rate_hz: highest step rate; a step is early by half a step at most.
            chord_steps_per_mm: steps of a mm of a curved path, 0 for straight lines.
        """
        return self.half_steps + min(self.early_s * rate_hz, 0.5) + self.chord_mm * chord_steps_per_mm

    def start(self, positions: FloatArray) -> FloatArray:
        """Return the counts at the standstill where a path begins."""
        if self.rest is Rest.FLOOR:
            return np.floor(positions + _EXACT_STEPS)
        if self.rest is Rest.CEIL:
            return np.ceil(positions - _EXACT_STEPS)
        return np.rint(positions)

    def rests(self, counts: FloatArray, positions: FloatArray) -> BoolArray:
        """Return which counts are right at standstill. Floor is exact: else a lost step would pass for the rule."""
        below, above = np.floor(positions + _EXACT_STEPS), np.ceil(positions - _EXACT_STEPS)
        if self.rest is Rest.FLOOR:
            return np.asarray(counts == below)
        if self.rest is Rest.CEIL:
            return np.asarray(counts == above)
        if self.rest is Rest.WHOLE:
            return np.asarray((counts == below) | (counts == above))
        return np.asarray(np.abs(counts - positions) <= self.rest_steps)

    def turns(self, counts: FloatArray, positions: FloatArray) -> BoolArray:
        """Return which counts are right where an axis turns around; speed and jitter do not change them."""
        if self.rest is Rest.NEAREST:
            return np.asarray(np.abs(counts - positions) <= self.turn_steps)
        near = [self.rests(counts, positions + off) for off in (-0.05, 0.0, 0.05)]
        return np.asarray(np.logical_or.reduce(near))


CONTROLLERS: Final = {
    rule.name: rule
    for rule in (
        StepRule(
            name="klipper",
            half_steps=0.56,
            turn_steps=0.80,
            early_s=25e-6,
            long_chords=True,
            says="nearest step; its compression sends a step up to 25 us early, never late",
            source="Klipper 84104bbb: klippy/chelper/itersolve.c, stepcompress.c; klippy/stepper.py",
        ),
        StepRule(
            name="grbl",
            both_edges=False,
            half_steps=1.20,
            chord_mm=0.002,
            says="Bresenham between rounded targets, in segments of 10 ms of one rate; arcs are chords of $12",
            source="grbl bfb67f0c: grbl/stepper.c, planner.c, config.h",
        ),
        StepRule(
            name="grblhal",
            half_steps=1.20,
            chord_mm=0.002,
            says="Bresenham between rounded targets, in segments of 10 ms of one rate; arcs are chords of $12",
            source="grblHAL core f80fc34d: stepper.c, planner.c",
        ),
        StepRule(
            name="marlin",
            half_steps=1.20,
            long_chords=True,
            says="Bresenham between rounded targets, in bursts of 2 to 16 above the processor's rate",
            source="Marlin 2.1: module/stepper.cpp, planner.cpp, stepper/cycles.h",
        ),
        StepRule(
            name="linuxcnc",
            both_edges=False,
            half_steps=1.06,
            turn_steps=0.70,
            says="nearest step of the generator's position, on the grid of a base period of 25 to 100 us",
            source="LinuxCNC 5c41560e: src/hal/components/stepgen.c",
        ),
        StepRule(
            name="other",
            half_steps=1.20,
            rest=Rest.WHOLE,
            says="any rule by which a count is within a step",
            source="none: the widest of these rules",
        ),
    )
}
"""The rules that `--controller` names. Half-widths are the largest that made captures need, and 0.1 step more."""

_UNKNOWN_SAYS: Final = "estimated from the counts"
ESTIMATES: Final = (
    StepRule(name="nearest step", half_steps=0.56, turn_steps=0.56, says=_UNKNOWN_SAYS, source=""),
    StepRule(
        name="steptwin", half_steps=0.66, rest_steps=0.57, turn_steps=0.66, says="9/16 step beyond the count", source=""
    ),
    CONTROLLERS["klipper"],
    CONTROLLERS["grbl"],
    StepRule(name="step below", half_steps=0.56, rest=Rest.FLOOR, says=_UNKNOWN_SAYS, source=""),
    StepRule(name="step above", half_steps=0.56, rest=Rest.CEIL, says=_UNKNOWN_SAYS, source=""),
    StepRule(name="whole steps", half_steps=1.06, rest=Rest.WHOLE, says=_UNKNOWN_SAYS, source=""),
)
"""The rules that are tried, in this order, where no controller is named; the first that fits is taken."""


def controller(name: str) -> StepRule:
    """Return a controller's rule; raise InputError for a name that there is not."""
    if name not in CONTROLLERS:
        raise InputError(f"--controller {shortened(name)}: there are {', '.join(CONTROLLERS)}")
    return CONTROLLERS[name]
