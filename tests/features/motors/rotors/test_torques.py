"""Pull-out torques against published curves, a chopper that switches, and the rotor that slips beyond them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.features.motors.rotors.motor import CATALOGUE, RAD_S_PER_RPM, Motor
from steptwin.features.motors.rotors.torques import DriveSupply, pull_out_nm, pull_outs_nm

Array = NDArray[np.float64]

SMALL = CATALOGUE["17HE19-2004S"]
SMALL_RPM = np.arange(100.0, 1300.0, 100.0)
SMALL_NM = np.array([0.416, 0.402, 0.404, 0.424, 0.420, 0.378, 0.344, 0.304, 0.274, 0.242, 0.182, 0.142])
"""The maker's curve at 24 V, 2.2 A and 1600 microsteps a turn, read off its picture."""

LARGE = CATALOGUE["23HS30-2804S"]
LARGE_RPM = np.array([90.0, 300.0, 390.0, 510.0, 600.0, 810.0, 990.0, 1200.0, 1500.0])
LARGE_NM = np.array([1.84, 1.76, 1.56, 1.28, 1.12, 0.88, 0.60, 0.40, 0.18])
"""At 48 V and 2.69 A rms with a DM542T driver, a third party's reading."""


def with_iron(motor: Motor, iron_ohm: float) -> Motor:
    """Return a motor whose iron has this resistance: a drag of Km^2 / Rm."""
    return replace(motor, iron_drag_nm_s=motor.torque_constant_nm_a**2 / iron_ohm)


@pytest.mark.parametrize(
    ("motor", "supply", "rpm", "published_nm", "rms_max", "error_max"),
    [
        (
            with_iron(replace(SMALL, inductance_mh=1.2 * SMALL.inductance_mh), 50.0),
            DriveSupply(24.0, 2.2, 0.25, 0.6), SMALL_RPM, SMALL_NM, 0.06, 0.10,
        ),
        (SMALL, DriveSupply(24.0, 2.2, 0.25, 0.6), SMALL_RPM, SMALL_NM, 0.16, 0.20),
        (with_iron(LARGE, 110.0), DriveSupply(48.0, 2.69 * 2**0.5, 0.25, 0.2), LARGE_RPM, LARGE_NM, 0.10, 0.16),
    ],
    ids=["17HE19, fitted", "17HE19, from its datasheet", "23HS30, fitted"],
)  # fmt: skip
def test_pull_out_is_near_the_published_curve(
    motor: Motor, supply: DriveSupply, rpm: Array, published_nm: Array, rms_max: float, error_max: float
) -> None:
    """Errors as fractions of the torque at low speed."""
    errors = (pull_out_nm(motor, supply, rpm) - published_nm) / published_nm[0]
    assert np.sqrt(np.mean(errors**2)) <= rms_max
    assert np.abs(errors).max() <= error_max


def chopped_nm(motor: Motor, supply: DriveSupply, rpm: float) -> float:
    """Return the pull-out torque with a chopper of 32 kHz that switches: charge to the reference, then decay."""
    angles, parts, rate_hz = np.linspace(0.0, np.pi, 31), 24, 32_000.0
    speed, dt_s = rpm * RAD_S_PER_RPM, 1.0 / rate_hz / parts
    resistance, km = motor.resistance_ohm + supply.bridge_ohm, motor.torque_constant_nm_a
    steps = int(6 * 2 * np.pi / (motor.teeth * speed) / dt_s)
    current, charged = np.zeros((2, angles.size)), np.zeros((2, angles.size), dtype=bool)
    total = np.zeros(angles.size)
    for step in range(steps):
        turn = motor.teeth * speed * step * dt_s
        shape = np.array([[-np.sin(turn)], [np.cos(turn)]])
        wanted = supply.current_a * np.stack([np.cos(turn + angles), np.sin(turn + angles)])
        sign = np.where(wanted >= 0.0, 1.0, -1.0)
        reached = sign * current >= np.abs(wanted)
        charged = reached | (charged & (step % parts != 0))
        fast = charged & reached & (step % parts >= parts * (1.0 - supply.fast_decay))
        volts = sign * supply.volt * np.where(fast, -1.0, np.where(charged, 0.0, 1.0))
        current = current + dt_s / motor.inductance_h * (volts - km * speed * shape - resistance * current)
        if step >= steps * 5 // 6:
            total += km * (current * shape).sum(axis=0)
    return float(total.max() / (steps - steps * 5 // 6) - motor.drag_nm_s * speed)


@pytest.mark.slow
@pytest.mark.parametrize("fast_decay", [0.25, 1.0])
@pytest.mark.parametrize("rpm", [300.0, 600.0])
def test_the_averaged_chopper_is_near_one_that_switches(fast_decay: float, rpm: float) -> None:
    motor, supply = CATALOGUE["17HS19-2004S1"], DriveSupply(24.0, 2.0, fast_decay, 0.6)
    assert pull_out_nm(motor, supply, np.array([rpm]))[0] == pytest.approx(chopped_nm(motor, supply, rpm), rel=0.12)


def test_at_low_speed_it_is_the_holding_torque_of_the_current() -> None:
    """Km I, with a single amplitude I, less nothing."""
    found = pull_out_nm(SMALL, DriveSupply(24.0, 2.0, 0.25, 0.6), np.array([1.0]))[0]
    assert found == pytest.approx(SMALL.torque_constant_nm_a * 2.0, rel=2e-3)


def test_no_torque_is_left_far_above_the_corner() -> None:
    assert pull_out_nm(SMALL, DriveSupply(12.0, 2.0, 0.25, 0.6), np.array([20_000.0]))[0] == 0.0


def test_several_motors_at_once_are_each_what_they_are_alone() -> None:
    kinds = [
        (SMALL, DriveSupply(24.0, 2.0, 0.25, 0.6)),
        (replace(SMALL, inductance_mh=3.1), DriveSupply(36.0, 1.1, 0.5, 0.3)),
        (replace(SMALL, resistance_ohm=4.0), DriveSupply(12.0, 0.7, 0.0, 0.1)),
    ]
    rpm = np.array([[0.0, 100.0, 300.0], [0.0, 40.0, 90.0], [10.0, 500.0, 1500.0]])
    alone = [pull_out_nm(*kind, speeds) for kind, speeds in zip(kinds, rpm, strict=True)]
    np.testing.assert_array_equal(pull_outs_nm(kinds, rpm), alone)
    assert (np.array(alone)[:, 0] > 0.05).all()
