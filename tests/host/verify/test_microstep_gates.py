"""Fine microsteps: a unit of the wire is 1/64 step at 1/256, so a step's threshold is known less well."""

import re
from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.planning.motions.joint_move import fastest_law, joint_move
from steptwin.host.planning.planner import plan
from steptwin.host.robots import brought_text, read_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.kernels import fastest_kernel
from steptwin.host.verify import verify
from steptwin.host.verify.gates import OWN_FIRMWARE, any_step_rule, threshold_tolerance_steps


@pytest.mark.parametrize("microsteps", [None, 1, 2, 4, 8, 16])
def test_up_to_a_sixteenth_the_gates_are_what_they_were(microsteps: int | None) -> None:
    assert threshold_tolerance_steps(microsteps) == 0.0075
    assert OWN_FIRMWARE.position_limit_steps(microsteps) == pytest.approx(0.57)


@pytest.mark.parametrize(("microsteps", "tolerance"), [(32, 0.015), (64, 0.03), (128, 0.06), (256, 0.12)])
def test_beyond_they_are_the_same_part_of_a_full_step(microsteps: int, tolerance: float) -> None:
    """That is 7.68 units of the wire, of which a position may miss half a unit by rounding alone."""
    assert threshold_tolerance_steps(microsteps) == pytest.approx(tolerance)
    assert threshold_tolerance_steps(microsteps) * 16_384 / microsteps == pytest.approx(7.68)
    assert OWN_FIRMWARE.position_limit_steps(microsteps) == pytest.approx(0.5625 + tolerance)
    assert any_step_rule(1.5).position_limit_steps(microsteps) == 1.5


def turntable(microsteps: int, acceleration: float) -> Robot:
    text = brought_text("turntable")
    for key, value in {
        "driver_profile": '"tmc5160"',
        "microsteps": microsteps,
        "speed_max": 6.0,
        "acceleration_max": acceleration,
        "search_speed": 1.0,
    }.items():
        text, found = re.subn(rf"^{key} = [^#\n]*", f"{key} = {value} ", text, count=1, flags=re.MULTILINE)
        assert found
    return read_robot(text)


def turned(microsteps: int, acceleration: float) -> Outcome:
    robot = turntable(microsteps, acceleration)
    move = joint_move(robot.joint_names, (0.0,), (0.5,), fastest_law(robot, np.array([0.5])))
    return execute(plan(robot, move), "turn", fastest_kernel())


@pytest.mark.parametrize("microsteps", [32, 64, 128, 256])
def test_right_runs_pass(microsteps: int) -> None:
    """Gentle, the rounding of the wire is most of the error; steep, the cubics and chords are."""
    for acceleration in (40.0, 400.0):
        outcome = turned(microsteps, acceleration)
        assert outcome.report.reasons == ()


def test_a_step_out_of_place_still_fails() -> None:
    """At 1/256 a step that comes a quarter of a step late is not within the tolerance."""
    outcome = turned(256, 40.0)
    comparison = outcome.comparison
    (axis,) = comparison.evidence.axes
    middle = axis.step_counts.size // 2
    late = axis.step_counts.copy()
    late[middle] += (late[middle + 1] - late[middle]) // 4
    moved = replace(comparison.evidence, axes=(replace(axis, step_counts=late),))
    reasons = verify(comparison.expected, moved, outcome.report.run).reasons
    assert any("threshold error 0.2" in reason for reason in reasons)
