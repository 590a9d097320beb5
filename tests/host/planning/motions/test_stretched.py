"""Stretched motions: the same path in another time, and the smallest stretch that passes, on both of its sides."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.motions.stretched import STRETCH_MAX, smallest_stretch, stretched
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
FAST = make_job(ROBOT, "carry", {"duration_s": "0.5"})


def move(law: Law) -> Motion:
    return joint_move(ROBOT.joint_names, (0.0, 10.0, 0.0, 0.0), (60.0, 40.0, 20.0, -30.0), law)


@given(st.integers(300, 3000), st.floats(0.2, 7.0))
def test_the_path_stays_and_the_speed_falls(duration_ms: int, factor: float) -> None:
    law = SCurve(1.0, duration_ms / 1000, 0.14, 0.05)
    itself, slower = move(law), stretched(move(law), factor)
    assert slower.duration_s == round(slower.duration_s, 3)
    assert -1e-8 <= slower.duration_s - factor * itself.duration_s < 0.001 + 1e-8
    t_s = np.linspace(0.0, slower.duration_s, 50)
    real = slower.duration_s / itself.duration_s
    own_s = np.minimum(t_s / real, itself.duration_s)
    assert np.allclose(slower.positions(t_s), itself.positions(own_s), atol=1e-9)
    assert np.allclose(slower.velocities(t_s) * real, itself.velocities(own_s), rtol=1e-6, atol=1e-4)


def test_breakpoints_are_whole_milliseconds_around_the_true_ones() -> None:
    slower = stretched(move(Trapezoid(1.0, 1.0, 0.25)), 1.11)
    assert slower.breakpoints_s == (0.277, 0.278, 0.832, 0.833)
    assert stretched(move(Trapezoid(1.0, 1.0, 0.25)), 2.0).breakpoints_s == (0.5, 1.5)


def test_switchings_keep_step_with_the_motion() -> None:
    motion = make_job(ROBOT, "carry", {"depth_mm": "20"})
    slower = stretched(motion, 3.0)
    assert [(change.output, change.on) for change in slower.output_changes] == [
        ("gripper", True),
        ("gripper", False),
    ]
    for old, new in zip(motion.output_changes, slower.output_changes, strict=True):
        assert (new.from_s, new.until_s) == pytest.approx((3 * old.from_s, 3 * old.until_s))


@pytest.mark.parametrize("factor", [1 / STRETCH_MAX, STRETCH_MAX])
def test_factors_up_to_a_thousand_are_accepted(factor: float) -> None:
    assert stretched(FAST, factor).duration_s == pytest.approx(max(0.001, 0.5 * factor))


@pytest.mark.parametrize("factor", [0.9 / STRETCH_MAX, 1.1 * STRETCH_MAX, 0.0, -1.0, float("nan")])
def test_other_factors_are_refused(factor: float) -> None:
    complaint_of(lambda: stretched(FAST, factor))


@pytest.mark.parametrize(
    "law", [Cubic(1.0, 0.2), Quintic(1.0, 0.2), Trapezoid(1.0, 0.2, 0.05), SCurve(1.0, 0.2, 0.1, 0.05)]
)
def test_a_refusal_says_the_stretch_that_passes_and_no_smaller_one_does(law: Law) -> None:
    message = complaint_of(lambda: plan(ROBOT, move(law)))
    factor = float(message.rsplit("stretch=", 1)[1].rstrip(")"))
    assert f"{factor:g} times slower passes" in message
    plan_stretched(ROBOT, move(law), factor)
    with refusing(InputError):
        plan_stretched(ROBOT, move(law), factor - 0.006)  # a duration that is 1 ms shorter
    assert plan_stretched(ROBOT, move(law)).motion.duration_s == stretched(move(law), factor).duration_s


def test_a_motion_that_passes_is_not_stretched_without_need() -> None:
    motion = make_job(ROBOT, "carry")
    assert plan_stretched(ROBOT, motion).motion is motion


@given(st.integers(1001, 50_000), st.floats(1.0, 60.0))
@settings(max_examples=200)
def test_the_search_finds_the_smallest_thousandth_from_any_beginning(least_thousandths: int, begin: float) -> None:
    whole = move(Cubic(1.0, 1.0))

    def passes(slower: Motion) -> bool:
        return round(1000 * slower.duration_s) >= least_thousandths

    if 1000 * begin <= least_thousandths:
        assert smallest_stretch(whole, passes, begin) == least_thousandths / 1000


def test_a_motion_that_no_stretch_helps_is_refused() -> None:
    assert smallest_stretch(move(Cubic(1.0, 1.0)), lambda _: False, 1.0) is None
    assert smallest_stretch(move(Cubic(1.0, 1.0)), lambda _: False, 1e30) is None


@pytest.mark.parametrize("factor", [1.437, 1.9, 3.3333])
def test_a_stretched_motion_is_as_exact_as_any_other(factor: float) -> None:
    sharp = move(Trapezoid(1.0, 1.0, 0.25))  # its acceleration jumps, and now within a millisecond
    outcome = execute(plan_stretched(ROBOT, sharp, factor), "stretched")
    assert outcome.passed
    axes = outcome.to_dict()["axes"]
    assert max(axis["position_error_steps_max"] for axis in axes) < 0.57
    assert max(axis["timing_error_us_p99"] for axis in axes) < 3.0 * factor  # slower steps, larger times
