"""The torque that a motion needs of each motor if every rotor keeps step."""

from collections.abc import Sequence

import numpy as np

from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.motors.arm import Arm
from steptwin.emulator.motors.mechanics import GRAVITY_M_S2, MotionArrays
from steptwin.emulator.motors.rotor_backend import Numbers, RotorBackend, arm_arrays, fastest_rotors, joint_arrays
from steptwin.emulator.motors.rotor_kernel import STATE_FIELDS
from steptwin.emulator.motors.rotors import Drive


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
    (instants, axes), count = rad.shape, len(arm.bodies)

    def zeros(length: int) -> Numbers:
        return backend.numbers([0.0] * length)

    angles, speeds, accelerations = (backend.rows(values) for values in (rad, rad_s, rad_s2))
    asked = MotionArrays(angles, speeds, accelerations, zeros(rad.size))
    backend.need(
        arm_arrays(arm, backend, gravity_m_s2), joint_arrays(arm, backend), zeros(axes * STATE_FIELDS), zeros(count),
        zeros(count), asked,
    )  # fmt: skip
    return np.array(asked.torques, dtype=np.float64).reshape(instants, axes)
