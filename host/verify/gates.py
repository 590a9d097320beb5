"""Limits of the distance between counted steps and planned motion for a run to pass.

Our own firmware follows the step rule of the oracle, so its runs are judged by that rule within a small tolerance. Any
other controller has a rule of its own: it steps sooner or later within a step, on the grid of a timer. Its runs are
judged by their distance from the plan, and by missing and additional steps.
"""

from dataclasses import dataclass
from typing import Final

from steptwin.host.verify.oracle import THRESHOLD_STEPS

THRESHOLD_TOLERANCE_STEPS: Final = 0.0075
"""Largest distance of a step from its threshold: several times the error of the board's wire units,
cubics and chords.
"""

POSITION_ERROR_LIMIT_STEPS: Final = THRESHOLD_STEPS + THRESHOLD_TOLERANCE_STEPS
"""0.57: a perfect counter is up to H = 0.5625 step away when it steps; the tolerance is the difference."""

_USUAL_MICROSTEPS: Final = 16
"""Largest number of microsteps with that tolerance; it is 7.68 wire units there."""


def threshold_tolerance_steps(microsteps: int | None) -> float:
    """Return the largest distance of a step from its threshold for a driver's microsteps; None: for the usual ones.

    Errors of wire positions, cubics and chords are fractions of a full step. So from 1/16 on the tolerance is a fixed
    fraction of a full step, 7.68 wire units: 0.12 steps at 1/256.
    """
    return THRESHOLD_TOLERANCE_STEPS * max(1.0, (microsteps or 1) / _USUAL_MICROSTEPS)


TOLERANCE_STEPS: Final = 1.5
"""Usual limit for another controller: one that steps at whole steps is up to 1 away, and its count at the start may be
rounded the other way.
"""

SEGMENTS_TOLERANCE_STEPS: Final = 2.0
"""Limit for controllers that move in segments of constant rate, such as grbl."""


@dataclass(frozen=True, slots=True)
class Gates:
    """Limits that a run is judged by.

    Attributes:
        position_error_steps: largest distance of the count from the planned position at any instant, for the usual
            microsteps.
        step_rule: True if steps must come at the oracle's thresholds, within their tolerance. False for any step rule;
            then steps are counted run by run between the motion's turning points.
    """

    position_error_steps: float = POSITION_ERROR_LIMIT_STEPS
    step_rule: bool = True

    def position_limit_steps(self, microsteps: int | None) -> float:
        """Return the largest distance of the count from the planned position for a driver's microsteps."""
        if not self.step_rule:
            return self.position_error_steps
        return self.position_error_steps + threshold_tolerance_steps(microsteps) - THRESHOLD_TOLERANCE_STEPS


OWN_FIRMWARE: Final = Gates()


def any_step_rule(tolerance_steps: float = TOLERANCE_STEPS) -> Gates:
    """Return the gates of a controller with an unknown step rule."""
    return Gates(tolerance_steps, step_rule=False)
