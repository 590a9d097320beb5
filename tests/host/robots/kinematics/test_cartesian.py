"""Gantries: any of x, y, z and a rotary c, in the station, with belts that couple two slides, and what is refused."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import read_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot
from tests.messages import refusing

COREXY = "[coupling]\nX = { X = 1.0, Y = 1.0 }\nY = { X = -1.0, Y = 1.0 }\n"
BASE = "[base]\nx_mm = 100.0\ny_mm = 50.0\nz_mm = 20.0\nphi_deg = 30.0\n"


def gantry(axes: str = "XYZ", more: str = "") -> Robot:
    text = robot_text("gantry", "cartesian", *with_settings("cartesian", {"axes": axes}))
    for unit in ("X", "Y", "Z", "C") if "coupling" in more else ():
        head, mark, rest = text.partition(f"[joints.{unit}.homing]")
        text = head + rest[rest.find("\n\n") :] if mark else text
    return read_robot(text + more)


@pytest.mark.parametrize("axes", ["X", "Y", "Z", "XY", "XZ", "ZX", "XYZ", "YXC", "XYZC", "CZYX"])
@pytest.mark.parametrize("base", ["", BASE])
def test_there_and_back(axes: str, base: str) -> None:
    robot = gantry(axes, base)
    kinematics = make_kinematics(robot)
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    joints = np.random.default_rng(1).uniform(lower, upper, (100, len(axes)))
    poses = kinematics.forward(joints)
    assert kinematics.task.name == ("scara" if "C" in axes else "position")
    branch = kinematics.solve(poses, "only", joints)
    assert branch.joints == pytest.approx(joints, abs=1e-9)
    assert branch.reachable.all()
    frames = tool_frames(kinematics, joints)
    assert frames[:, :3, 3] == pytest.approx(poses[:, :3], abs=1e-9)
    if "C" in axes:
        attitude = np.rad2deg(np.arctan2(frames[:, 1, 0], frames[:, 0, 0]))
        assert (attitude - poses[:, 3] + 180.0) % 360.0 - 180.0 == pytest.approx(np.zeros(100), abs=1e-9)
    assert kinematics.links(joints)[-1].points_mm[:, -1] == pytest.approx(poses[:, :3], abs=1e-9)


def test_velocities_are_differences() -> None:
    robot = gantry("XYZC", BASE)
    kinematics = make_kinematics(robot)
    joints, rates = np.array([[10.0, 20.0, 30.0, 40.0]]), np.array([[1.0, -2.0, 3.0, -4.0]])
    tool = (kinematics.forward(joints + 1e-6 * rates) - kinematics.forward(joints)) / 1e-6
    assert kinematics.joint_velocities(joints, tool) == pytest.approx(rates, abs=1e-6)


def test_a_coordinate_without_a_slide() -> None:
    kinematics = make_kinematics(gantry("XZ"))
    branch = kinematics.inverse(np.array([[10.0, 5.0, 20.0]]))[0]
    assert branch.reason(0) == "y 5.0000 mm in the base's frame: the tool has no slide along y, it is at 0 there"


@pytest.mark.parametrize("axes", ["", "XX", "ABC", "C", "xyz"])
def test_axes_that_are_none(axes: str) -> None:
    with refusing(InputError):
        gantry(axes)


PROGRAM = """
[[step]]
go = { X = 50, Y = 60, Z = 10 }
[[step]]
line = { x = 100, y = 40 }
speed_mm_s = 60
[[step]]
circle = { x = 100, y = 60 }
speed_mm_s = 60
"""


@pytest.mark.parametrize("coupling", ["", COREXY])
def test_a_program_keeps_its_path(coupling: str) -> None:
    robot = gantry("XYZ", coupling)
    findings = Findings()
    compiled = compile_program(parse_program(PROGRAM, findings), robot, findings)
    assert findings.messages == []
    assert plan(robot, compiled.motion).peaks
    start_s = compiled.steps[2].from_s
    t_s = np.linspace(start_s, compiled.motion.duration_s, 100)
    tool = make_kinematics(robot).forward(compiled.motion.positions(t_s))
    assert np.hypot(tool[:, 0] - 100.0, tool[:, 1] - 60.0) == pytest.approx(np.full(100, 20.0), abs=1e-9)


def test_both_motors_of_a_corexy_share_every_move() -> None:
    """Along x both belts run alike, along y against each other."""
    robot = gantry("XYZ", COREXY)
    assert robot.coupling.to_axes(np.array([10.0, 0.0, 0.0])).tolist() == [10.0, -10.0, 0.0]
    assert robot.coupling.to_axes(np.array([0.0, 10.0, 0.0])).tolist() == [10.0, 10.0, 0.0]


def test_a_rotation_is_no_coordinate_of_three_slides() -> None:
    findings = Findings()
    line, by = "line = { x = 10, rpy_deg = [0, 0, 0] }", "by = { phi = 5 }"
    text = f"[[step]]\n{line}\nspeed_mm_s = 10\n[[step]]\n{by}\nspeed_mm_s = 1\n"
    compile_program(parse_program(text, findings), gantry(), findings)
    assert findings.messages == [
        "step 1 (line to x 10, rpy_deg 0 0 0): rpy_deg: the tool of this robot can be told x, y and z alone",
        "step 2 (by phi 5): phi: the tool of this robot can be told x, y and z alone",
    ]
