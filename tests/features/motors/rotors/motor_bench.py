"""A test bench for one motor: a wheel or a weight on its shaft, and a field that the test turns."""

from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np

from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.features.motors.rotors.arm import BASE, Arm, Body
from steptwin.features.motors.rotors.mechanics import GRAVITY_M_S2
from steptwin.features.motors.rotors.motor import CATALOGUE, Motor
from steptwin.features.motors.rotors.rotor_backend import RotorBackend
from steptwin.features.motors.rotors.rotor_kernel import DT_COUNTS, DT_S
from steptwin.features.motors.rotors.rotors import Drive, DriverEvents, RotorRecord, Rotors

MOTOR = CATALOGUE["17HS19-2004S1"]
IDEAL = replace(MOTOR, detent_torque_nm=0.0, iron_drag_nm_s=0.0, friction_nm=0.0)
"""The same without any loss but that in copper."""
CURRENT_A = 2.0
STIFF_SUPPLY_V = 400.0
"""Supply so high that the currents are what they should be."""


def flywheel(inertia_kgm2: float) -> Arm:
    """Return one wheel on one motor's shaft, as on a test bench."""
    wheel = Body(BASE, False, np.eye(4), 0.0, np.zeros(3), np.diag([0.0, 0.0, inertia_kgm2]))
    return Arm((wheel,), np.eye(1), np.zeros(1))


def weight(load_nm: float, mass_kg: float = 1e3) -> Arm:
    """Return a weight on a string around a pulley, which turns the rotor down by `load_nm`.

    A heavy one on a small pulley adds little inertia.
    """
    metres_per_rad = load_nm / (mass_kg * GRAVITY_M_S2)
    body = Body(BASE, True, np.eye(4), mass_kg, np.zeros(3), np.zeros((3, 3)))
    return Arm((body,), np.array([[metres_per_rad]]), np.zeros(1))


def weight_inertia(load_nm: float, mass_kg: float = 1e3) -> float:
    """Return the inertia that the weight adds to the rotor's."""
    return mass_kg * (load_nm / (mass_kg * GRAVITY_M_S2)) ** 2


def bench(
    drive: Drive, arm: Arm | None = None, *, supply_v: float = STIFF_SUPPLY_V, load_angle: float = 0.0,
    backend: RotorBackend | None = None, supply: PowerSupply | None = None,
) -> Rotors:  # fmt: skip
    """Return a motor at rest, `load_angle` electrical rad behind a field at 0."""
    supply = supply or PowerSupply(supply_v)
    return Rotors([drive], arm or flywheel(0.0), supply, [-load_angle / drive.motor.teeth], backend=backend)


def field(
    angle: Callable[[FloatArray], FloatArray], duration_s: float, *, current_a: float = CURRENT_A, on: float = 1.0,
    fast: float = 1.0, every_s: float = DT_S,
) -> DriverEvents:  # fmt: skip
    """Return a field at angle(t) electrical rad, with sines as currents."""
    steps = np.arange(float(round(duration_s / every_s)))
    turned = angle(np.asarray(steps * every_s)) * np.ones(steps.size)
    counts = np.round(steps * every_s / DT_S).astype(np.int64) * DT_COUNTS
    flags = np.ones(steps.size)
    return DriverEvents(
        counts, turned, current_a * np.cos(turned), current_a * np.sin(turned), fast * flags, on * flags
    )


def standing(*, current_a: float = CURRENT_A, on: float = 1.0, counts: int = 0) -> DriverEvents:
    """Return a field that stands at 0."""
    one = np.ones(1)
    return DriverEvents(np.array([counts], dtype=np.int64), 0.0 * one, current_a * one, 0.0 * one, one, on * one)


def turned(rotors: Rotors, events: DriverEvents, milliseconds: int) -> RotorRecord:
    """Let one motor turn."""
    rotors.feed([events])
    return rotors.advance(milliseconds)


def natural_hz(motor: Motor, inertia_kgm2: float, *, current_a: float = CURRENT_A) -> float:
    """Return the frequency of small oscillations: sqrt(Nr (Km I + 4 Td) / J) / 2 pi."""
    stiffness = motor.torque_constant_nm_a * current_a + 4.0 * motor.detent_torque_nm
    return float(np.sqrt(motor.teeth * stiffness / inertia_kgm2)) / (2.0 * pi)
