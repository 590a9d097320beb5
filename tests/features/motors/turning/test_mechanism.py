"""The arm that motors turn: where its bodies are, and how fast they move, against the robot's own kinematics."""

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin import load_robot
from steptwin.features.motors.rotors.arm import BASE, Arm
from steptwin.features.motors.rotors.following import follow
from steptwin.features.motors.rotors.mechanics import GRAVITY_M_S2
from steptwin.features.motors.rotors.rotor_backend import arm_arrays, joint_arrays, python_rotors
from steptwin.features.motors.rotors.rotor_kernel import PLACE, RATE, STATE_FIELDS
from steptwin.features.motors.turning.mechanism import arm_of, joints_by_rotor
from steptwin.host.robots import read_robot, robot_names
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot

Array = NDArray[np.float64]
HYBRID = load_robot("hybrid-arm")


def hybrid_arm() -> Arm:
    return arm_of(HYBRID, 0.0)


def followed(arm: Arm, rotors: Array, speeds: Array) -> tuple[Array, Array, Array, Array]:
    """Return the joints' positions, rates, drifts and slopes where the rotors are."""
    count, axes = arm.slopes.shape
    state, backend = [0.0] * (axes * STATE_FIELDS), python_rotors()
    state[PLACE::STATE_FIELDS], state[RATE::STATE_FIELDS] = rotors.tolist(), speeds.tolist()
    arrays, joints = arm_arrays(arm, backend, GRAVITY_M_S2), joint_arrays(arm, backend)
    follow(arrays, state, joints)
    slopes = np.array(arrays.slopes).reshape(count, axes)
    return np.array(joints.places), np.array(joints.rates), np.array(joints.drifts), slopes


def joint_places(arm: Arm, rotors: Array) -> Array:
    return followed(arm, rotors, np.zeros(len(rotors)))[0]


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
    return joints, np.linalg.lstsq(joints_by_rotor(robot), joints)[0]  # two motors of a joint turn alike


@pytest.mark.parametrize("name", [name for name in robot_names() if make_kinematics(load_robot(name)).task.width])
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


def test_rates_and_drifts_are_the_derivatives_of_the_joints() -> None:
    """Differences of fourth order of the positions, which the kinematics give."""
    arm = hybrid_arm()
    _, rotors = random_rotors(HYBRID, 2)
    speeds, step = np.array([3.0, 40.0, -25.0, 2.0]), 2e-4
    places, rates, drifts, slopes = followed(arm, rotors, speeds)
    far, near = ([joint_places(arm, rotors + sign * steps * step * speeds) for sign in (-1, 1)] for steps in (2, 1))
    first = (8.0 * (near[1] - near[0]) - (far[1] - far[0])) / (12.0 * step)
    second = (16.0 * (near[0] + near[1]) - far[0] - far[1] - 30.0 * places) / (12.0 * step**2)
    np.testing.assert_allclose(rates, first, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(drifts, second, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(slopes @ speeds, rates, rtol=1e-12, atol=1e-15)
    assert np.count_nonzero(np.abs(drifts) > 1e-3) == 2


def test_the_platform_stays_where_slipped_sliders_would_tear_its_links() -> None:
    """Links of 350 mm hold sliders up to 2 sqrt(l^2 - h^2) apart: just before it the platform follows, not beyond."""
    arm, farthest_m = hybrid_arm(), 2e-3 * np.sqrt(350.0**2 - 150.0**2)
    pair, axis = arm.pair, HYBRID.index_of("Z5")
    assert pair
    arrays, stored = arm_arrays(arm, python_rotors(), GRAVITY_M_S2), joint_arrays(arm, python_rotors())
    state = [0.0] * (4 * STATE_FIELDS)

    def platform(apart_m: float) -> list[float]:
        state[axis * STATE_FIELDS + PLACE] = apart_m / arrays.slopes[pair.left * 4 + axis]
        follow(arrays, state, stored)
        return [stored.places[pair.across], stored.places[pair.up], *arrays.slopes]

    usual, last = platform(0.2), platform(farthest_m - 1e-6)
    assert usual != last
    assert np.isfinite(last).all()
    assert platform(farthest_m + 1e-6) == last


def test_sliders_of_the_hybrid_arm_are_on_their_screws() -> None:
    """A slider's origin is l2 -/+ h from the waist's axis, at l1 + Z."""
    robot, arm, geometry = HYBRID, hybrid_arm(), HYBRID.geometry
    joints, rotors = random_rotors(robot, 3)
    for index, name, side in ((4, "Z5", -1), (5, "Z6", 1)):
        origin = 1e3 * frames(arm, rotors)[index][:3, 3]
        height = float(geometry["l1_mm"]) + joints[robot.index_of(name)]
        assert np.hypot(*origin[:2]) == pytest.approx(abs(float(geometry["l2_mm"]) + side * float(geometry["h_mm"])))
        assert origin[2] == pytest.approx(height)


def test_bodies_stand_on_the_base_each_for_itself_of_bare_axes() -> None:
    arm = arm_of(read_robot(robot_text("table", "axes", *with_settings("axes", {}))), 2.0)
    assert [body.parent for body in arm.bodies] == [-1]
    assert arm.bodies[0].mass_kg == 2.0
