"""Goals are checked whole before anything moves: joints, units, times, limits, start and tolerances."""

import re
from itertools import product
from math import inf, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.features.ros2.goals import (
    TRANSITIONS,
    ActiveGoal,
    GoalEvent,
    GoalState,
    RefusedGoalError,
    follow_goal,
    step_tolerances,
)
from steptwin.features.ros2.messages import RosNames, duration
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot, robot_names
from tests.features.ros2.stub_rosbridge import FORTH, arguments, moved, point
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT
from tests.messages import refused_with, refusing

TH1 = ROBOT.joint_names.index("th1")
START_LIMIT_DEG = 0.01 * 180.0 / pi
PATHS = [
    ("BEGUN REACHED", 4),
    ("BEGUN FAILED", 6),
    ("FAILED", 6),
    ("CANCEL STOPPED", 5),
    ("BEGUN CANCEL STOPPED", 5),
    ("BEGUN CANCEL CANCEL STOPPED", 5),
    ("BEGUN CANCEL FAILED", 6),
]
"""Events of a goal, and the number of its last state in action_msgs/msg/GoalStatus."""


def refusal(args: object) -> tuple[int, str]:
    with pytest.raises(RefusedGoalError) as refused:
        follow_goal(ROBOT, args, HOME)
    code = int(refused.value.code)
    refused_with(f"{code}: {refused.value}")
    return code, str(refused.value)


def tolerance(name: str = "th1", **values: float) -> dict[str, Any]:
    return {"name": name, "position": 0.0, "velocity": 0.0, "acceleration": 0.0, **values}


def test_the_plan_is_the_goals_in_mm_and_degrees() -> None:
    motion = follow_goal(ROBOT, FORTH, HOME).plan.motion
    assert motion.duration_s == 2.0
    assert motion.positions(np.array([0.0, 1.0, 2.0])) == pytest.approx(
        np.array([HOME, moved(th1=10.0), moved(th1=20.0)]), abs=1e-9
    )


def test_joints_in_another_order_are_the_same_goal() -> None:
    args = arguments(point(0.0, HOME), point(2.0, moved(th1=20.0, sx=5.0)))
    turned = arguments(point(0.0, HOME), point(2.0, moved(th1=20.0, sx=5.0)))
    turned["trajectory"]["joint_names"].reverse()
    for each in turned["trajectory"]["points"]:
        each["positions"] = each["positions"][::-1]
    one, other = (follow_goal(ROBOT, each, HOME).plan.points_units for each in (args, turned))
    assert np.array_equal(one, other)


def test_velocities_are_those_of_the_points() -> None:
    still = [0.0] * len(HOME)
    moving = [0.0] * len(HOME)
    moving[TH1] = 12.0
    args = arguments(point(0.0, HOME, still), point(1.0, moved(th1=8.0), moving), point(2.0, moved(th1=16.0), still))
    motion = follow_goal(ROBOT, args, HOME).plan.motion
    assert motion.velocities(np.array([1.0]))[0, TH1] == pytest.approx(12.0, abs=1e-9)


def test_without_a_point_at_0_it_begins_where_the_machine_stands() -> None:
    for velocities in (None, [0.0] * len(HOME)):
        plan = follow_goal(ROBOT, arguments(point(1.5, moved(th1=5.0), velocities)), HOME).plan
        assert plan.motion.duration_s == 1.5
        assert plan.start_joints == pytest.approx(HOME)


@pytest.mark.parametrize("part", [0.99, -0.99])
def test_a_start_near_the_machine_is_moved_to_it(part: float) -> None:
    args = arguments(point(0.0, moved(th1=part * START_LIMIT_DEG, sx=part)), point(2.0, moved(th1=10.0)))
    assert follow_goal(ROBOT, args, HOME).plan.start_joints == pytest.approx(HOME)


def test_a_start_elsewhere_is_refused_with_the_limit() -> None:
    code, text = refusal(arguments(point(0.0, moved(th1=1.01 * START_LIMIT_DEG)), point(2.0, HOME)))
    assert code == -1
    assert re.fullmatch(
        r"th1: the trajectory starts at [\d.]+ deg, the machine stands at [\d.]+ deg \(limit: 0\.573 deg\);"
        r" a first point after 0 s moves it there",
        text,
    )
    assert refusal(arguments(point(0.0, moved(sx=1.01)), point(2.0, HOME)))[1].startswith(
        "sx: the trajectory starts at"
    )


@pytest.mark.parametrize(
    "names",
    [[], ["th1"], ["x", *ROBOT.joint_names[1:]], [*ROBOT.joint_names, "x"], [ROBOT.joint_names[0]] * len(HOME)],
)
def test_other_joints_are_refused_as_such(names: list[str]) -> None:
    args = arguments(point(0.0, HOME), point(2.0, HOME))
    args["trajectory"]["joint_names"] = names
    for each in args["trajectory"]["points"]:
        each["positions"] = [0.0] * len(names)
    code, text = refusal(args)
    assert code == -2
    assert text.endswith(f"{ROBOT.name} has {' '.join(ROBOT.joint_names)}, each once")


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (arguments(), "points: there are none; to stop a motion, cancel its goal"),
        (arguments(point(0.0, HOME)), "1 points: a motion takes at least 2"),
        (
            arguments(point(0.0, HOME), point(1.0, HOME), point(1.0, moved(th1=1.0))),
            "point 3, time_from_start: 1 s is not at least 1 us after the 1 s of the point before",
        ),
        (arguments(point(0.0, HOME), point(0.1, moved(th1=60.0))), "th1: "),
        (
            arguments(point(0.0, HOME), point(9.0, moved(th1=1000.0))),
            "point 2, th1: 1000.0 deg is outside -120..120 deg; the nearest is 120 deg",
        ),
        ({**FORTH, "component_path_tolerance": [{}]}, "component_path_tolerance: is for joints with several degrees"),
        ({**FORTH, "x": 1}, "x: key 'x' is unknown: there are trajectory, "),
    ],
)
def test_goals_that_cannot_be_executed(args: dict[str, Any], says: str) -> None:
    code, text = refusal(args)
    assert code == -1
    assert text.startswith(says)


def test_a_start_at_a_time_of_ros_is_refused() -> None:
    args = arguments(point(0.0, HOME), point(2.0, HOME))
    args["trajectory"]["header"] = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": ""}
    refusal(args)


def test_tolerances_on_the_way_that_a_stepper_cannot_keep() -> None:
    limit_rad = HALF_STEPS[TH1] * pi / 180.0
    follow_goal(ROBOT, {**FORTH, "path_tolerance": [tolerance(position=1.001 * limit_rad)]}, HOME)
    follow_goal(ROBOT, {**FORTH, "path_tolerance": [tolerance(position=-1.0, velocity=-1.0)]}, HOME)
    code, text = refusal({**FORTH, "path_tolerance": [tolerance(position=0.999 * limit_rad)]})
    assert code == -1
    assert text.endswith(f"is less than 9/16 step, {HALF_STEPS[TH1]:.4g} deg, which a stepper cannot keep")
    assert refusal({**FORTH, "path_tolerance": [tolerance(velocity=0.1)]})[1] == (
        "path_tolerance, th1: velocity is not watched; leave it 0"
    )
    refusal({**FORTH, "path_tolerance": [tolerance("x")]})


def test_tolerances_at_the_end() -> None:
    usual = follow_goal(ROBOT, FORTH, HOME)
    assert usual.end_tolerances == pytest.approx(np.array(HALF_STEPS), rel=1e-4, abs=2e-9)
    assert usual.late_max_s is None
    end = moved(th1=20.0)
    assert usual.missed(end) is None
    end[TH1] += 0.999 * HALF_STEPS[TH1]
    assert usual.missed(end) is None
    end[TH1] += 0.01 * HALF_STEPS[TH1]
    assert re.fullmatch(r"th1: stands [\d.]+ deg from the end \(limit: [\d.]+ deg\)", usual.missed(end) or "")
    wide = [tolerance(position=0.1, velocity=0.5), tolerance("sx", position=-1.0)]
    given = follow_goal(ROBOT, {**FORTH, "goal_tolerance": wide}, HOME)
    assert given.end_tolerances[TH1] == pytest.approx(0.1 * 180.0 / pi)
    assert given.end_tolerances[ROBOT.joint_names.index("sx")] == inf


def test_the_time_after_the_end_that_is_allowed() -> None:
    args = {**FORTH, "goal_time_tolerance": {"sec": 1, "nanosec": 500_000_000}}
    assert follow_goal(ROBOT, args, HOME).late_max_s == 1.5


@pytest.mark.parametrize("name", robot_names())
def test_every_robots_joints_may_be_nine_sixteenths_of_a_step_from_the_plan(name: str) -> None:
    robot = load_robot(name)
    tolerances = step_tolerances(robot)
    assert tolerances.shape == (len(robot.joints),)
    if not robot.coupling.matrix and len(robot.axes) == len(robot.joints):
        own = [9 / 16 / joint.transmission.steps_per_unit for joint in robot.joints]
        assert tolerances == pytest.approx(own, rel=2e-6)
    assert (tolerances > 0.0).all()


@given(st.floats(0.0, 1e6, allow_nan=False))
def test_durations_are_within_half_a_nanosecond(time_s: float) -> None:
    parts = duration(time_s)
    assert 0 <= parts["nanosec"] < 10**9
    assert abs(parts["sec"] + parts["nanosec"] / 1e9 - time_s) <= 0.5e-9 + time_s * 2e-16


@pytest.mark.parametrize("name", ["", "1arm", "arm-controller", "/arm", "arm/", "a b", "arm//x"])
def test_names_that_ros_does_not_take(name: str) -> None:
    with refusing(InputError):
        RosNames.of(name)
    assert RosNames.of("robot1/arm_controller").action == "/robot1/arm_controller/follow_joint_trajectory"


@pytest.mark.parametrize(("events", "number"), PATHS)
def test_a_goals_way(events: str, number: int) -> None:
    goal = ActiveGoal("g", {})
    for name in events.split():
        assert not goal.state.ended
        goal.take(GoalEvent[name])
    assert goal.state == number
    assert goal.state.ended


def test_every_transition_is_on_a_way_and_no_other_happens() -> None:
    used = set()
    for events, _ in PATHS:
        goal = ActiveGoal("g", {})
        for name in events.split():
            used.add((goal.state, GoalEvent[name]))
            goal.take(GoalEvent[name])
    assert used == set(TRANSITIONS)
    for state, event in product(GoalState, GoalEvent):
        if (state, event) not in TRANSITIONS:
            goal = ActiveGoal("g", {})
            goal.state = state
            with refusing(ValueError):
                goal.take(event)
