"""Whole runs of coupled joints: pulses against the plan, joints from the counts of all axes."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.planning.laws import SCurve
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import Expectation, compare, verify
from tests.host.robots.coupled import DIRECT, STEPS_PER_DEG, TWO_TO_ONE, coupled_robot

GOAL = np.array([35.0, 60.0, 20.0, -45.0])


def carried(robot: Robot) -> Plan:
    """Go to a place, draw the tool 40 mm straight towards the base, turn the shoulder back."""
    motion = Composer(robot, np.array(robot.home))
    motion.go(GOAL)
    motion.line("right", (-40.0, 0.0, 0.0), SCurve.fastest(40.0, 60.0, 200.0, 2000.0))
    motion.go_some({"th1": -20.0})
    return plan(robot, motion.sequence())


@pytest.mark.slow
@pytest.mark.parametrize("coupling", [DIRECT, TWO_TO_ONE, "d3 = { th4 = 0.0555 }"])
def test_a_run_is_verified(coupling: str, fast_kernel: Kernel) -> None:
    robot = coupled_robot(coupling)
    made = carried(robot)
    outcome = execute(made, "carried", fast_kernel)
    report = outcome.report
    assert outcome.fault is None
    assert report.reasons == ()
    ends = made.motion.positions(np.array([made.motion.duration_s]))[0]
    assert report.joints.end == pytest.approx(ends, abs=2 / STEPS_PER_DEG)
    assert [axis.steps_end for axis in report.axes] == pytest.approx(robot.to_steps(ends), abs=0.6)
    assert report.tool.position_error_mm_max < 0.2


def test_the_shoulder_alone_turns_both_motors(fast_kernel: Kernel) -> None:
    """90 deg of the shoulder are 3200 steps, and as many of the elbow's motor, though the elbow does not bend."""
    robot = coupled_robot()
    motion = Composer(robot, np.array(robot.home))
    motion.go_some({"th1": 90.0})
    report = execute(plan(robot, motion.sequence()), "turn", fast_kernel).report
    assert [axis.steps_end for axis in report.axes] == [3200, 3200, 0, 0]
    assert report.joints.end == (90.0, 0.0, 0.0, 0.0)
    assert report.passed


@pytest.mark.slow
def test_the_verifier_needs_the_coupling(fast_kernel: Kernel) -> None:
    """Judged as the pulses of a robot whose joints have motors of their own, or other belts, the same run fails."""
    made = carried(coupled_robot())
    outcome = execute(made, "carried", fast_kernel)
    for coupling in ("", TWO_TO_ONE):
        expected = Expectation.of(coupled_robot(coupling), made.motion)
        report = verify(expected, outcome.comparison.evidence, outcome.report.run)
        assert any(reason.startswith("th2: ") for reason in report.reasons)
        assert not any(reason.startswith("th1: ") for reason in report.reasons)


@pytest.mark.slow
def test_a_lost_step_of_the_shoulder_bends_the_elbow_in_the_report(fast_kernel: Kernel) -> None:
    """One step less of the shoulder's motor is a step more at the elbow, because the elbow's motor did its part."""
    robot = coupled_robot()
    made = carried(robot)
    outcome = execute(made, "carried", fast_kernel)
    expected = Expectation.of(robot, made.motion)
    assert expected.joints(np.array([-1, 0, 0, 0])) == pytest.approx([-1 / STEPS_PER_DEG, 1 / STEPS_PER_DEG, 0.0, 0.0])
    comparison = compare(expected, outcome.comparison.evidence)
    assert [len(axis.signs) for axis in comparison.ideal] == [len(axis.signs) for axis in comparison.counted]


def test_a_machine_stands_at_joint_positions(fast_kernel: Kernel) -> None:
    board = BoardUnderTest(coupled_robot(), stand_at={"th1": 45.0, "th2": -90.0}, kernel=fast_kernel)
    assert board.steps() == {"th1": 1600, "th2": -1600, "d3": 0, "th4": 0}
    assert board.joints() == {"th1": 45.0, "th2": -90.0, "d3": 0.0, "th4": 0.0}
