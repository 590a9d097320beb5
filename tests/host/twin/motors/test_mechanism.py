"""The arm that motors turn: where its bodies are, and how fast they move, against the robot's own kinematics."""

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin import load_robot
from steptwin.emulator.arm import BASE, Arm
from steptwin.host.robots import robot_names
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.mechanism import arm_of, joints_by_rotor

Array = NDArray[np.float64]


def joint_places(arm: Arm, rotors: Array) -> Array:
    if arm.follow:
        return arm.follow(rotors, np.zeros(len(rotors))).places
    return arm.offsets + arm.slopes @ rotors


def frames(arm: Arm, rotors: Array) -> list[Array]:
    """Return each body's frame in the world, m."""
    found: list[Array] = []
    for body, place in zip(arm.bodies, joint_places(arm, rotors), strict=True):
        joint = np.eye(4)
        if body.slides:
            joint[2, 3] = place
        else:
            joint[:2, :2] = [[np.cos(place), -np.sin(place)], [np.sin(place), np.cos(place)]]
        found.append((np.eye(4) if body.parent == BASE else found[body.parent]) @ body.fixed @ joint)
    return found


def random_rotors(robot: Robot, seed: int) -> tuple[Array, Array]:
    """Return joint positions within their limits and the rotors' angles there."""
    random = np.random.default_rng(seed)
    home = np.array(robot.home)
    spans = np.array([[joint.lower, joint.upper] for joint in robot.joints])
    joints = home + 0.2 * random.uniform(-1, 1, len(home)) * np.minimum(home - spans[:, 0], spans[:, 1] - home).clip(5)
    return joints, np.linalg.solve(joints_by_rotor(robot), joints)


@pytest.mark.parametrize("name", robot_names())
def test_a_payload_hangs_at_the_tools_tip(name: str) -> None:
    """1e9 kg at the tip put the last body's centre of mass there; the tip is where the kinematics has it."""
    robot = load_robot(name)
    arm = arm_of(robot, 1e9)
    heavy = max(range(len(arm.bodies)), key=lambda index: arm.bodies[index].mass_kg)
    joints, rotors = random_rotors(robot, 1)
    frame = frames(arm, rotors)[heavy]
    tip = frame[:3, :3] @ arm.bodies[heavy].centre_m + frame[:3, 3]
    pose = make_kinematics(robot).forward(joints[np.newaxis])[0]
    np.testing.assert_allclose(1e3 * tip, pose[:3], atol=1e-5)


@pytest.mark.parametrize("name", robot_names())
def test_rates_and_drifts_are_the_derivatives_of_the_joints(name: str) -> None:
    robot = load_robot(name)
    arm = arm_of(robot, 0.0)
    if arm.follow is None:
        return
    _, rotors = random_rotors(robot, 2)
    speeds, step = np.array([3.0, 40.0, -25.0, 2.0]), 1e-5
    here = arm.follow(rotors, speeds)
    before, after = (joint_places(arm, rotors + sign * step * speeds) for sign in (-1, 1))
    np.testing.assert_allclose(here.rates, (after - before) / (2 * step), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        here.drifts, (after - 2 * here.places + before) / step**2, rtol=1e-2, atol=1e-4 * np.abs(here.rates).max()
    )


def test_sliders_of_the_hybrid_arm_are_on_their_screws() -> None:
    """A slider's origin is l2 -/+ h from the waist's axis, at l1 + Z."""
    robot = load_robot("hybrid-arm")
    arm, geometry = arm_of(robot, 0.0), robot.geometry
    joints, rotors = random_rotors(robot, 3)
    for index, name, side in ((4, "Z5", -1), (5, "Z6", 1)):
        origin = 1e3 * frames(arm, rotors)[index][:3, 3]
        height = float(geometry["l1_mm"]) + joints[robot.index_of(name)]
        assert np.hypot(*origin[:2]) == pytest.approx(abs(float(geometry["l2_mm"]) + side * float(geometry["h_mm"])))
        assert origin[2] == pytest.approx(height)
