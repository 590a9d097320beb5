"""The masses of six-axis arms: weights and inertias at their rotors, against potential and kinetic energy.

The oracle multiplies the makers' rows out by itself and differentiates the energies numerically (Lagrange).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.features.motors.rotors.torques import carried_torque_nm
from steptwin.features.motors.sizing.fitting import fits_of
from steptwin.features.motors.turning.mechanism import arm_of, joints_by_rotor
from steptwin.features.motors.turning.poses import carried_inertias, rotors_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.motor import JointLink
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import AR4_ROWS, PAROL6_ROWS, random_joints

GRAVITY_M_S2: Final = 9.80665
STEP_RAD: Final = 1e-5

Frame = tuple[FloatArray, FloatArray]
"""Place in m and rotation: of a joint's axis, x towards the next joint."""


def _of_modified_rows(joints_deg: FloatArray) -> list[Frame]:
    """The AR4's frames, and the flange: the x screw before the z screw."""
    place, turned = np.zeros(3), np.eye(3)
    found = []
    for (theta_deg, alpha_deg, d_mm, a_mm), angle_deg in zip(AR4_ROWS, joints_deg, strict=True):
        place = place + turned @ [1e-3 * a_mm, 0.0, 0.0]
        turned = turned @ Rotation.from_euler("x", alpha_deg, degrees=True).as_matrix()
        place = place + turned @ [0.0, 0.0, 1e-3 * d_mm]
        turned = turned @ Rotation.from_euler("z", theta_deg + angle_deg, degrees=True).as_matrix()
        found.append((place, turned))
    return [*found, found[-1]]


def _of_standard_rows(joints_deg: FloatArray) -> list[Frame]:
    """The PAROL6's frames, and the gripper's tip: the z screw before the x screw."""
    place, turned = np.zeros(3), np.eye(3)
    found = []
    for (theta_deg, alpha_deg, d_mm, a_mm), angle_deg in zip(PAROL6_ROWS, joints_deg, strict=True):
        place = place + turned @ [0.0, 0.0, 1e-3 * d_mm]
        turned = turned @ Rotation.from_euler("z", theta_deg + angle_deg, degrees=True).as_matrix()
        found.append((place, turned))
        place = place + turned @ [1e-3 * a_mm, 0.0, 0.0]
        turned = turned @ Rotation.from_euler("x", alpha_deg, degrees=True).as_matrix()
    return [*found, (place, turned)]


UPRIGHT: Final = (
    (202.0, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    (202.0, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    (362.0, (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)),
    (556.0, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    (556.0, (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)),
    (612.5, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
)
"""The Thor upright: height of each frame in mm, its x and its z."""


def _of_upright(joints_deg: FloatArray) -> list[Frame]:
    """The Thor's frames, and the gripper's base: each turned about its own axis by all joints up to it."""
    found: list[Frame] = []
    so_far, at, below_mm = np.eye(3), np.zeros(3), 0.0
    for (height_mm, x, z), angle_deg in zip(UPRIGHT, joints_deg, strict=True):
        at = at + so_far @ [0.0, 0.0, 1e-3 * (height_mm - below_mm)]
        so_far = so_far @ Rotation.from_rotvec(angle_deg * np.array(z), degrees=True).as_matrix()
        found.append((at, so_far @ np.column_stack([x, np.cross(z, x), z])))
        below_mm = height_mm
    return [*found, found[-1]]


FRAMES: Final[dict[str, Callable[[FloatArray], list[Frame]]]] = {
    "ar4-mk3": _of_modified_rows,
    "parol6": _of_standard_rows,
    "thor": _of_upright,
}
ARMS: Final = {name: load_robot(name) for name in FRAMES}
POSES: Final = [
    (name, pose) for name, robot in ARMS.items() for pose in (*random_joints(robot, 6), np.array(robot.home))
]


def links(robot: Robot) -> list[JointLink]:
    found = [joint.link for joint in robot.joints if joint.link is not None]
    assert len(found) == 6
    return found


def payload_kg(robot: Robot) -> float:
    assert robot.dynamics is not None
    return robot.dynamics.payload_kg


def masses_kg(robot: Robot) -> FloatArray:
    return np.array([*(link.mass_kg for link in links(robot)), payload_kg(robot)])


def centres_m(name: str, joints_deg: FloatArray) -> FloatArray:
    """The links' centres of mass and the payload, which hangs at the tip: shape (7, 3)."""
    *at, (tip, _) = FRAMES[name](joints_deg)
    own = [p + r @ (1e-3 * np.array(link.centre_mm)) for (p, r), link in zip(at, links(ARMS[name]), strict=True)]
    return np.array([*own, tip])


def steps_deg() -> FloatArray:
    return np.asarray(np.rad2deg(STEP_RAD) * np.eye(6))


def weights_nm(name: str, joints_deg: FloatArray) -> FloatArray:
    """The derivatives of the potential energy by the joints."""

    def potential_j(at_deg: FloatArray) -> float:
        return float(GRAVITY_M_S2 * masses_kg(ARMS[name]) @ centres_m(name, at_deg)[:, 2])

    return np.array([(potential_j(joints_deg + s) - potential_j(joints_deg - s)) / (2 * STEP_RAD) for s in steps_deg()])


def mass_matrix_kgm2(name: str, joints_deg: FloatArray) -> FloatArray:
    """Second derivatives of the kinetic energy by the joints' rates: of moving points and turning bodies."""
    sides = [(joints_deg + s, joints_deg - s) for s in steps_deg()]
    moves = np.array([(centres_m(name, up) - centres_m(name, down)) / (2 * STEP_RAD) for up, down in sides])
    matrix = np.einsum("iak,jak,a->ij", moves, moves, masses_kg(ARMS[name]))
    here, around = FRAMES[name](joints_deg), [(FRAMES[name](up), FRAMES[name](down)) for up, down in sides]
    for body, link in enumerate(links(ARMS[name])):
        turned = here[body][1]
        spins = np.array(
            [
                turned.T @ Rotation.from_matrix(up[body][1] @ down[body][1].T).as_rotvec() / (2 * STEP_RAD)
                for up, down in around
            ]
        )
        matrix += spins @ np.diag(link.inertia_kgm2) @ spins.T
    return np.asarray(matrix)


@pytest.mark.parametrize(("name", "joints_deg"), POSES, ids=str)
def test_weights_and_masses_at_the_rotors(name: str, joints_deg: FloatArray) -> None:
    robot, rows = ARMS[name], joints_deg[np.newaxis]
    arm = arm_of(robot, payload_kg(robot))
    rad_by_rotor = np.deg2rad(joints_by_rotor(robot))
    still = np.zeros((1, len(robot.axes)))
    weights = carried_torque_nm(arm, rotors_of(robot, rows), still, still)[0]
    assert weights == pytest.approx(rad_by_rotor.T @ weights_nm(name, joints_deg), abs=1e-8)
    inertias = carried_inertias(robot, arm, rows)[0]
    expected = rad_by_rotor.T @ mass_matrix_kgm2(name, joints_deg) @ rad_by_rotor
    assert inertias == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "margins", "currents_a"),
    [
        pytest.param(
            "ar4-mk3",
            {"J1": 95, "J2": 54, "J3": 70, "J4": 93, "J5": 87, "J6": 96},
            [2.37, 2.84, 2.37, 1.0, 2.37, 1.46],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "parol6",
            {"J1": 36, "J2": -2, "J3": 22, "J4": 68, "J5": 61, "J6": 73},
            [2.404, 2.404, 2.284, 2.044, 2.044, 1.16],
            marks=pytest.mark.slow,
        ),
        ("thor", {"J1": 59, "J2": 37, "J3": 44, "J4": 39, "J5": 54, "J6": 55}, [1.0, 0.57, 0.57, 0.57, 0.57, 0.57]),
    ],
)
def test_what_is_left_at_the_limits_of_its_joints(name: str, margins: dict[str, int], currents_a: list[float]) -> None:
    """The PAROL6's shoulder has not enough at its highest speed and acceleration at once; each driver has its own
    current.
    """
    fits = fits_of(ARMS[name], others=())
    assert {fit.name: round(100 * fit.own.margin) for fit in fits} == pytest.approx(margins, abs=1)
    assert [fit.own.current_a for fit in fits] == currents_a


@pytest.mark.slow
def test_the_thor_lifts_750_g_stretched_out_as_its_maker_says() -> None:
    """His FAQ: the whole arm level, with the tool, of which 0.6 kg hang at the gripper; his board has 12 V."""
    robot = ARMS["thor"]
    assert robot.dynamics is not None
    level, still = np.array([[0.0, -90.0, 0.0, 0.0, 0.0, 0.0]]), np.zeros((1, len(robot.axes)))
    carried_nm = np.abs(carried_torque_nm(arm_of(robot, 0.6), rotors_of(robot, level), still, still)[0])
    at_12_v = fits_of(replace(robot, dynamics=replace(robot.dynamics, supply_v=12.0)), others=())
    left = {}
    for joint, fit, torque_nm in zip(robot.joints, at_12_v, carried_nm, strict=False):
        assert joint.motor is not None
        needed_nm = torque_nm / joint.motor.efficiency + joint.motor.friction_nm
        left[fit.name] = round(100.0 * (1.0 - needed_nm / fit.pull_out_nm[0]))
    assert left == pytest.approx({"J1": 93, "J2": 11, "J3": 18, "J4": 92, "J5": 21, "J6": 19}, abs=2)
