"""The masses of a six-axis arm: weights and inertias at its rotors, against potential and kinetic energy.

The oracle multiplies the maker's DH rows out by itself and differentiates the energies numerically (Lagrange).
"""

from typing import Final

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.emulator.motors.torques import carried_torque_nm
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.motor import JointLink
from steptwin.host.studies.motors.fitting import fits_of
from steptwin.host.twin.motors.mechanism import arm_of, joints_by_rotor
from steptwin.host.twin.motors.poses import carried_inertias, rotors_of
from tests.host.robots.kinematics.serial.arms import AR4_ROWS, random_joints

AR4 = load_robot("ar4-mk3")
PAYLOAD_KG: Final = 0.5
GRAVITY_M_S2: Final = 9.80665
STEP_RAD: Final = 1e-5
POSES: Final = random_joints(AR4, 6)


def links() -> list[JointLink]:
    found = [joint.link for joint in AR4.joints if joint.link is not None]
    assert len(found) == 6
    return found


def frames(joints_deg: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Place in m and rotation of each joint's frame: modified DH, the x screw before the z screw."""
    place, turned = np.zeros(3), np.eye(3)
    found = []
    for (theta_deg, alpha_deg, d_mm, a_mm), angle_deg in zip(AR4_ROWS, joints_deg, strict=True):
        place = place + turned @ [1e-3 * a_mm, 0.0, 0.0]
        turned = turned @ Rotation.from_euler("x", alpha_deg, degrees=True).as_matrix()
        place = place + turned @ [0.0, 0.0, 1e-3 * d_mm]
        turned = turned @ Rotation.from_euler("z", theta_deg + angle_deg, degrees=True).as_matrix()
        found.append((place, turned))
    return found


def centres_m(joints_deg: FloatArray) -> FloatArray:
    """The links' centres of mass and the payload, which hangs at the flange: shape (7, 3)."""
    at = frames(joints_deg)
    own = [p + r @ (1e-3 * np.array(link.centre_mm)) for (p, r), link in zip(at, links(), strict=True)]
    return np.array([*own, at[-1][0]])


MASSES_KG: Final = np.array([*(link.mass_kg for link in links()), PAYLOAD_KG])


def steps_deg() -> FloatArray:
    return np.asarray(np.rad2deg(STEP_RAD) * np.eye(6))


def weights_nm(joints_deg: FloatArray) -> FloatArray:
    """The derivatives of the potential energy by the joints."""

    def potential_j(at_deg: FloatArray) -> float:
        return float(GRAVITY_M_S2 * MASSES_KG @ centres_m(at_deg)[:, 2])

    return np.array([(potential_j(joints_deg + s) - potential_j(joints_deg - s)) / (2 * STEP_RAD) for s in steps_deg()])


def mass_matrix_kgm2(joints_deg: FloatArray) -> FloatArray:
    """Second derivatives of the kinetic energy by the joints' rates: of moving points and turning bodies."""
    matrix = np.zeros((6, 6))
    sides = [(joints_deg + s, joints_deg - s) for s in steps_deg()]
    moves = np.array([(centres_m(up) - centres_m(down)) / (2 * STEP_RAD) for up, down in sides])
    matrix += np.einsum("iak,jak,a->ij", moves, moves, MASSES_KG)
    here, around = frames(joints_deg), [(frames(up), frames(down)) for up, down in sides]
    for body, link in enumerate(links()):
        turned = here[body][1]
        spins = np.array(
            [
                turned.T @ Rotation.from_matrix(up[body][1] @ down[body][1].T).as_rotvec() / (2 * STEP_RAD)
                for up, down in around
            ]
        )
        matrix += spins @ np.diag(link.inertia_kgm2) @ spins.T
    return matrix


@pytest.mark.parametrize("joints_deg", [*POSES, np.array(AR4.home)], ids=str)
def test_weights_and_masses_at_the_rotors(joints_deg: FloatArray) -> None:
    arm, rows = arm_of(AR4, PAYLOAD_KG), joints_deg[np.newaxis]
    rad_by_rotor = np.deg2rad(joints_by_rotor(AR4))
    still = np.zeros((1, 6))
    weights = carried_torque_nm(arm, rotors_of(AR4, rows), still, still)[0]
    assert weights == pytest.approx(rad_by_rotor.T @ weights_nm(joints_deg), abs=1e-8)
    inertias = carried_inertias(AR4, arm, rows)[0]
    expected = rad_by_rotor.T @ mass_matrix_kgm2(joints_deg) @ rad_by_rotor
    assert inertias == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_its_motors_do_at_the_limits_of_its_joints() -> None:
    """More than half of J2's torque is left where it lifts the stretched arm; each driver has its own current."""
    margins = {fit.name: round(100 * fit.own.margin) for fit in fits_of(AR4, others=())}
    assert margins == pytest.approx({"J1": 95, "J2": 54, "J3": 70, "J4": 93, "J5": 87, "J6": 96}, abs=1)
    assert [fit.own.current_a for fit in fits_of(AR4, others=())] == [2.37, 2.84, 2.37, 1.0, 2.37, 1.46]
