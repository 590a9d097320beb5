"""Steps of the tool by hand: straight, at the wanted speed, and with what would pass where one is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.tool_by_hand import (
    SPEED_MAX_MM_S,
    TURN_MAX_DEG,
    TURN_SPEED_MAX_DEG_S,
    StepFrame,
    ToolStep,
    plan_tool_step,
)
from steptwin.host.robots import load_robot
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.robot import Robot
from tests.features.arms.test_numeric import five_axes
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.test_usual_scara import scara

STANDING = {
    "lab-scara": [150.0, 10.0, 40.0, 20.0],
    "warehouse-scara": [300.0, 200.0, 120.0, 10.0, 60.0, 30.0],
    "teaching-scara": [20.0, 50.0, 20.0, -30.0],
    "calibration-scara": [-20.0, -50.0, 60.0, 100.0],
    "hybrid-arm": [15.0, 20.0, -30.0, 40.0],
}
ARM = load_robot("ar4-mk3")
BENT = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
"""A joint position of the six-axis arm in which its tool is turned about all three axes of the world."""
"""A joint position of each robot from which its tool can go in all directions."""
ROBOTS = [load_robot(name) for name in STANDING]
AXES = ("x", "y", "z", "phi")
CENTIMETRES = [
    *(("x", 10.0), ("y", -10.0), ("z", 10.0), ("phi", -10.0)),
    *(pytest.param(*way, marks=pytest.mark.slow) for way in (("x", -10.0), ("y", 10.0), ("z", -10.0), ("phi", 10.0))),
]


def rounded(robot: Robot, joints: list[float]) -> list[float]:
    return [float(each) for each in robot.to_positions(robot.to_units(np.array(joints)))]


def standing(robot: Robot) -> list[float]:
    """Return the joint position, as the wire's whole units have it."""
    return rounded(robot, STANDING[robot.name])


def planned(robot: Robot, axis: str, distance: float, percent: float = 20.0) -> Plan:
    return plan_tool_step(robot, standing(robot), ToolStep({axis: distance}, percent))


def poses(plan: Plan, t_s: FloatArray) -> FloatArray:
    return make_kinematics(plan.robot).forward(plan.motion.positions(t_s))


@pytest.mark.parametrize(("axis", "distance"), CENTIMETRES)
@pytest.mark.parametrize("robot", ROBOTS, ids=list(STANDING))
def test_the_tool_moves_along_one_axis_alone(robot: Robot, axis: str, distance: float) -> None:
    """At every instant; at the end by the whole distance; from exactly where the machine stands."""
    plan = planned(robot, axis, distance)
    path = poses(plan, np.linspace(0.0, plan.motion.duration_s, 201))
    moved = path - path[0]
    moved[:, 3] = (moved[:, 3] + 180.0) % 360.0 - 180.0
    column = AXES.index(axis)
    assert np.delete(moved, column, axis=1) == pytest.approx(np.zeros((201, 3)), abs=1e-6)
    assert moved[-1, column] == pytest.approx(distance, abs=1e-6)
    assert np.all(np.diff(np.sign(distance) * moved[:, column]) > -1e-9)
    assert plan.start_units == robot.to_units(np.array(standing(robot))).tolist()


@pytest.mark.parametrize("robot", ROBOTS, ids=list(STANDING))
@pytest.mark.parametrize("percent", [pytest.param(1.0, marks=pytest.mark.slow), 20.0, 100.0])
def test_the_speed_is_the_wanted_part_unless_a_joint_is_slower(robot: Robot, percent: float) -> None:
    for axis, highest in (("x", SPEED_MAX_MM_S), ("z", SPEED_MAX_MM_S), ("phi", TURN_SPEED_MAX_DEG_S)):
        plan = planned(robot, axis, 20.0, percent)
        t_s = np.arange(0.0, plan.motion.duration_s, 0.001)
        speed = np.abs(np.diff(poses(plan, t_s)[:, AXES.index(axis)]) / 0.001).max()
        assert speed <= percent / 100 * highest * (1 + 1e-6)
        at_a_limit = max(peak.percent for peak in plan.peaks) > 95.0
        short = 20.0 / highest / (percent / 100) < 0.3  # the way ends before the tool has its speed
        assert at_a_limit or short or speed == pytest.approx(percent / 100 * highest, rel=0.01)


@pytest.mark.parametrize("robot", ROBOTS, ids=list(STANDING))
def test_there_and_back(robot: Robot) -> None:
    there = planned(robot, "y", 12.5)
    at = [float(each) for each in robot.to_positions(there.points_units[-1])]
    back = plan_tool_step(robot, at, ToolStep({"y": -12.5}, 50.0))
    assert np.abs(back.points_units[-1] - there.points_units[0]).max() <= 8  # of 1024 for a step
    assert back.start_units == list(there.points_units[-1])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "robot",
    [pytest.param(robot, id=robot.name, marks=pytest.mark.slow if robot.sections else ()) for robot in ROBOTS],
)
def test_what_is_said_to_pass_passes_and_a_tenth_more_does_not(
    robot: Robot, axis: str, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    far = ToolStep({axis: sign * 3000.0}, 100.0)
    complaint = complaint_of(lambda: plan_tool_step(robot, standing(robot), far))
    said = float(re.findall(r"[xyz] (\S+) mm passes$", complaint)[0])
    plan_tool_step(robot, standing(robot), ToolStep({axis: said}, 100.0))
    beyond = ToolStep({axis: said + sign * 0.1}, 100.0)
    monkeypatch.setattr(
        "steptwin.host.planning.tool_by_hand._passing_text", lambda *_: ""
    )  # a second search is not needed
    complaint_of(lambda: plan_tool_step(robot, standing(robot), beyond))


TEACHING = load_robot("teaching-scara")


@pytest.mark.parametrize("name", ["teaching-scara", "calibration-scara"])
def test_lift_and_wrist_move_where_the_arm_is_singular(name: str) -> None:
    """At home the arm is stretched: the lift goes down and the wrist turns, but the tool cannot go along x."""
    robot = load_robot(name)
    home = list(robot.home)
    for axis, distance in (("z", -10.0), ("phi", 180.0), ("phi", -TURN_MAX_DEG)):
        plan = plan_tool_step(robot, home, ToolStep({axis: distance}, 20.0))
        assert poses(plan, np.array([plan.motion.duration_s]))[0, 2] == pytest.approx(
            make_kinematics(robot).forward(np.array([home]))[0, 2] + (distance if axis == "z" else 0.0)
        )
    complaint = complaint_of(lambda: plan_tool_step(robot, home, ToolStep({"x": -5.0}, 20.0)))
    assert "near singular" in complaint
    lift = complaint_of(lambda: plan_tool_step(robot, home, ToolStep({"z": 5.0}, 20.0)))
    assert lift.startswith(f"z +5 mm: d3: -5.0 mm is outside 0..{robot.joint('d3').upper:g} mm")  # the whole step
    assert complaint.endswith("; not even 0.1 passes in this direction: jog a joint first")


def test_near_a_singularity_the_step_is_slower() -> None:
    near, away = ([0.0, th2, 0.0, 0.0] for th2 in (2.0, 60.0))
    slow, usual = (plan_tool_step(TEACHING, at, ToolStep({"x": -2.0}, 100.0)) for at in (near, away))
    assert slow.motion.duration_s > 1.5 * usual.motion.duration_s
    assert max(peak.percent for peak in slow.peaks) == pytest.approx(100.0, abs=1.0)


def test_a_tool_that_does_not_turn_by_itself_turns_with_the_arm() -> None:
    arm = scara(turning=False)
    at = rounded(arm, [20.0, 60.0, 10.0])
    for axis, distance in (("x", -30.0), ("y", 20.0), ("z", -5.0)):
        plan = plan_tool_step(arm, at, ToolStep({axis: distance}, 20.0))
        path = poses(plan, np.linspace(0.0, plan.motion.duration_s, 101))
        wanted = np.zeros(3)
        wanted[AXES.index(axis)] = distance
        assert path[-1, :3] - path[0, :3] == pytest.approx(wanted, abs=1e-6)
        assert (np.ptp(path[:, 3]) > 1) == (axis != "z")
    complaint = complaint_of(lambda: plan_tool_step(arm, at, ToolStep({"phi": 1.0}, 20.0)))
    assert complaint == f"phi +1 deg: the tool of {arm.name} does not turn by itself"


def test_coupled_axes_follow_the_joints() -> None:
    """The elbow's motor stands on the base: its axis turns by both angles."""
    coupled = replace(TEACHING, coupling=Coupling.of(TEACHING.joint_names, {"th2": {"th1": 1.0}}))
    at = [20.0, 50.0, 20.0, -30.0]
    alone, both = (plan_tool_step(robot, at, ToolStep({"y": 10.0}, 20.0)) for robot in (TEACHING, coupled))
    assert both.motion.duration_s == alone.motion.duration_s
    sums = alone.points_units.copy()
    sums[:, 1] += alone.points_units[:, 0]
    assert np.abs(both.points_units - sums).max() <= 1


@pytest.mark.parametrize("limit", [TEACHING.joints[1].lower, TEACHING.joints[1].upper])
def test_the_rounding_of_a_limit_to_wire_units_does_not_hold_the_tool(limit: float) -> None:
    at = rounded(TEACHING, [10.0, limit, 20.0, 0.0])
    plan = plan_tool_step(TEACHING, at, ToolStep({"z": 5.0}, 20.0))
    assert plan.start_units == TEACHING.to_units(np.array([10.0, limit, 20.0, 0.0])).tolist()
    outside = [10.0, limit + np.copysign(0.001, limit), 20.0, 0.0]
    complaint_of(lambda: plan_tool_step(TEACHING, outside, ToolStep({"z": 5.0}, 20.0)))


@pytest.mark.parametrize(
    "distances",
    [
        {"x": 0.0},
        {"q": 1.0},
        {"phi": 360.1},
    ],
)
def test_a_bad_step(distances: dict[str, float]) -> None:
    complaint_of(lambda: ToolStep(distances, 20.0))


def moved_by(robot: Robot, start: list[float], step: ToolStep) -> tuple[FloatArray, FloatArray]:
    """Return by what the tool moves, (3,), and turns, (3, 3), in the axes of the step's frame."""
    plan = plan_tool_step(robot, start, step)
    joints = plan.motion.positions(np.array([0.0, plan.motion.duration_s]))
    first, last = tool_frames(make_kinematics(robot), joints)
    axes = first[:3, :3] if step.frame is StepFrame.TOOL else np.eye(3)
    return axes.T @ (last - first)[:3, 3], axes.T @ last[:3, :3] @ first[:3, :3].T @ axes


def turn_about(axis: int, angle_deg: float) -> FloatArray:
    """Return the rotation about one axis, as books write it."""
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[first, first] = turn[second, second] = np.cos(np.deg2rad(angle_deg))
    turn[second, first] = np.sin(np.deg2rad(angle_deg))
    turn[first, second] = -turn[second, first]
    return turn


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("frame", StepFrame)
def test_a_six_axis_arm_moves_along_and_turns_about_each_axis(frame: StepFrame, axis: int, sign: float) -> None:
    way_mm, turn = moved_by(ARM, BENT, ToolStep({"xyz"[axis]: 12.0 * sign}, 20.0, frame))
    assert way_mm == pytest.approx(12.0 * sign * np.eye(3)[axis], abs=1e-6)
    assert turn == pytest.approx(np.eye(3), abs=1e-8)
    way_mm, turn = moved_by(ARM, BENT, ToolStep({f"r{'xyz'[axis]}": 9.0 * sign}, 20.0, frame))
    assert way_mm == pytest.approx(np.zeros(3), abs=1e-6)
    assert turn == pytest.approx(turn_about(axis, 9.0 * sign), abs=1e-8)


@pytest.mark.parametrize("name", STANDING)
def test_every_arm_moves_along_its_tool(name: str) -> None:
    robot = load_robot(name)
    for axis in range(3):
        way_mm, _ = moved_by(robot, standing(robot), ToolStep({"xyz"[axis]: 7.0}, 20.0, StepFrame.TOOL))
        assert way_mm == pytest.approx(7.0 * np.eye(3)[axis], abs=1e-6)


def test_a_refused_step_along_the_tool_says_so() -> None:
    """With J5 at 0 the axes of J4 and J6 are one: J4 would have to jump."""
    step = ToolStep({"y": 10.0}, 20.0, StepFrame.TOOL)
    complaint = complaint_of(lambda: plan_tool_step(ARM, [0.0] * 6, step))
    assert complaint.startswith("the tool's y +10 mm: at t = ")
    assert "J4 would move by 90 deg in a millisecond, near the stretched wrist" in complaint
    assert complaint.endswith("; not even 0.1 passes in this direction: jog a joint first")


@pytest.mark.slow
def test_a_spin_that_follows_from_the_arm_is_no_step() -> None:
    """An arm of five axes turns its direction about the tool's x and y; about its own z nothing would move."""
    arm = five_axes()
    start = rounded(arm, [20.0, 10.0, 20.0, 30.0, 40.0])
    before = make_kinematics(arm).forward(np.array([start]))[0, 3:]
    plan = plan_tool_step(arm, start, ToolStep({"rx": 5.0}, 20.0, StepFrame.TOOL))
    after = poses(plan, np.array([plan.motion.duration_s]))[0, 3:]
    assert np.rad2deg(np.arccos(before @ after)) == pytest.approx(5.0, abs=1e-6)
    complaint = complaint_of(lambda: plan_tool_step(arm, start, ToolStep({"rz": 5.0}, 20.0, StepFrame.TOOL)))
    assert complaint.startswith("the tool's rz +5 deg: turns the tool about itself only, and its spin follows from the")
