"""A motor's pull-out torque: the load beyond which it slips at a steady speed.

At a steady speed the field runs ahead of the rotor by the load angle. The phase currents of one electrical turn follow
from the averaged chopper (`rotor_kernel`); their mean torque depends on the load angle, and its maximum is the pull-out
torque. An array holds all load angles and speeds at once.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.motors.motor import RAD_S_PER_RPM, Motor

_LOAD_ANGLES: Final = np.linspace(0.0, np.pi, 41)
"""From no load to the far side of the maximum, which the currents' lag at high speed pushes beyond a quarter turn."""
_SETTLING_TURNS: Final = 8
"""Electrical turns after which the currents repeat."""
_PARTS: Final = 128
"""Steps of integration in an electrical turn."""


@dataclass(frozen=True, slots=True)
class DriveSupply:
    """What drives a motor: supply, the current's amplitude, decay, and the bridge with its sense resistor."""

    volt: float
    current_a: float
    fast_decay: float
    bridge_ohm: float


def pull_out_nm(motor: Motor, supply: DriveSupply, rpm: FloatArray) -> FloatArray:
    """Return the pull-out torque at speeds in turns a minute, of any shape; not below 0.

    The currents' references are sines, as those of small microsteps are.
    """
    rad_s = np.maximum(np.ravel(np.asarray(rpm, dtype=np.float64)), 1e-3) * RAD_S_PER_RPM
    torque = _mean_torques(motor, supply, rad_s).max(axis=1) - motor.drag_nm_s * rad_s
    return np.asarray(np.maximum(torque, 0.0).reshape(np.shape(rpm)), dtype=np.float64)


def _mean_torques(motor: Motor, supply: DriveSupply, rad_s: FloatArray) -> FloatArray:
    """Return the mean torque over one electrical turn, shape (speeds, load angles).

    Phase B does a quarter of a turn later what phase A does, and each half of a turn mirrors the other: half a turn of
    phase A is enough.
    """
    dt_s = 2.0 * np.pi / (motor.teeth * rad_s[:, None] * _PARTS)
    resistance, km = motor.resistance_ohm + supply.bridge_ohm, motor.torque_constant_nm_a
    fall = np.exp(-resistance * dt_s / motor.inductance_h)
    gain, mean_part = resistance / (1.0 - fall), (1.0 - fall) * motor.inductance_h / (resistance * dt_s)
    current = np.zeros((rad_s.size, _LOAD_ANGLES.size))
    total = np.zeros(current.shape)
    last = _SETTLING_TURNS * _PARTS
    for part in range(last):
        angle = 2.0 * np.pi * part / _PARTS
        shape = -np.sin(angle)
        wanted, emf = supply.current_a * np.cos(angle + _LOAD_ANGLES), km * rad_s[:, None] * shape
        ahead = np.where(wanted != 0.0, wanted, current) >= 0.0
        volts = (wanted - fall * current) * gain + emf
        low, high = np.where(ahead, -supply.fast_decay, -1.0), np.where(ahead, 1.0, supply.fast_decay)
        final = (np.minimum(np.maximum(volts, low * supply.volt), high * supply.volt) - emf) / resistance
        apart = current - final
        current = final + apart * fall
        if part >= last - _PARTS // 2:
            total += (km * shape) * (final + apart * mean_part)
    return np.asarray(4.0 * total / _PARTS)
