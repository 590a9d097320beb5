"""Test the planner and the host program against an emulated board, in virtual time."""

import numpy as np
import pytest
from pick_and_place.arm import Arm, ArmError
from pick_and_place.planner import Point, plan_move

from steptwin import BoardUnderTest, EmergencyStop, FaultOptions, FrameLoss, Motion, Scheduled, hermite_spline

COUNTS_PER_S = 72_000_000
HALF_A_STEP = 0.02
"""Half a step of any joint, in mm or degrees, at most."""
MOVE = plan_move((0.0, 0.0, 0.0, 0.0), (45.0, -30.0, 10.0, 90.0), duration_ms=1000)


@pytest.fixture
def arm(steptwin_board: BoardUnderTest) -> Arm:
    arm = Arm(steptwin_board.network, sleep=steptwin_board.wait)
    arm.enable()
    return arm


def planned(board: BoardUnderTest, points: list[Point]) -> Motion:
    """Return the same motion as a trajectory, for the board's verification."""
    times_s = np.array([point.t_ms / 1000 for point in points])
    positions, velocities = ([getattr(point, name) for point in points] for name in ("positions", "velocities"))
    return hermite_spline(board.robot.joint_names, times_s, np.array(positions), np.array(velocities))


def test_every_pulse_is_where_it_was_planned(steptwin_board: BoardUnderTest, arm: Arm) -> None:
    arm.move(MOVE)
    report = steptwin_board.verify(planned(steptwin_board, MOVE))
    assert report.passed, report.reasons
    assert steptwin_board.joints() == pytest.approx({"th1": 45, "th2": -30, "d3": 10, "th4": 90}, abs=HALF_A_STEP)
    assert steptwin_board.violations() == []


def test_the_gripper_closes(steptwin_board: BoardUnderTest, arm: Arm) -> None:
    arm.grip(closed=True)
    assert steptwin_board.outputs() == {"gripper": True}


@pytest.mark.steptwin(extras=[FaultOptions(scenario=[FrameLoss(cob_ids=range(0x510, 0x514), skip=20, count=1)])])
def test_a_lost_record_is_sent_again(steptwin_board: BoardUnderTest, arm: Arm) -> None:
    arm.move(MOVE)
    assert steptwin_board.verify(planned(steptwin_board, MOVE)).passed


@pytest.mark.steptwin(schedule=[Scheduled(COUNTS_PER_S // 2, EmergencyStop(pressed=True))])
def test_the_emergency_stop_is_noticed(steptwin_board: BoardUnderTest, arm: Arm) -> None:
    with pytest.raises(ArmError, match="in fault"):
        arm.move(MOVE)
    steptwin_board.wait(1.0)
    stopped = steptwin_board.steps()
    assert 0 < stopped["th1"] < 1600  # on the way to 45 degrees
    steptwin_board.wait(1.0)
    assert steptwin_board.steps() == stopped


@pytest.mark.steptwin(stand_at={"th1": 100.0})
def test_a_limit_switch_stops_the_arm(arm: Arm) -> None:
    """The arm stands 35 degrees before the switch and has not been homed, so no software limit stops it first."""
    with pytest.raises(ArmError) as stopped:
        arm.move(MOVE)
    assert stopped.value.code == 0x8612
