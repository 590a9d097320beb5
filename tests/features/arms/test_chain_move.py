"""Straight ways of arms with six axes: through the stretched wrist without a jump, and what is refused."""

import re

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.laws import SCurve
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.tool_move import ToolMove, present_branch, tool_move
from steptwin.host.planning.paths import OnTheSpot, Oriented, OutOfReachError, ToolPath, straight
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs.compiling import compile_program
from steptwin.host.planning.programs.program_file import parse_program
from steptwin.host.robots.poses import POSE, Orientation, Pose, Turning
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import arm, kinematics_of
from tests.features.arms.test_numeric import five_axes, missing_wrist
from tests.laws import law_of
from tests.messages import refusing

FINE_S = 1e-4


def pose_of(robot: Robot, joints: list[float]) -> Pose:
    return tuple(kinematics_of(robot).forward(np.array([joints]))[0].tolist())


def along(robot: Robot, path: ToolPath, joints: list[float], speed: float = 20.0) -> Motion:
    start = np.array(joints)
    return tool_move(robot, path, SCurve.at_speed(path.length_mm, speed, 0.3), present_branch(robot, start), start)


def sampled(move: Motion) -> tuple[FloatArray, FloatArray]:
    t_s = np.arange(0.0, move.duration_s, FINE_S)
    return t_s, move.positions(t_s)


def check_follows(robot: Robot, move: Motion, off_mm: float = 1e-6) -> None:
    """The tool is on its path at every instant, and the velocities are the positions' derivatives."""
    kinematics = kinematics_of(robot)
    t_s, joints = sampled(move)
    law = law_of(move, ToolMove)
    planned, reached = law.path.poses(law.law.position(t_s)), kinematics.forward(joints)
    assert np.linalg.norm((reached - planned)[:, :3], axis=1).max() < off_mm
    assert kinematics.task.off_deg(reached, planned).max() < 1e-4
    differences = (joints[2:] - joints[:-2]) / (2 * FINE_S)
    assert np.abs(move.velocities(t_s[1:-1]) - differences).max() < 0.2


class TestThroughTheStretchedWrist:
    ROBOT = arm("AR4")
    BEFORE = (0.0, 10.0, -20.0, 0.0, 10.0, 0.0)

    def line(self) -> tuple[ToolPath, list[float]]:
        """A way on which the wrist's bend goes from 10 deg through 0: the tool turns about y while it moves."""
        joints = list(self.BEFORE)
        here = pose_of(self.ROBOT, joints)
        there = POSE.stepped(here, {"x": 20.0, "ry": -25.0})
        return straight(POSE, here, there), joints

    def test_no_joint_jumps(self) -> None:
        path, joints = self.line()
        move = along(self.ROBOT, path, joints)
        _, positions = sampled(move)
        assert positions[0, 4] > 5.0
        assert positions[-1, 4] < -5.0
        assert np.abs(np.diff(positions, axis=0)).max() < 0.01
        assert np.abs(positions[:, [3, 5]]).max() < 1e-6
        check_follows(self.ROBOT, move)

    def test_it_is_told_where_the_branch_changes(self) -> None:
        path, joints = self.line()
        move = along(self.ROBOT, path, joints)
        law = law_of(move, ToolMove)
        assert law.branch == "front-up-noflip"
        ((at_s, name),) = law.changes
        assert name == "front-up-flip"
        assert move.positions(np.array([at_s]))[0, 4] == pytest.approx(0.0, abs=0.1)

    def test_a_programs_step_says_what_it_passes(self) -> None:
        text = (
            "start = { J1 = 0, J2 = 10, J3 = -20, J4 = 0, J5 = 10, J6 = 0 }\n"
            "[[step]]\nby = { x = 20.0, ry = -25.0 }\nspeed_mm_s = 10.0\nramp_s = 0.5\n"
        )
        (row,) = compile_program(parse_program(text, Findings()), self.ROBOT).steps
        (sentence,) = row.passed()
        assert row.branch == "front-up-noflip"
        assert re.fullmatch(
            r"passes the wrist singularity at \d\d %, \d\.\d\d\d s: front-up-noflip -> front-up-flip", sentence
        )

    def test_the_planner_takes_it(self) -> None:
        path, joints = self.line()
        assert plan(self.ROBOT, along(self.ROBOT, path, joints)).peaks

    def test_beside_it_the_fourth_joint_is_too_fast(self) -> None:
        """A hair beside the stretched wrist q4 and q6 would turn by half a turn at once."""
        joints = [0.0, 10.0, -20.0, 2.0, 10.0, 0.0]
        here = pose_of(self.ROBOT, joints)
        path = straight(POSE, here, POSE.stepped(here, {"x": 20.0, "ry": -25.0}))
        with refusing(OutOfReachError) as e:
            along(self.ROBOT, path, joints)
        assert "near the stretched wrist, at x " in str(e.value)


def test_a_wrist_that_stays_stretched() -> None:
    """q5 = 0 all the way: q4 stays, q6 turns the tool."""
    robot = arm("AR4")
    joints = [0.0, 10.0, -20.0, 30.0, 0.0, 0.0]
    here = pose_of(robot, joints)
    turn = kinematics_of(robot).dh.transforms({f"J{i + 1}": np.array([q]) for i, q in enumerate(joints)})[0, :3, 2]
    path = Oriented(OnTheSpot(here[:3], 40.0), Turning(POSE, np.array(here[3:]), 40.0 * turn))
    _, positions = sampled(along(robot, path, joints))
    assert np.abs(positions[:, :5] - positions[0, :5]).max() < 1e-6
    assert positions[-1, 5] - positions[0, 5] == pytest.approx(40.0, abs=0.01)


@pytest.mark.slow
def test_a_line_of_random_joints() -> None:
    """From (20 20 10 30 40 50) to (-30 35 -5 10 60 20) there is no change of branch, and the end is exact."""
    robot = arm("AR4")
    start, goal = [20.0, 20.0, 10.0, 30.0, 40.0, 50.0], [-30.0, 35.0, -5.0, 10.0, 60.0, 20.0]
    move = along(robot, straight(POSE, pose_of(robot, start), pose_of(robot, goal)), start)
    assert law_of(move, ToolMove).changes == ()
    assert move.positions(np.array([move.duration_s]))[0] == pytest.approx(goal, abs=1e-9)
    check_follows(robot, move)


@pytest.mark.slow
@pytest.mark.parametrize("make", [five_axes, missing_wrist])
def test_arms_without_a_closed_form(make) -> None:  # type: ignore[no-untyped-def]
    robot = make()
    task = kinematics_of(robot).task
    joints = [20.0, 20.0, 10.0, 30.0, 40.0, 50.0][: len(robot.joints)]
    here = pose_of(robot, joints)
    move = along(robot, straight(task, here, task.stepped(here, {"x": 15.0, "y": -30.0, "rx": 5.0})), joints)
    check_follows(robot, move)


def test_a_turn_of_half_a_turn_is_refused() -> None:
    robot = arm("AR4")
    here = pose_of(robot, [0.0, 0.0, 0.0, 0.0, 45.0, 0.0])
    there = POSE.changed(
        here, {"x": here[0] + 10.0}, Orientation("quaternion_xyzw", (-here[4], here[3], here[6], -here[5]))
    )
    with refusing(InputError):
        straight(POSE, here, there)


def test_out_of_reach_on_the_way() -> None:
    robot = arm("AR4")
    joints = [0.0, 0.0, 0.0, 0.0, 45.0, 0.0]
    here = pose_of(robot, joints)
    with refusing(OutOfReachError):
        along(robot, straight(POSE, here, POSE.stepped(here, {"x": 400.0})), joints)
