"""Margins of a run before it loses steps: lowest current, largest payload and fastest motion that keep step.

Bisection finds each border. A trial turns the rotors by the run's record with one quantity changed, and ends with the
first slip. The boards are not emulated again. Bisection assumes that slips continue beyond a value that slips. Close to
a resonance that may be wrong, so each border is given with both of its sides.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import ceil, log
from typing import Any, Final

import numpy as np

from steptwin.features.motors.turning.after_run import MotionSlip, first_slip
from steptwin.features.motors.turning.driving import Driving, Progress
from steptwin.host.verify import Comparison

RESOLUTION: Final = 0.02
"""Ratio of the two sides of a border, minus 1."""
_CURRENT_LEAST: Final = 1.0 / 32.0
"""Lowest current tried, as a fraction of the run's."""
_PAYLOAD_LEAST_KG: Final = 0.05
_PAYLOAD_MOST_KG: Final = 100.0
_STRETCH_LEAST: Final = 1.0 / 16.0
_STRETCH_MOST: Final = 8.0

Trial = Callable[[Driving], MotionSlip | None]


@dataclass(frozen=True, slots=True)
class Border:
    """The border between keeping step and slipping.

    Attributes:
        quantity: the changed quantity: `current_a`, `payload_kg` or `stretch`.
        run: its value in the run; 1 for the stretch.
        keeps: the last value that keeps step; None if no value in the range does.
        slips: the first value that slips; None if all values up to `limit` keep step.
        joint: the joint that slips first; empty if none does.
        slips_at_s: time of that slip from the start of the motion, in the motion's own time.
        limit: end of the searched range.
    """

    quantity: str
    run: float
    keeps: float | None
    slips: float | None
    joint: str
    slips_at_s: float | None
    limit: float


@dataclass(frozen=True, slots=True)
class Search:
    """Search of one border.

    Attributes:
        quantity: name of the quantity.
        run: its value in the run.
        safe: the safest value of the range.
        risky: the riskiest value of the range.
        change: returns a run's driving with another value.
    """

    quantity: str
    run: float
    safe: float
    risky: float
    change: Callable[[float], Driving]

    @property
    def trials_max(self) -> int:
        """Largest number of trials, with the one at the end of the range."""
        return 1 + max(_halvings(self.run, end) for end in (self.safe, self.risky))

    def border(self, slip_of_run: MotionSlip | None, trial: Trial) -> Border:
        """Return the border; `slip_of_run` is the first slip of the run itself."""
        end = self.safe if slip_of_run else self.risky
        slip_at_end = trial(self.change(end)) if end != self.run else slip_of_run
        if bool(slip_at_end) == bool(slip_of_run):
            keeps, slips = (None, end) if slip_of_run else (end, None)
            return self._border(keeps, slips, slip_at_end)
        keeps, slips = (end, self.run) if slip_of_run else (self.run, end)
        slip = slip_of_run or slip_at_end
        for _ in range(_halvings(keeps, slips)):
            between = _between(keeps, slips)
            found = trial(self.change(between))
            keeps, slips, slip = (keeps, between, found) if found else (between, slips, slip)
        return self._border(keeps, slips, slip)

    def _border(self, keeps: float | None, slips: float | None, slip: MotionSlip | None) -> Border:
        joint, at_s = (slip.joint, slip.at_s) if slip else ("", None)
        return Border(self.quantity, self.run, keeps, slips, joint, at_s, self.safe if keeps is None else self.risky)


def _between(one: float, other: float) -> float:
    """Return the geometric mean; 0 counts as a small payload."""
    return float(np.sqrt(max(one, _PAYLOAD_LEAST_KG / 16.0) * max(other, _PAYLOAD_LEAST_KG / 16.0)))


def _halvings(one: float, other: float) -> int:
    """Return the number of bisections, in ratios, until the ends of a range are RESOLUTION apart."""
    low, high = sorted(max(value, _PAYLOAD_LEAST_KG / 16.0) for value in (one, other))
    ratio = log(high / low) / log(1.0 + RESOLUTION)
    return ceil(log(ratio, 2)) if ratio > 1.0 else 0


@dataclass(frozen=True, slots=True)
class MotorMargins:
    """The borders of a run, by quantity."""

    borders: tuple[Border, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {border.quantity: asdict(border) for border in self.borders}


def searches_of(driving: Driving, comparison: Comparison) -> tuple[Search, ...]:
    """Return the searches of a run; quantities that cannot change there are left out."""
    return tuple(search for search in _searches(driving, comparison) if search.safe != search.risky)


def _searches(driving: Driving, comparison: Comparison) -> Sequence[Search]:
    current_a, payload_kg = driving.phase_current_a, driving.dynamics.payload_kg
    searches = []
    if current_a > 0.0:
        low_a = _CURRENT_LEAST * current_a
        searches.append(Search("current_a", current_a, driving.chip.current_max_a.value, low_a, driving.at_current))
    if driving.carries:
        most_kg = max(_PAYLOAD_MOST_KG, payload_kg)
        searches.append(Search("payload_kg", payload_kg, 0.0, most_kg, driving.with_payload))
    fastest = stretch_of_drivers(comparison)
    if fastest is not None:
        searches.append(Search("stretch", 1.0, _STRETCH_MOST, min(fastest, 1.0), driving.stretched))
    return searches


def stretch_of_drivers(comparison: Comparison) -> float | None:
    """Return the shortest stretch with which no driver exceeds its step rate; None if nothing moves."""
    expected = comparison.expected
    robot, motion = expected.robot, expected.motion
    if robot is None:
        return None
    t_s = np.linspace(0.0, motion.duration_s, 2 + int(1000.0 * motion.duration_s))
    peak_hz = float(np.abs(expected.axis_steps(motion.velocities(t_s))).max())
    if peak_hz == 0.0:
        return None
    return max(peak_hz / robot.board.driver_rate_max_hz, _STRETCH_LEAST)


def margins_of_run(
    searches: Sequence[Search], slip_of_run: MotionSlip | None, progress: Progress = lambda _: None
) -> MotorMargins:
    """Search the borders of a run.

    Args:
        searches: the searches, from `searches_of`.
        slip_of_run: the first slip of the run as it is.
        progress: called with the fraction done; it jumps when trials end early.
    """
    trials = _Trials(sum(search.trials_max for search in searches), progress)
    borders = []
    for search in searches:
        begun = trials.made
        borders.append(search.border(slip_of_run, trials))
        trials.made = begun + search.trials_max
        progress(trials.made / trials.total)
    return MotorMargins(tuple(borders))


@dataclass(slots=True)
class _Trials:
    """Trials of a search, with their progress."""

    total: int
    progress: Progress
    made: int = 0

    def __call__(self, changed: Driving) -> MotionSlip | None:
        slip = first_slip(changed, lambda part: self.progress((self.made + part) / self.total))
        self.made += 1
        return slip
