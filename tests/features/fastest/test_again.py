"""A motion made once more along its own path: the same places, within every limit, in less time."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.fastest.again import fastest_again
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Sequence, sequence, standstill
from steptwin.host.planning.motions.sampled import c2_spline, hermite_spline
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.laws import law_of

TEACHING = load_robot("teaching-scara")
WAREHOUSE = load_robot("warehouse-scara")
LAB = load_robot("lab-scara")
JOBS = [
    ("calibration-scara", "demo", 1.57),
    pytest.param("hybrid-arm", "five-points", 7.66, marks=pytest.mark.slow),
    pytest.param("hybrid-arm", "helix", 13.6, marks=pytest.mark.slow),
    ("lab-scara", "spiral", 1.53),
    ("teaching-scara", "carry", 0.72),
    ("warehouse-scara", "drawer-pull", 11.95),
    ("warehouse-scara", "pull-line", 8.10),
]
"""Each job with the seconds that it takes at most; by its own law it takes 2, 8.9, 80, 18.8, 1, 14.7 and 10."""


def at_lengths(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the length of the way up to each 1/10 ms in steps, shape (n,), and the places, shape (n, axes)."""
    steps = robot.to_steps(motion.positions(np.arange(0.0, motion.duration_s, 1e-4)))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(steps, axis=0), axis=1))])
    return lengths, steps


def use(robot: Robot, motion: Motion) -> float:
    """Return the largest part of a limit of the joints that a motion uses, by differences of 1/10 ms."""
    positions = motion.positions(np.arange(0.0, motion.duration_s, 1e-4))
    speeds = np.diff(positions, axis=0) / 1e-4
    accelerations = np.diff(speeds, axis=0) / 1e-4
    speeds_max = np.array([joint.speed_max for joint in robot.joints])
    accelerations_max = np.array([joint.acceleration_max for joint in robot.joints])
    return float(max((np.abs(speeds) / speeds_max).max(), (np.abs(accelerations) / accelerations_max).max()))


@pytest.mark.parametrize(("robot_name", "job", "most_s"), JOBS)
def test_each_job_keeps_its_path_and_all_limits_in_less_time(robot_name: str, job: str, most_s: float) -> None:
    robot = load_robot(robot_name)
    motion = make_job(robot, job)
    again = fastest_again(robot, motion)
    lengths, steps = at_lengths(robot, motion)
    new_lengths, new_steps = at_lengths(robot, again)
    assert new_lengths[-1] == pytest.approx(lengths[-1], abs=0.01 + 1e-5 * lengths[-1])
    on_the_way = new_lengths * (lengths[-1] / new_lengths[-1])
    same = np.column_stack([np.interp(on_the_way, lengths, column) for column in steps.T])
    assert np.abs(new_steps - same).max() < 0.1
    assert use(robot, again) <= 1.0 + 1e-4  # differences of positions lose some digits
    assert again.duration_s <= most_s < 0.9 * motion.duration_s
    plan(robot, again)


def test_a_tools_path_keeps_its_highest_speed() -> None:
    motion, again = (make_job(WAREHOUSE, "pull-line", options) for options in ({}, {"law": "fastest"}))
    kinematics = make_kinematics(WAREHOUSE)
    speeds = []
    for each in (motion, again):
        tool = kinematics.forward(each.positions(np.arange(0.0, each.duration_s, 1e-3)))[:, :3]
        speeds.append(float(np.linalg.norm(np.diff(tool, axis=0), axis=1).max() / 1e-3))
    assert speeds[1] == pytest.approx(speeds[0], rel=5e-3)


def test_outputs_and_waits_keep_their_place_in_the_pauses() -> None:
    motion = make_job(WAREHOUSE, "fetch")
    again = fastest_again(WAREHOUSE, motion)
    assert [(each.output, each.on) for each in again.output_changes] == [
        (each.output, each.on) for each in motion.output_changes
    ]
    assert len(again.waits) == len(motion.waits)
    for before, after in zip(motion.output_changes, again.output_changes, strict=True):
        assert after.until_s - after.from_s == pytest.approx(before.until_s - before.from_s)
        places = [each.positions(np.array([at.from_s]))[0] for each, at in ((motion, before), (again, after))]
        assert places[0] == pytest.approx(places[1], abs=1e-9)


def test_an_output_on_the_way_is_refused() -> None:
    motion = make_job(WAREHOUSE, "drawer-pull")
    moving = replace(motion, output_changes=(replace(motion.output_changes[0], on_the_way=True),))
    complaint_of(lambda: fastest_again(WAREHOUSE, moving))


def turning_back(pause_s: float) -> Motion:
    """Return a motion of th1 to a place and back in its own time, with a pause there that is one of the points."""
    names, there, back = LAB.joint_names, np.array([30.0, 20, 10, 0]), np.array([0.0, 20, 10, 0])
    out, home = (
        c2_spline(names, np.array([0.0, 1.0, 2.0]), np.array(places))
        for places in ([back, (there + back) / 2, there], [there, (there + back) / 2, back])
    )
    if not pause_s:
        return c2_spline(names, np.array([0.0, 2.0, 4.0]), np.array([back, there, back]))
    pause = standstill(names, tuple(there.tolist()), pause_s)
    return sequence(names, [out, pause, home])


@pytest.mark.parametrize("pause_s", [0.0, 0.7])
def test_stops_where_the_joints_turn_back_and_keeps_pauses(pause_s: float) -> None:
    again = fastest_again(LAB, turning_back(pause_s))
    assert len(law_of(again, Sequence).parts) == (3 if pause_s else 2)
    turns_s = law_of(again, Sequence).starts_ms[1] / 1000
    assert again.velocities(np.array([turns_s]))[0] == pytest.approx(0.0, abs=1e-9)
    assert again.positions(np.array([turns_s]))[0] == pytest.approx([30.0, 20, 10, 0], abs=1e-6)
    joint = LAB.joints[0]  # 30 deg from rest to rest take at least this
    least_s = 30 / joint.speed_max + joint.speed_max / joint.acceleration_max
    least_s = least_s if joint.speed_max**2 / joint.acceleration_max < 30 else 2 * (30 / joint.acceleration_max) ** 0.5
    assert 2 * least_s <= again.duration_s - pause_s <= 2 * least_s + 0.2


def test_a_motion_that_begins_at_speed_begins_at_rest() -> None:
    """A file's points with velocities at both ends: the new motion goes along them from rest to rest."""
    places, speeds = np.array([[0.0, 20, 10, 0], [20, 40, 10, 0]]), np.array([[20.0, 20, 0, 0], [20, 20, 0, 0]])
    again = fastest_again(LAB, hermite_spline(LAB.joint_names, np.array([0.0, 1.0]), places, speeds))
    assert plan(LAB, again).start_joints == pytest.approx(places[0])
    assert again.duration_s < 1.0
