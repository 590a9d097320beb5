"""The torque that a motion needs of each motor if every rotor keeps step."""

from collections.abc import Sequence

import numpy as np

from steptwin.emulator.arm import Arm
from steptwin.emulator.edges import FloatArray
from steptwin.emulator.mechanics import GRAVITY_M_S2, MOTION_FIELDS
from steptwin.emulator.rotor_backend import RotorBackend, fastest_rotors
from steptwin.emulator.rotors import Drive


def needed_torque_nm(
    drives: Sequence[Drive], arm: Arm, rad: FloatArray, rad_s: FloatArray, rad_s2: FloatArray,
    backend: RotorBackend | None = None,
) -> FloatArray:  # fmt: skip
    """Return the torque at each rotor, with friction, but without the iron's drag, which pull-out torques leave out.

    Args:
        drives: of each axis.
        arm: what they turn.
        rad: rotors' angles, shape (n, axes); likewise their speeds and accelerations.
        rad_s: the speeds.
        rad_s2: the accelerations.
        backend: by default the fastest.
    """
    carried = carried_torque_nm(arm, rad, rad_s, rad_s2, backend)
    columns = [
        rotor_torque_nm(drive, carried[:, axis], rad_s[:, axis], rad_s2[:, axis]) for axis, drive in enumerate(drives)
    ]
    return np.column_stack(columns)


def rotor_torque_nm(drive: Drive, carried: FloatArray, rad_s: FloatArray, rad_s2: FloatArray) -> FloatArray:
    """Return one motor's torque, shape (n,), where its gear carries `carried`; at rest friction helps to hold."""
    rubbing = drive.friction_nm + (1.0 / drive.efficiency - 1.0) * np.abs(carried)
    driving = carried + drive.motor.rotor_inertia_kgm2 * rad_s2
    held = np.sign(driving) * np.maximum(np.abs(driving) - rubbing, 0.0)
    return np.asarray(np.where(rad_s == 0.0, held, driving + rubbing * np.sign(rad_s)), dtype=np.float64)


def carried_torque_nm(
    arm: Arm, rad: FloatArray, rad_s: FloatArray, rad_s2: FloatArray, backend: RotorBackend | None = None,
    gravity_m_s2: float = GRAVITY_M_S2,
) -> FloatArray:  # fmt: skip
    """Return what the arm alone needs at each rotor, shape (n, axes): weights and what its masses' motion takes."""
    backend = backend or fastest_rotors()
    places, rates, accelerations, slopes = _joints(arm, rad, rad_s, rad_s2)
    instants, count = places.shape
    tree = backend.numbers([value for body in arm.bodies for value in body.numbers()])
    own = [backend.numbers([0.0] * count) for _ in range(4)]
    torques = backend.numbers([0.0] * places.size)
    motion = backend.numbers([0.0] * (count * MOTION_FIELDS))
    given = [backend.numbers(values.ravel().tolist()) for values in (places, rates, accelerations)]
    backend.need(tree, motion, *given, *own, torques, count, instants, gravity_m_s2)
    at_joints = np.array(torques, dtype=np.float64).reshape(instants, count)
    return np.asarray(np.einsum("nba,nb->na", slopes, at_joints))


def _joints(
    arm: Arm, rad: FloatArray, rad_s: FloatArray, rad_s2: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the joints' positions, rates and accelerations, (n, bodies), and their slopes, (n, bodies, axes)."""
    if arm.follow is None:
        slopes = np.broadcast_to(arm.slopes, (len(rad), *arm.slopes.shape))
        return arm.offsets + rad @ arm.slopes.T, rad_s @ arm.slopes.T, rad_s2 @ arm.slopes.T, slopes
    followed = [arm.follow(angles, speeds) for angles, speeds in zip(rad, rad_s, strict=True)]
    slopes = np.array([one.slopes for one in followed])
    accelerations = np.einsum("nba,na->nb", slopes, rad_s2) + np.array([one.drifts for one in followed])
    return np.array([one.places for one in followed]), np.array([one.rates for one in followed]), accelerations, slopes
