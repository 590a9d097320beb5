"""Rounded corners: where they leave their legs and at which distance they pass, and what is refused."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.fastest.corners import MotionLeg, ToolLeg, flowing
from steptwin.features.fastest.pieces import FollowedPath, ToolPiece
from steptwin.features.fastest.tool_rounding import ToolRounding
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.motions.whole import CornerError, Pace
from steptwin.host.planning.paths import Arc, StraightLine, straight
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.features.fastest.paths import joint_legs, tool_legs
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
START = np.array([20.0, 105.0, 30.0, 0.0])


def tool_mm(joints: FloatArray) -> FloatArray:
    return make_kinematics(ROBOT).forward(joints)[:, :3]


ways = st.tuples(st.floats(-24, 24), st.floats(-24, 24), st.floats(-8, 8)).filter(lambda way: np.linalg.norm(way) > 10)


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(ways, ways, st.floats(0.2, 9.9))
def test_a_corner_of_lines_is_left_at_r_and_passed_at_what_the_formula_says(
    first: tuple[float, ...], second: tuple[float, ...], r_mm: float
) -> None:
    """3/16 r |t2 - t1|, for the nearest place of a quartic that is symmetric about the corner."""
    t1, t2 = np.array(first) / np.linalg.norm(first), np.array(second) / np.linalg.norm(second)
    legs = tool_legs(ROBOT, START, [first, second])
    flow = flowing(ROBOT, legs, [r_mm])
    corner_mm = tool_mm(START[np.newaxis])[0] + first
    (corner,) = flow.corners
    assert corner.passes_mm == pytest.approx(3 / 16 * r_mm * np.linalg.norm(t2 - t1), abs=0.01)
    assert corner.s == pytest.approx(np.linalg.norm(first), abs=0.05 * r_mm)
    begin, end = flow.path.starts[1], flow.path.starts[2]
    places_mm = tool_mm(flow.path.at(np.array([begin, end]))[0])
    assert places_mm[0] == pytest.approx(corner_mm - r_mm * t1, abs=1e-6)
    assert places_mm[1] == pytest.approx(corner_mm + r_mm * t2, abs=1e-6)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-70, 70), st.floats(30, 100), st.floats(5, 55), st.floats(-90, 90)), min_size=3, max_size=3
    ).filter(lambda rows: min(np.abs(np.diff(rows, axis=0)).max(axis=1)) > 8.0),
    st.floats(0.5, 4.0),
)
def test_a_corner_of_joint_moves_keeps_to_the_legs_outside_r(rows: list[tuple[float, ...]], r_mm: float) -> None:
    """Outside of r mm of the tool's way from the corner the joints are exactly on their straight legs."""
    corners = np.array(rows)
    legs = joint_legs(ROBOT, corners)
    if any(leg.length < 2.2 * r_mm for leg in legs):
        return
    flow = flowing(ROBOT, legs, [r_mm])
    (corner,) = flow.corners
    path = flow.path
    for begin, end, start, goal in ((0.0, path.starts[1], 0, 1), (path.starts[2], path.starts[3], 1, 2)):
        joints = path.at(np.linspace(begin, end, 20))[0]
        way = corners[goal] - corners[start]
        part = ((joints - corners[start]) @ way) / (way @ way)
        assert joints == pytest.approx(corners[start] + part[:, np.newaxis] * way, abs=1e-9)
    ends_mm = tool_mm(path.at(path.starts[1:3])[0])
    away_mm = np.linalg.norm(ends_mm - tool_mm(corners[1:2]), axis=1)
    assert (away_mm <= r_mm + 0.02).all()
    fine_mm = tool_mm(path.at(np.linspace(path.starts[1], path.starts[2], 2001))[0])
    nearest_mm = np.linalg.norm(fine_mm - tool_mm(corners[1:2]), axis=1).min()
    assert corner.passes_mm == pytest.approx(nearest_mm, abs=0.01)


def test_position_direction_and_curvature_go_on_at_both_ends_of_every_rounding() -> None:
    branch = present_branch(ROBOT, START)
    kinematics = make_kinematics(ROBOT)
    here = tuple(kinematics.forward(START[np.newaxis])[0].tolist())
    line = FollowedPath.along(ROBOT, StraightLine(here, (here[0] - 30, here[1], here[2], here[3] + 20)), branch, START)
    corner = tuple(line.path.poses(np.array([30.0]))[0].tolist())
    arc = Arc.through(corner, (corner[0] - 8, corner[1] - 12, corner[2]), (corner[0], corner[1] - 24, *corner[2:]))
    turned = FollowedPath.along(ROBOT, arc, branch, line.end)
    mixed = joint_legs(ROBOT, np.array([turned.end, turned.end + np.array([20.0, -5.0, 5.0, 10.0])]))
    legs: list[MotionLeg] = [ToolLeg(line, Pace()), ToolLeg(turned, Pace()), *mixed]
    path = flowing(ROBOT, legs, [3.0, 3.0]).path
    assert [type(piece).__name__ for piece in path.pieces] == [
        "ToolPiece",
        "ToolPiece",
        "ToolPiece",
        "JointPiece",
        "JointPiece",
    ]
    for before, after in pairwise(path.pieces):
        for order, off in ((0, 1e-6), (1, 1e-5), (2, 2e-3)):
            ends = before.joints(np.array([before.length]), order), after.joints(np.zeros(1), order)
            assert ends[0] == pytest.approx(ends[1], abs=off)


def test_a_tool_that_turns_in_space_turns_without_a_jump() -> None:
    """An arm of six axes: the rounding's turning is the derivative of its orientation, and meets both lines'."""
    robot = load_robot("ar4-mk3")
    kinematics = make_kinematics(robot)
    start = np.array([0.0, 10.0, 0.0, 0.0, 60.0, 0.0])
    pose = kinematics.forward(start[np.newaxis])[0]
    turn = kinematics.task.stepped(tuple(pose.tolist()), {"x": 40.0, "rx": 25.0, "rz": 10.0})
    on = kinematics.task.stepped(turn, {"y": 40.0, "ry": -30.0})
    branch = present_branch(robot, start)
    first = FollowedPath.along(robot, straight(kinematics.task, tuple(pose.tolist()), turn), branch, start)
    second = FollowedPath.along(robot, straight(kinematics.task, turn, on), branch, first.end)
    path = flowing(robot, [ToolLeg(first, Pace()), ToolLeg(second, Pace())], [8.0]).path
    rounding = path.pieces[1]
    assert isinstance(rounding, ToolPiece)
    assert isinstance(rounding.followed.path, ToolRounding)
    tool = rounding.followed.path
    s, h = np.linspace(0.5, 15.5, 31), 1e-4
    before, after = tool.poses(s - h), tool.poses(s + h)
    assert tool.derivatives(s)[:, :3] == pytest.approx((after - before)[:, :3] / (2 * h), abs=1e-6)
    assert np.linalg.norm(tool.derivatives(s)[:, 3:], axis=1) == pytest.approx(
        kinematics.task.off_deg(after, before) / (2 * h), abs=1e-4
    )
    assert tool.derivatives(np.zeros(1))[0, 3:] == pytest.approx(first.path.derivatives(np.zeros(1))[0, 3:])
    assert tool.derivatives(np.array([16.0]))[0, 3:] == pytest.approx(second.path.derivatives(np.zeros(1))[0, 3:])
    assert kinematics.task.off_deg(tool.poses(np.zeros(1)), first.path.poses(np.array([first.path.length_mm - 8.0])))[
        0
    ] == pytest.approx(0.0, abs=1e-6)


class TestRefusals:
    legs = tool_legs(ROBOT, START, [(-20.0, 0.0, 0.0), (0.0, -10.0, 0.0), (20.0, 0.0, 0.0)])

    def refused(self, *radii_mm: float) -> CornerError:
        with pytest.raises(CornerError) as caught:
            flowing(ROBOT, self.legs, radii_mm)
        return caught.value

    def test_longer_than_the_leg_behind_the_corner(self) -> None:
        error = self.refused(10.5, 0.5)
        assert error.corner == 0
        assert str(error) == (
            "blend_mm: 10.5 mm is more than the leg has: 10 mm, and the corner at its other end takes 0.5 mm;"
            " 9.5 passes"
        )

    def test_two_corners_that_share_a_leg(self) -> None:
        error = self.refused(6.0, 4.5)
        assert error.corner == 0
        assert str(error) == (
            "blend_mm: 6 mm is more than the leg has: 10 mm, and the corner at its other end takes 4.5 mm; 5.5 passes"
        )
        assert len(flowing(ROBOT, self.legs, [5.5, 4.5]).corners) == 2

    def test_longer_than_the_first_leg(self) -> None:
        legs = tool_legs(ROBOT, START, [(-5.0, 0.0, 0.0), (0.0, -30.0, 0.0)])
        with refusing(CornerError):
            flowing(ROBOT, legs, [5.1])
        assert flowing(ROBOT, legs, [5.0]).corners[0].r_mm == 5.0

    def test_flowing_on_over_a_kink(self) -> None:
        assert "turn by" in str(self.refused(0.0, 1.0))

    @pytest.mark.parametrize(("kink_deg", "passes"), [(0.05, True), (0.3, False)])
    def test_a_small_kink_flows_on(self, kink_deg: float, passes: bool) -> None:
        side = 20.0 * np.tan(np.deg2rad(kink_deg))
        legs = tool_legs(ROBOT, START, [(-20.0, 0.0, 0.0), (-20.0, side, 0.0)])
        if passes:
            assert flowing(ROBOT, legs, [0.0]).corners[0].passes_mm == 0.0
        else:
            with refusing(CornerError):
                flowing(ROBOT, legs, [0.0])
