"""Rotors against the equations of their theory, each in closed form."""

from dataclasses import replace
from functools import partial
from math import asin, cos, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.features.motors.rotors.rotors import Drive, DriverEvents
from tests.features.motors.rotors.motor_bench import (
    CURRENT_A,
    IDEAL,
    MOTOR,
    bench,
    field,
    flywheel,
    natural_hz,
    standing,
    turned,
    weight,
    weight_inertia,
)

KM_I = IDEAL.torque_constant_nm_a * CURRENT_A


@pytest.mark.parametrize("part", [-0.9, -0.3, 0.0, 0.5, 0.95])
def test_load_angle_at_rest_is_the_arc_sine_of_the_load(part: float) -> None:
    """delta = asin(T / (Km I)); damped by a drag, so that it comes to rest."""
    damped = replace(IDEAL, iron_drag_nm_s=0.008)
    rotors = bench(Drive(damped, 0.6), weight(part * KM_I))
    record = turned(rotors, standing(), 1500)
    behind = -record.rotor_rad[-1, 0] * damped.teeth
    assert np.rad2deg(behind) == pytest.approx(np.rad2deg(asin(part)), abs=1e-6)


@pytest.mark.parametrize("detent_nm", [0.0, 0.022])
def test_small_oscillations_have_the_natural_frequency(detent_nm: float) -> None:
    motor, wheel = replace(IDEAL, detent_torque_nm=detent_nm), 82e-7
    rotors = bench(Drive(motor, 0.6), flywheel(wheel), load_angle=0.002)
    record = turned(rotors, standing(), 400)
    at_s, angle = 1e-3 * np.arange(1, 401), record.rotor_rad[:, 0]
    expected = natural_hz(motor, motor.rotor_inertia_kgm2 + wheel)

    def wave(t: np.ndarray, hz: float, size: float, phase: float) -> np.ndarray:
        return size * np.cos(2.0 * pi * hz * t + phase)

    (hz, _, _), _ = curve_fit(wave, at_s, angle, (expected, angle.min(), 0.0))
    assert hz == pytest.approx(expected, rel=1e-3)


def starts(hz: float, load_nm: float, wheel: float) -> bool:
    """Return whether a motor without drag follows a field that turns at once, from standstill under a load."""
    drive, load = Drive(IDEAL, 0.6), weight(load_nm) if load_nm else flywheel(wheel)
    rotors = bench(drive, load, load_angle=asin(load_nm / KM_I))
    record = turned(rotors, field(lambda t: 2.0 * pi * hz * t, 0.06), 60)
    return bool(record.lost_full_steps[-1, 0] == 0.0)


@pytest.mark.parametrize(("part", "wheel"), [(0.0, 82e-7), (0.0, 300e-7), (0.3, 0.0), (0.6, 0.0)])
def test_pull_in_from_standstill_is_at_the_separatrix(part: float, wheel: float) -> None:
    """1/2 (W / w0)^2 = 2 cos d0 - tau (pi - 2 d0): unloaded, 8 f0 full steps a second."""
    load_nm, rest = part * KM_I, asin(part)
    inertia = IDEAL.rotor_inertia_kgm2 + (weight_inertia(load_nm) if part else wheel)
    slow = 2.0 * pi * natural_hz(IDEAL, inertia)
    limit_hz = slow * sqrt(2.0 * (2.0 * cos(rest) - part * (pi - 2.0 * rest))) / (2.0 * pi)
    assert starts(0.99 * limit_hz, load_nm, wheel)
    assert not starts(1.01 * limit_hz, load_nm, wheel)


def test_slips_at_standstill_are_whole_electrical_turns() -> None:
    """A load beyond the torque of a weak current pulls the rotor away; caught again it rests 4 n full steps away."""
    damped = replace(IDEAL, iron_drag_nm_s=0.008)
    rotors = bench(Drive(damped, 0.6), weight(0.3 * KM_I))
    weak = standing(current_a=0.25 * CURRENT_A)
    turned(rotors, standing(), 50)
    rotors.feed([replace(weak, counts=np.array([rotors.counts]))])
    rotors.advance(80)
    rotors.feed([replace(standing(), counts=np.array([rotors.counts]))])
    record = rotors.advance(1500)
    lost = record.lost_full_steps[-1, 0]
    full_steps = -record.rotor_rad[-1, 0] * 200 / (2.0 * pi) - asin(0.3) / (pi / 2)
    assert lost > 0
    assert lost % 4 == 0
    assert full_steps == pytest.approx(lost, abs=1e-6)
    assert rotors.first_slips()[0] is not None


@pytest.mark.slow
@pytest.mark.parametrize("fast", [0.25, 1.0])
def test_a_motion_agrees_with_a_solver_of_differential_equations(fast: float) -> None:
    """Load angle within 2 degrees electrical of an adaptive solver, which knows nothing of steps of 10 us."""
    drive, wheel, supply_v = Drive(replace(MOTOR, friction_nm=0.0), 0.6), 82e-7, 24.0
    resistance, inductance = MOTOR.resistance_ohm + 0.6, MOTOR.inductance_h
    km, teeth, inertia = MOTOR.torque_constant_nm_a, MOTOR.teeth, MOTOR.rotor_inertia_kgm2 + wheel

    def angle(t: float) -> float:
        return 2.0 * pi * 2000.0 * t * t  # up to 240 Hz electrical, 288 turns a minute, in 60 ms

    def slope(t: float, y: np.ndarray) -> list[float]:
        turn, speed, *currents = y
        waves, wanted = (-np.sin(turn), np.cos(turn)), (np.cos(angle(t)), np.sin(angle(t)))
        rates = []
        for current, wave, reference in zip(currents, waves, wanted, strict=True):
            emf, aim = km * speed * wave, CURRENT_A * reference
            volts = (aim - current) * inductance / 2e-5 + resistance * current + emf
            low, high = (-fast * supply_v, supply_v) if aim >= 0.0 else (-supply_v, fast * supply_v)
            rates.append((min(max(volts, low), high) - resistance * current - emf) / inductance)
        torque = km * (currents[0] * waves[0] + currents[1] * waves[1])
        torque -= MOTOR.drag_nm_s * speed + MOTOR.detent_torque_nm * np.sin(4.0 * turn)
        return [teeth * speed, torque / inertia, *rates]

    instants = 1e-3 * np.arange(1, 61)
    exact = solve_ivp(slope, (0.0, 0.06), [0.0, 0.0, 0.0, 0.0], t_eval=instants, rtol=1e-7, atol=1e-9, max_step=2e-4)
    events = field(lambda t: 2.0 * pi * 2000.0 * t * t, 0.06, fast=fast)
    ours = turned(bench(drive, flywheel(wheel), supply_v=supply_v), events, 60).rotor_rad[:, 0] * teeth
    assert np.rad2deg(np.abs(ours - exact.y[0])).max() < 2.0


def test_the_energy_goes_where_it_is_said_to_go() -> None:
    """What the bridges give is lost in copper, iron and friction, lifts the weight or moves."""
    wheel_load = 0.1
    rotors = bench(Drive(MOTOR, 0.6, friction_nm=0.02, efficiency=0.8), weight(wheel_load), supply_v=24.0)
    record = turned(rotors, field(lambda t: 2.0 * pi * 300.0 * t * t, 0.4, fast=0.5), 400)
    went = rotors.energies()
    speed = (record.rotor_rad[-1, 0] - record.rotor_rad[-2, 0]) / 1e-3
    moving = (MOTOR.rotor_inertia_kgm2 + weight_inertia(wheel_load)) * speed**2 / 2.0
    stored = MOTOR.inductance_h * CURRENT_A**2 / 2.0
    lost = went.copper[0] + went.drag[0] + went.rubbed[0] + went.loaded[0]
    assert record.lost_full_steps[-1, 0] == 0.0
    assert went.driven[0] == pytest.approx(lost + moving + stored, rel=1e-3)
    assert went.loaded[0] == pytest.approx(wheel_load * record.rotor_rad[-1, 0], rel=1e-3)


SAGGING = PowerSupply(24.0, ohm=0.5, farad=220e-6)


def test_a_supply_sags_by_the_current_that_it_gives() -> None:
    """At rest the phases take R I^2: u = V - r P / u."""
    rotors = bench(Drive(MOTOR, 0.6), flywheel(1e-4), supply=SAGGING)
    turned(rotors, standing(), 100)
    power_w = (MOTOR.resistance_ohm + 0.6) * CURRENT_A**2
    settled_v = SAGGING.volt / 2.0 + sqrt(SAGGING.volt**2 / 4.0 - SAGGING.ohm * power_w)
    lowest_v, highest_v = rotors.supply_span_v
    assert highest_v == SAGGING.volt
    assert lowest_v < settled_v  # while the current rises, the coils are charged too
    rotors.advance(100)
    given_before, lost_before = rotors.supply_given_j
    drawn_before = rotors.energies().driven[0]
    rotors.advance(100)
    given, lost = (now - before for now, before in zip(rotors.supply_given_j, (given_before, lost_before), strict=True))
    assert rotors.energies().driven[0] - drawn_before == pytest.approx(0.1 * power_w, rel=1e-6)
    assert given == pytest.approx(0.1 * SAGGING.volt * (SAGGING.volt - settled_v) / SAGGING.ohm, rel=1e-6)
    assert lost == pytest.approx(0.1 * (SAGGING.volt - settled_v) ** 2 / SAGGING.ohm, rel=1e-6)


def test_a_braking_motor_pumps_up_the_supply_and_no_energy_is_lost() -> None:
    """A heavy wheel is sped up and braked: what the source gives is lost, or is in coils and capacitors at the end."""
    rotors = bench(Drive(MOTOR, 0.6), flywheel(2.8e-4), supply=SAGGING)

    def there(t: FloatArray) -> FloatArray:
        part = np.clip(t / 0.3, 0.0, 1.0)
        return np.asarray(300.0 * (part - np.sin(2.0 * pi * part) / (2.0 * pi)))

    record = turned(rotors, field(there, 0.4, current_a=1.0, fast=1.0), 400)
    assert record.lost_full_steps[-1, 0] == 0.0
    lowest_v, highest_v = rotors.supply_span_v
    assert lowest_v < SAGGING.volt - 0.1
    assert highest_v > SAGGING.volt + 0.5
    given, lost = rotors.supply_given_j
    went = rotors.energies()
    coils = MOTOR.inductance_h / 2.0
    assert given - lost == pytest.approx(went.driven[0], rel=1e-3)
    assert went.driven[0] == pytest.approx(went.copper[0] + went.drag[0] + went.rubbed[0] + coils, rel=1e-3)


def test_a_free_rotor_keeps_its_momentum() -> None:
    """Without friction and current, a rotor that turns goes on at its speed."""
    rotors = bench(Drive(IDEAL, 0.6), flywheel(1e-5))
    turned(rotors, field(lambda t: 2.0 * pi * 100.0 * t, 0.05), 50)
    rotors.feed([standing(on=0.0, counts=rotors.counts)])
    coasting = rotors.advance(150)
    speeds = np.diff(coasting.rotor_rad[50:, 0])
    assert np.ptp(speeds) < 1e-9 * abs(speeds[0])


def test_a_vertical_axis_falls_without_its_brake_and_hangs_in_it() -> None:
    held = bench(Drive(IDEAL, 0.6, brake_nm=0.11), weight(0.1))
    falls = bench(Drive(IDEAL, 0.6, brake_nm=0.09), weight(0.1))
    assert turned(held, standing(on=0.0), 200).rotor_rad[-1, 0] == pytest.approx(0.0, abs=1e-12)
    assert turned(falls, standing(on=0.0), 200).rotor_rad[-1, 0] < -1.0


def test_an_end_stop_holds_the_rotor_while_the_field_goes_on() -> None:
    stop_rad = 0.5
    rotors = bench(Drive(IDEAL, 0.6, friction_nm=0.01, upper_rad=stop_rad), flywheel(82e-7))
    record = turned(rotors, field(lambda t: 2.0 * pi * 60.0 * t, 0.3), 300)
    farthest = record.rotor_rad.max()
    assert stop_rad <= farthest < stop_rad + 0.01
    assert record.lost_full_steps[-1, 0] >= 4 * 12
    first = rotors.first_slips()[0]
    assert first is not None
    at_stop_s = stop_rad * IDEAL.teeth / (2.0 * pi * 60.0)
    assert at_stop_s < first / 72e6 < at_stop_s + 2.0 / 60.0


def test_a_belt_twists_by_the_load() -> None:
    """At rest by T / k."""
    stiffness, load_nm = 4.0, 0.1
    motor = replace(IDEAL, iron_drag_nm_s=0.008)
    drive = Drive(motor, 0.6, stiffness_nm_rad=stiffness, damping_nm_s=0.004)
    last = turned(bench(drive, weight(load_nm, mass_kg=500.0)), standing(), 2000)
    assert last.rotor_rad[-1, 0] - last.coordinate_rad[-1, 0] == pytest.approx(load_nm / stiffness, rel=1e-6)


def test_two_masses_on_a_belt_swing_at_the_frequency_of_their_springs() -> None:
    """Field and belt are two springs: the eigenvalues of 2 masses; the rotor's swing holds both frequencies."""
    wheel, belt = 300e-7, 8.0
    rotors = bench(Drive(IDEAL, 0.6, stiffness_nm_rad=belt), flywheel(wheel), load_angle=0.004)
    record = turned(rotors, standing(), 500)
    field_nm_rad = IDEAL.teeth * KM_I
    stiffness = np.array([[field_nm_rad + belt, -belt], [-belt, belt]])
    masses = np.array([IDEAL.rotor_inertia_kgm2, wheel])
    low_hz, high_hz = np.sort(np.sqrt(np.linalg.eigvals(stiffness / masses[:, None]).real)) / (2.0 * pi)
    at_s, angle = 1e-3 * np.arange(1, 501), record.rotor_rad[:, 0]

    def waves(t: np.ndarray, hz: float, a: float, b: float, above: float, c: float, d: float) -> np.ndarray:
        slow, fast = 2.0 * pi * hz * t, 2.0 * pi * above * t
        return a * np.cos(slow) + b * np.sin(slow) + c * np.cos(fast) + d * np.sin(fast)

    size = float(np.abs(angle).max())
    (found_hz, _, _, found_high_hz, _, _), _ = curve_fit(
        waves, at_s, angle, (low_hz, -size, 0.0, high_hz, -size / 10.0, 0.0)
    )
    assert found_hz == pytest.approx(low_hz, rel=1e-3)
    assert found_high_hz == pytest.approx(high_hz, rel=1e-3)


@pytest.mark.parametrize(("efficiency", "falls"), [(0.49, False), (0.51, True)])
def test_a_gear_below_half_efficiency_locks_itself(efficiency: float, falls: bool) -> None:
    """What it carries rubs by 1 / efficiency - 1 of it, which is all of it at one half."""
    rotors = bench(Drive(IDEAL, 0.6, efficiency=efficiency), weight(0.1))
    down_rad = turned(rotors, standing(on=0.0), 200).rotor_rad[-1, 0]
    assert down_rad < -0.1 if falls else down_rad == pytest.approx(0.0, abs=1e-9)


def test_a_gear_lets_the_motor_lift_by_its_load_divided_by_the_efficiency() -> None:
    """Turned up slowly, the load angle is that of T / efficiency; turned down, that of T less the friction."""
    load_nm, efficiency = 0.1, 0.8
    motor = replace(IDEAL, iron_drag_nm_s=0.004)
    found = []
    for sign in (1.0, -1.0):
        rotors = bench(Drive(motor, 0.6, efficiency=efficiency), weight(load_nm), load_angle=asin(load_nm / KM_I))
        speed = sign * 2.0 * pi * 5.0
        record = turned(rotors, field(partial(np.multiply, speed), 1.2), 1200)
        found.append(np.sin(record.worst_rad[-300:, 0]).mean() * KM_I)
    drag_nm = 0.004 * 2.0 * pi * 5.0 / motor.teeth
    assert found[0] == pytest.approx(load_nm / efficiency + drag_nm, rel=0.01)
    assert found[1] == pytest.approx(load_nm * (2.0 - 1.0 / efficiency) - drag_nm, rel=0.01)


def test_the_windings_warm_up_to_the_losses_times_the_resistance() -> None:
    """With a time constant of 0.1 s the windings reach R I^2 times the thermal resistance."""
    motor = replace(IDEAL, thermal_time_constant_s=0.1)
    last = turned(bench(Drive(motor, 0.6)), standing(), 1500)
    assert last.warmer_k[-1, 0] == pytest.approx(
        motor.resistance_ohm * CURRENT_A**2 * motor.thermal_resistance_k_w, rel=1e-3
    )


RESONANT = flywheel(82e-7)
"""As much as the rotor itself: together with it f0 is 179.5 Hz."""


DAMPED = replace(MOTOR, detent_torque_nm=0.0, iron_drag_nm_s=0.003)
"""Damped so far that it swings little: a wide swing is slower, as a pendulum's is."""


def microsteps_at(rate_hz: float, microsteps: int) -> DriverEvents:
    """Return a field that makes so many full steps a second, each in `microsteps` parts, for 0.6 s."""

    def angle(t: FloatArray) -> FloatArray:
        return np.asarray(np.floor(t * rate_hz * microsteps + 1e-9) * (pi / 2 / microsteps))

    return field(angle, 0.6)


def worst_lags_deg(microsteps: int, rates_hz: list[float]) -> list[float]:
    """Return the greatest load angle at each rate of full steps a second, apart from the beginning."""
    found = []
    for rate_hz in rates_hz:
        events = microsteps_at(rate_hz, microsteps)
        record = turned(bench(Drive(DAMPED, 0.6), RESONANT, supply_v=24.0), events, 600)
        found.append(float(np.rad2deg(np.abs(record.worst_rad[200:, 0]).max())))
    return found


def test_microsteps_resonate_where_they_come_at_the_natural_frequency() -> None:
    """1/8 steps: the peak is where 8 steps for each full step come at f0, within 5 %."""
    natural = natural_hz(DAMPED, DAMPED.rotor_inertia_kgm2 + 82e-7)
    rates = [natural / 8.0 * (1.0 + 0.025 * part) for part in range(-8, 9)]
    peak = rates[int(np.argmax(worst_lags_deg(8, rates)))]
    assert peak == pytest.approx(natural / 8.0, rel=0.05)


def test_full_steps_lose_steps_near_resonance_where_microsteps_lose_none() -> None:
    """170 full steps a second, below f0: full steps drive the rotor out of step, eighths do not."""
    lost = {}
    for microsteps in (1, 8):
        rotors = bench(Drive(MOTOR, 0.6), RESONANT, supply_v=24.0)
        record = turned(rotors, microsteps_at(170.0, microsteps), 600)
        lost[microsteps] = abs(float(record.lost_full_steps[-1, 0]))
    assert lost[1] > 0.0
    assert lost[8] == 0.0
