"""The clock is found, with errors that hold, in captures of controllers that step by rules of their own."""

import numpy as np
import pytest

from steptwin.host.verify.clock_fit import ClockFit, fit_clock
from steptwin.host.verify.clock_line import CapturedSteps
from steptwin.host.verify.oracle import ideal_steps
from tests.features.captures.controllers import RULES, Clock, Moves, made_steps

CAPTURES = 104


def fitted(seed: int, rule: str, moves: int | None = None) -> tuple[ClockFit, Clock]:
    """Return the clock found in a made capture, and the true one."""
    random = np.random.default_rng(seed)
    axes = int(random.integers(1, 5)) if moves is None else 2
    per_unit = random.choice([16.0, 40.0, 80.0], axes)
    start = np.where(random.random(axes) < 0.5, 0.0, random.uniform(-50.0, 50.0, axes))
    count = int(random.integers(2, 14)) if moves is None else moves
    law = Moves.random(random, "abcd"[:axes], count, start, random.choice([30.0, 80.0]), random.choice([200.0, 1e3]))
    clock = Clock(
        offset_s=float(random.uniform(0.0, 3.0)),
        ppm=float(random.choice([0.0, 50.0, -158.0])),
        rate_hz=float(random.choice([1e6, 8e6, 24e6])),
        jitter_s=float(random.choice([0.0, 1e-6, 5e-6])),
    )
    ideal = ideal_steps(law.motion, per_unit, tuple(round(place) for place in (start * per_unit).tolist()))
    seen = [clock.sees(steps, random) for steps in made_steps(law, per_unit, rule, random)]
    return fit_clock(ideal, [CapturedSteps(*steps) for steps in seen]), clock


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_the_clock_is_found_whatever_the_rule(rule: str) -> None:
    """Rules that step late one way and early the other once looked like clocks that differ by up to 1000 ppm."""
    clock, true = fitted(5, rule, moves=3)
    assert clock.found
    assert abs(clock.ppm - true.ppm) <= 1e6 * clock.ratio_uncertainty
    assert abs(clock.offset_s - true.offset_s) <= clock.offset_uncertainty_s
    assert abs(clock.ppm - true.ppm) < (60.0 if rule == "segments" else 2.0)


@pytest.mark.slow
def test_the_errors_hold_in_95_of_100_captures() -> None:
    """Of the offset and of the ratio, over all rules together."""
    within = np.zeros(2)
    for seed in range(CAPTURES):
        clock, true = fitted(1000 + seed, RULES[seed % len(RULES)])
        within += (
            abs(clock.ppm - true.ppm) <= 1e6 * clock.ratio_uncertainty,
            abs(clock.offset_s - true.offset_s) <= clock.offset_uncertainty_s,
        )
    assert (within / CAPTURES >= 0.95).all()
