"""Each method makes the right number of steps, with the timing that characterises it."""

import numpy as np
import pytest

from steptwin.bench.kernel_speed import run_length
from steptwin.bench.step_methods import Method
from steptwin.bench.step_methods.evaluation import ideal_of, step_errors
from steptwin.bench.step_methods.motions import PlannedMotion, Sines, motion_of_job, sines
from steptwin.bench.step_methods.table import DDA_HZ, methods
from steptwin.bench.step_methods.usual_methods import AustinRamp, place_ramp
from steptwin.controller.motion.backend import Kernel
from steptwin.host.robots import load_robot
from tests.bench.step_methods.lines import BOARD

KEYS = ["kernel", *(f"dda-{hz // 1000}k" for hz in DDA_HZ), "bresenham", "austin"]


def method(kernel: Kernel, key: str) -> Method:
    (found,) = [method for method in methods(kernel) if method.key == key]
    return found


@pytest.fixture(scope="module", params=["sines", "carry"])
def motion(request: pytest.FixtureRequest) -> PlannedMotion:
    """Three axes of several sine cycles, and a job whose arms turn in both directions."""
    if request.param == "sines":
        return sines("sines", Sines((1, 2, 3), 3000.0, 0.4), BOARD)
    return motion_of_job(load_robot("teaching-scara"), "carry")


def test_the_methods_and_their_order(fast_kernel: Kernel) -> None:
    assert [method.key for method in methods(fast_kernel)] == KEYS


@pytest.mark.parametrize("key", [pytest.param(key, marks=pytest.mark.slow if key != "kernel" else ()) for key in KEYS])
def test_every_method_ends_at_the_ideal_count(key: str, motion: PlannedMotion, fast_kernel: Kernel) -> None:
    placed = method(fast_kernel, key).place(motion)
    ideal = ideal_of(motion)
    ends = [start + int(axis.signs.sum(dtype=int)) for start, axis in zip(motion.start_steps, placed.axes, strict=True)]
    assert ends == [axis.end_steps for axis in ideal]
    assert sum(len(axis.rise_counts) for axis in placed.axes) > 1000
    for axis in placed.axes:
        assert (np.diff(axis.rise_counts) > 0).all()
        assert (axis.fall_counts > axis.rise_counts).all()
        assert (np.diff(axis.dir_counts) > 0).all()
        assert (axis.dir_levels == np.resize([1, 0], len(axis.dir_levels))).all()


@pytest.mark.slow
@pytest.mark.parametrize("base_hz", DDA_HZ)
def test_a_dda_steps_on_its_grid_and_at_most_a_period_late(base_hz: int, fast_kernel: Kernel) -> None:
    """Slow steps are left out: there records and servo thread round more, and at a reversal DIR needs more periods."""
    motion = sines("sine", Sines((1,), 3000.0, 1.0), BOARD)
    (pulses,) = method(fast_kernel, f"dda-{base_hz // 1000}k").place(motion).axes
    assert (pulses.rise_counts % (72_000_000 // base_hz) == 0).all()
    errors = step_errors(motion, 0, ideal_of(motion)[0], pulses)
    upward, downward = np.array_split(errors.timing_us, 2)
    for late_us in (upward[50:-50], downward[50:-50]):
        assert late_us.min() > -2
        assert late_us.max() < 1e6 / base_hz + 2
        assert late_us.mean() == pytest.approx(5e5 / base_hz, rel=0.1)


@pytest.mark.slow
def test_bresenham_makes_a_record_at_constant_rate(fast_kernel: Kernel) -> None:
    """The dominant axis steps evenly, the other one in the same interrupts."""
    motion = sines("two", Sines((1, 2), 3000.0, 2.0), BOARD)
    first, second = method(fast_kernel, "bresenham").place(motion).axes
    within = [axis.rise_counts[axis.rise_counts // 720_000 == 40] for axis in (first, second)]
    dominant, other = sorted(within, key=len, reverse=True)
    assert len(other) < len(dominant)
    assert np.ptp(np.diff(dominant)) <= 1
    assert set(other) <= set(dominant)


def test_austins_intervals_are_those_of_constant_acceleration() -> None:
    """Step n of a ramp from rest with 1000 steps/s^2 is at sqrt(2 n / a); the recurrence is 1.4 % off at n = 2."""
    steps = 200
    rises = np.zeros(steps, np.int64)
    place_ramp(AustinRamp(0, 10**9, 1.0, 0.0, 1000.0), rises, 0, 4800)
    exact = 72e6 * np.sqrt(2 * np.arange(1, steps + 1) / 1000)
    assert rises[0] == int(exact[0])
    assert rises[1] == pytest.approx(exact[1], abs=2)
    off = np.diff(rises) / np.diff(exact) - 1
    assert off[1] == pytest.approx((7 / 9) / ((3**0.5 - 2**0.5) / (2**0.5 - 1)) - 1, abs=1e-5)
    assert np.abs(off).max() < 0.022


def test_austins_deceleration_ends_where_the_speed_does() -> None:
    """From 400 steps/s with -1000 steps/s^2: 80 steps in 0.4 s; c (1 + 2/3) is the last interval, n = -1."""
    rises = np.zeros(80, np.int64)
    place_ramp(AustinRamp(0, 28_800_000, 1.0, 400.0, -1000.0), rises, 0, 4800)
    exact = 72e6 * (0.4 - np.sqrt(2 * np.arange(79, -1, -1) / 1000))
    assert rises[:-1] == pytest.approx(exact[:-1], abs=72_000 * 3)
    assert 3 * (rises[-1] - rises[-2]) == pytest.approx(5 * (rises[-2] - rises[-3]), abs=6)
    assert rises[-1] < 28_800_000


def test_a_long_motion_makes_as_many_steps_as_asked_for(fast_kernel: Kernel) -> None:
    length = run_length(fast_kernel, 20_000)
    assert length.steps >= 20_000
    assert length.simulated_s % 2 == 0
    assert length.peak_mb > 10
