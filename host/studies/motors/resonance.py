"""Where a motor resonates: its greatest load angle at steady speeds, in each of the driver's microstep settings."""

from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Final, NamedTuple, Self

import numpy as np

from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.emulator.motors.arm import BASE, Arm, Body
from steptwin.emulator.motors.rotor_kernel import DT_COUNTS, DT_S
from steptwin.emulator.motors.rotors import Drive, DriverEvents, Rotors
from steptwin.host.common.arrays import BoolArray, FloatArray

SETTINGS: Final = (1, 2, 8, 16)
"""Microsteps for each full step that a TB6560 makes."""
_RAMP_MS_MIN: Final = 100
"""Least time that the motor takes to its speed, with a field that turns smoothly and excites nothing."""
_RAMP_TORQUE: Final = 0.3
"""Part of the motor's torque that getting up to speed may take."""
_SETTLING_MS: Final = 80
"""Time at the steady speed before the swing is measured."""
_MEASURED_MS_MIN: Final = 120
_MEASURED_FULL_STEPS: Final = 2.0
"""Full steps for which the swing is measured at least."""
_EVERY_STEPS: Final = 5
"""Steps of integration between two changes of the smooth field."""


@dataclass(frozen=True, slots=True)
class Electrics:
    """What drives the motor: amplitude of the current, fraction of fast decay, supply."""

    current_a: float
    fast_decay: float
    volt: float


@dataclass(frozen=True, slots=True, eq=False)
class ResonanceMap:
    """Load angles at steady speeds.

    Attributes:
        rates_hz: shape (n,), speeds in full steps a second.
        load_deg: shape (settings, n), the greatest load angle, electrical degrees.
        slips: shape (settings, n), whether the motor loses steps there.
    """

    rates_hz: FloatArray
    load_deg: FloatArray
    slips: BoolArray


def resonance_map(drive: Drive, inertia_kgm2: float, electrics: Electrics, rates_hz: FloatArray) -> ResonanceMap:
    """Turn a motor, with a wheel of an inertia on its shaft, at each speed in each setting; nothing stops the wheel."""
    drive = replace(drive, lower_rad=-inf, upper_rad=inf)
    load_deg = np.zeros((len(SETTINGS), len(rates_hz)))
    slips = np.zeros(load_deg.shape, dtype=np.bool_)
    for column, rate_hz in enumerate(rates_hz.tolist()):
        times = _Times.of(drive, inertia_kgm2, electrics, rate_hz)
        for row, microsteps in enumerate(SETTINGS):
            rotors = Rotors([drive], wheel(inertia_kgm2), PowerSupply(electrics.volt), [0.0])
            rotors.feed([_field(rate_hz, microsteps, electrics, times)])
            record = rotors.advance(times.total_ms)
            measured = slice(-times.measured_ms, None)
            load_deg[row, column] = np.rad2deg(np.abs(record.worst_rad[measured, 0]).max())
            slips[row, column] = np.ptp(record.lost_full_steps[measured, 0]) > 0.0
    return ResonanceMap(rates_hz, load_deg, slips)


def wheel(inertia_kgm2: float) -> Arm:
    """Return a wheel on a motor's shaft."""
    body = Body(BASE, False, np.eye(4), 0.0, np.zeros(3), np.diag([0.0, 0.0, inertia_kgm2]))
    return Arm((body,), np.eye(1), np.zeros(1))


class _Times(NamedTuple):
    """The parts of one trial: up to speed, settling, measured."""

    ramp_ms: int
    measured_ms: int

    @classmethod
    def of(cls, drive: Drive, inertia_kgm2: float, electrics: Electrics, rate_hz: float) -> Self:
        """Return times that are long enough for a motor with its wheel, and for a speed."""
        motor = drive.motor
        rad_s = 2.0 * np.pi * rate_hz / motor.full_steps_per_rev
        torque_nm = _RAMP_TORQUE * motor.torque_constant_nm_a * electrics.current_a
        ramp_s = np.pi / 2.0 * rad_s * (motor.rotor_inertia_kgm2 + inertia_kgm2) / torque_nm
        measured_s = _MEASURED_FULL_STEPS / rate_hz
        return cls(max(ceil(1000.0 * ramp_s), _RAMP_MS_MIN), max(ceil(1000.0 * measured_s), _MEASURED_MS_MIN))

    @property
    def total_ms(self) -> int:
        return self.ramp_ms + _SETTLING_MS + self.measured_ms


def _field(rate_hz: float, microsteps: int, electrics: Electrics, times: _Times) -> DriverEvents:
    """Return a field that gets up to speed smoothly and then goes on in microsteps."""
    ramp_s = times.ramp_ms / 1000.0
    smooth_steps = np.arange(0, round(ramp_s / DT_S), _EVERY_STEPS)
    part = smooth_steps * DT_S / ramp_s
    # The speed rises as (1 - cos) / 2, which goes half as far as the full speed would.
    smooth = rate_hz * ramp_s * (part / 2.0 - np.sin(np.pi * part) / (2.0 * np.pi))
    rate_made_hz = rate_hz * microsteps
    made = rate_made_hz * ramp_s / 2.0
    number = np.arange(1, int(rate_made_hz * (times.total_ms - times.ramp_ms) / 1000.0) + 1)
    first = np.floor(made) + number
    step_s = ramp_s + (first - made) / rate_made_hz
    counts = np.concatenate([smooth_steps, np.rint(step_s / DT_S).astype(np.int64)]) * DT_COUNTS
    angle = np.pi / 2.0 * np.concatenate([smooth, first / microsteps])
    one, current_a = np.ones(angle.size), electrics.current_a
    return DriverEvents(
        counts, angle, current_a * np.cos(angle), current_a * np.sin(angle), electrics.fast_decay * one, one
    )
