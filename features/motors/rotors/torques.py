"""Torques at a steady speed and along a motion: the pull-out torque of a motor, and the torque that a motion needs.

The pull-out torque is the load beyond which a motor slips. At a steady speed the field leads the rotor by the load
angle. The phase currents of one electrical turn follow from the averaged chopper (`rotor_kernel`). Their mean torque
depends on the load angle, and its maximum is the pull-out torque. One array holds all load angles and speeds. The
torque that a motion needs assumes that every rotor keeps step.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.emulator.board.edges import FloatArray
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.mechanics import GRAVITY_M_S2, MotionArrays
from steptwin.features.motors.rotors.motor import RAD_S_PER_RPM, Motor
from steptwin.features.motors.rotors.rotor_backend import (
    Numbers,
    RotorBackend,
    arm_arrays,
    fastest_rotors,
    joint_arrays,
)
from steptwin.features.motors.rotors.rotor_kernel import STATE_FIELDS
from steptwin.features.motors.rotors.rotors import Drive

_LOAD_ANGLES: Final = np.linspace(0.0, np.pi, 41)
"""From no load to beyond the maximum; at high speed lagging currents put the maximum beyond a quarter turn."""
_SETTLING_TURNS: Final = 8
"""Electrical turns after which the currents repeat."""
_PARTS: Final = 128
"""Steps of integration in an electrical turn."""


def needed_torque_nm(
    drives: Sequence[Drive], arm: Arm, rad: FloatArray, rad_s: FloatArray, rad_s2: FloatArray,
    backend: RotorBackend | None = None,
) -> FloatArray:  # fmt: skip
    """Return the torque at each rotor, with friction. The iron's drag is left out, as in pull-out torques.

    Args:
        drives: of each axis.
        arm: what they turn.
        rad: rotors' angles, shape (n, axes).
        rad_s: speeds, shape (n, axes).
        rad_s2: accelerations, shape (n, axes).
        backend: by default the fastest.
    """
    carried = carried_torque_nm(arm, rad, rad_s, rad_s2, backend)
    columns = [
        rotor_torque_nm(drive, carried[:, axis], rad_s[:, axis], rad_s2[:, axis]) for axis, drive in enumerate(drives)
    ]
    return np.column_stack(columns)


def rotor_torque_nm(drive: Drive, carried: FloatArray, rad_s: FloatArray, rad_s2: FloatArray) -> FloatArray:
    """Return one motor's torque, shape (n,), for the gear's load `carried`; at rest friction helps to hold."""
    rubbing = drive.friction_nm + (1.0 / drive.efficiency - 1.0) * np.abs(carried)
    driving = carried + drive.motor.rotor_inertia_kgm2 * rad_s2
    held = np.sign(driving) * np.maximum(np.abs(driving) - rubbing, 0.0)
    return np.asarray(np.where(rad_s == 0.0, held, driving + rubbing * np.sign(rad_s)), dtype=np.float64)


def carried_torque_nm(
    arm: Arm, rad: FloatArray, rad_s: FloatArray, rad_s2: FloatArray, backend: RotorBackend | None = None,
    gravity_m_s2: float = GRAVITY_M_S2,
) -> FloatArray:  # fmt: skip
    """Return the torque that the arm alone needs at each rotor, shape (n, axes): weights and inertia."""
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


@dataclass(frozen=True, slots=True)
class DriveSupply:
    """Supply of a motor: voltage, current amplitude, decay, and the bridge with its sense resistor."""

    volt: float
    current_a: float
    fast_decay: float
    bridge_ohm: float


def pull_out_nm(motor: Motor, supply: DriveSupply, rpm: FloatArray) -> FloatArray:
    """Return the pull-out torque at speeds in turns a minute, of any shape; not below 0.

    The current references are sines, as those of small microsteps are.
    """
    speeds = np.ravel(np.asarray(rpm, dtype=np.float64))
    return np.asarray(pull_outs_nm([(motor, supply)], speeds[None, :])[0].reshape(np.shape(rpm)), dtype=np.float64)


def pull_outs_nm(kinds: Sequence[tuple[Motor, DriveSupply]], rpm: FloatArray) -> FloatArray:
    """Return the pull-out torques of several motors, each at its own speeds.

    Args:
        kinds: motors with their supplies.
        rpm: speeds in turns a minute, shape (kinds, speeds).

    Returns:
        Torques as `pull_out_nm` gives them, shape (kinds, speeds).
    """
    rad_s = np.maximum(rpm, 1e-3) * RAD_S_PER_RPM
    rows = [kind for kind in kinds for _ in range(rad_s.shape[1])]
    torque = _mean_torques(rows, rad_s.ravel()).max(axis=1).reshape(rad_s.shape)
    torque -= np.array([[motor.drag_nm_s] for motor, _ in kinds]) * rad_s
    return np.asarray(np.maximum(torque, 0.0), dtype=np.float64)


def _mean_torques(rows: Sequence[tuple[Motor, DriveSupply]], rad_s: FloatArray) -> FloatArray:
    """Return the mean torque of each row's motor over one electrical turn, shape (rows, load angles).

    Phase B follows phase A by a quarter turn, and the second half of a turn mirrors the first: half a turn of phase A
    is enough.
    """
    motors, supplies = zip(*rows, strict=True)
    teeth = _column(motor.teeth for motor in motors)
    inductance = _column(motor.inductance_h for motor in motors)
    km = _column(motor.torque_constant_nm_a for motor in motors)
    resistance = _column(motor.resistance_ohm + supply.bridge_ohm for motor, supply in rows)
    amplitude = _column(supply.current_a for supply in supplies)
    slow_volt = _column(supply.fast_decay * supply.volt for supply in supplies)
    volt = _column(supply.volt for supply in supplies)
    dt_s = 2.0 * np.pi / (teeth * rad_s[:, None] * _PARTS)
    fall = np.exp(-resistance * dt_s / inductance)
    gain, mean_part = resistance / (1.0 - fall), (1.0 - fall) * inductance / (resistance * dt_s)
    back_volt = km * rad_s[:, None]
    current = np.zeros((rad_s.size, _LOAD_ANGLES.size))
    total = np.zeros(current.shape)
    last = _SETTLING_TURNS * _PARTS
    for part in range(last):
        angle = 2.0 * np.pi * part / _PARTS
        shape = -np.sin(angle)
        wanted, emf = amplitude * np.cos(angle + _LOAD_ANGLES), back_volt * shape
        ahead = np.where(wanted != 0.0, wanted, current) >= 0.0
        volts = (wanted - fall * current) * gain + emf
        low, high = np.where(ahead, -slow_volt, -volt), np.where(ahead, volt, slow_volt)
        final = (np.minimum(np.maximum(volts, low), high) - emf) / resistance
        apart = current - final
        current = final + apart * fall
        if part >= last - _PARTS // 2:
            total += (km * shape) * (final + apart * mean_part)
    return np.asarray(4.0 * total / _PARTS)


def _column(values: Iterable[float]) -> FloatArray:
    return np.array([[value] for value in values], dtype=np.float64)
