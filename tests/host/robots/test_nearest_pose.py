"""The pose that passes in place of one out of reach: it does pass, and one nearer to the wish does not."""

from functools import cache

import numpy as np
import pytest

from steptwin.host.robots import MACHINES, load_robot, read_robot, robot_names
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.poses import Pose
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.nearest_pose import nearest_pose, passing_text, passing_words

NAN = float("nan")
NEARER_MM = 0.3
"""A pose this much nearer to the wish does not pass: poses are said in tenths, and searched in fiftieths."""


@cache
def arm(name: str) -> Robot:
    if name in robot_names():
        return load_robot(name)
    options = dict(zip(("lift", "tool_rotation"), name.split(), strict=True))
    return read_robot(robot_text("arm", "scara", *with_settings("scara", options)))


def reached(kinematics: Kinematics, pose: Pose, near: np.ndarray, *, on_path: bool = False) -> bool:
    branches = kinematics.inverse(np.array([pose]), near)
    clear = [all(measure.kept[0] for measure in kinematics.singularities(branch.joints)) for branch in branches]
    return any(branch.reachable[0] and (free or not on_path) for branch, free in zip(branches, clear, strict=True))


@pytest.mark.parametrize(
    ("name", "pose", "words"),
    [
        pytest.param("teaching-scara", (300, 0, -60, 0), "x 195 mm", id="stretched"),
        pytest.param("teaching-scara", (180, 180, -60, 0), "x 137.8, y 137.8 mm", id="stretched, at 45 degrees"),
        pytest.param("teaching-scara", (30, 40, -60, 0), "x 30.4, y 40.6 mm", id="folded, at 50.7 mm"),
        pytest.param("teaching-scara", (150, 60, -160, 30), "z -100 mm", id="too low"),
        pytest.param("teaching-scara", (150, 60, 0, 30), "z -40 mm", id="too high"),
        pytest.param("teaching-scara", (300, 0, 0, 0), "x 195, z -40 mm", id="too far and too high"),
        pytest.param("warehouse-scara", (440, 0, 100, 0), "x 390 mm", id="with a tool beside the axis"),
        pytest.param("calibration-scara", (700, 0, 50, 0), "x 600, z 100 mm", id="lift downwards"),
        pytest.param("lab-scara", (0, 900, 0, 0), "y 800 mm", id="heading for +y"),
        pytest.param("hybrid-arm", (600, 0, 600, 0), "x 550 mm", id="slides' stroke"),
        pytest.param("hybrid-arm", (400, 0, 1000, 0), "z 846.2 mm", id="sliders at their ends"),
        pytest.param("hybrid-arm", (-400, 0, 600, 0), None, id="behind the waist"),
        pytest.param("none false", (400, 0, 0, NAN), "x 350 mm", id="neither lift nor wrist"),
        pytest.param("none true", (300, 0, 50, 0), "z 0 mm", id="no lift"),
        pytest.param("last false", (400, 0, 90, NAN), None, id="no wrist"),
    ],
)
@pytest.mark.parametrize("on_path", [False, True])
def test_both_sides(name: str, pose: Pose, words: str | None, on_path: bool) -> None:
    robot = arm(name)
    kinematics, near = make_kinematics(robot), np.array(robot.home)
    assert not reached(kinematics, pose, near)
    passing = nearest_pose(robot, pose, near, on_path=on_path)
    assert passing is not None
    assert reached(kinematics, passing, near, on_path=on_path)
    assert words is None or on_path or passing_words(kinematics.task, pose, passing) == words
    way = np.nan_to_num(np.subtract(pose, passing))
    for axes in ((0, 1), (2,), (3,)):
        step = np.where(np.isin(range(4), axes), way, 0.0)
        if length := float(np.linalg.norm(step)):
            nearer = np.array(passing) + step / length * min(NEARER_MM, length)
            assert not reached(kinematics, (*nearer.tolist(),), near, on_path=on_path), (passing, nearer)


@pytest.mark.slow
def test_a_pose_at_random_and_the_one_that_passes() -> None:
    """Far away, below, behind, within: whatever is wished, the pose named is in reach on the branch asked for.

    A machine's six axes may reach no place at all in the orientation that is wished.
    """
    random = np.random.default_rng(5)
    for name in [name for name in robot_names() if name not in MACHINES]:
        robot = arm(name)
        kinematics, near = make_kinematics(robot), np.array(robot.home)
        for wish in random.uniform((-900, -900, -500, -180), (900, 900, 900, 180), (12, 4)).round(1).tolist():
            branch = kinematics.branches[0]
            passing = nearest_pose(robot, (*wish,), near, branch)
            assert passing is not None
            assert kinematics.solve(np.array([passing]), branch, near).reachable[0]


@pytest.mark.slow
def test_a_branch_that_reaches_nothing_has_no_such_pose() -> None:
    robot = arm("hybrid-arm")
    assert passing_text(robot, (600.0, 0.0, 600.0, 0.0), np.array(robot.home), "(-,-)") == ""
