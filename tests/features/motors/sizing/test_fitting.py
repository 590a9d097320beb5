"""Which motors would do for a robot: torques and frequencies of joints that can be computed by hand."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.stats import qmc

from steptwin import load_robot
from steptwin.features.motors.rotors.mechanics import GRAVITY_M_S2
from steptwin.features.motors.rotors.motor import CATALOGUE
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.sizing.fitting import TABLE_RPM, JointFit, fits_of, natural_hz
from steptwin.features.motors.turning.poses import halton
from steptwin.features.motors.turning.verdict import MARGIN_MIN
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from tests.features.motors.rotors.motor_bench import natural_hz as stiff_hz
from tests.messages import refusing

MOTOR = CATALOGUE["17HS19-2004S1"]


@pytest.fixture(scope="module")
def fits() -> tuple[JointFit, ...]:
    return fits_of(load_robot("lab-scara"))


def lift() -> tuple[Joint, float, float]:
    """Return the laboratory arm's lift, what it carries in kg, and its way in m for a radian of its motor."""
    robot = load_robot("lab-scara")
    assert robot.dynamics is not None
    joint = robot.joints[0]
    mass_kg = robot.dynamics.payload_kg + sum(each.link.mass_kg for each in robot.joints if each.link)
    return joint, mass_kg, 1e-3 * joint.transmission.travel_per_rev / (2.0 * pi)


def test_a_lift_needs_its_weight_its_acceleration_and_its_friction(fits: tuple[JointFit, ...]) -> None:
    """Upwards, at its highest speed and acceleration, the lift carries all links and the payload."""
    joint, mass_kg, metres_per_rad = lift()
    fit = fits[0]
    assert joint.motor is not None
    carried = mass_kg * (GRAVITY_M_S2 + 1e-3 * joint.acceleration_max) * metres_per_rad
    motor = CATALOGUE[joint.motor.model]
    spun = motor.rotor_inertia_kgm2 * 1e-3 * joint.acceleration_max / metres_per_rad
    expected = carried / joint.motor.efficiency + joint.motor.friction_nm + spun
    assert fit.own.torque_needed_nm == pytest.approx(expected, rel=1e-9)
    assert fit.own.rpm == pytest.approx(60.0 * joint.speed_max / joint.transmission.travel_per_rev)
    assert fit.inertia_kgm2 == pytest.approx(mass_kg * metres_per_rad**2 + motor.rotor_inertia_kgm2)
    assert fit.natural_hz == pytest.approx(stiff_hz(motor, fit.inertia_kgm2, current_a=1.5))


def test_a_lift_manages_the_acceleration_whose_swing_takes_its_torque(fits: tuple[JointFit, ...]) -> None:
    """m (g + 2 a) r / efficiency + friction + 2 J a / r is the pull-out torque at the highest speed."""
    joint, mass_kg, metres_per_rad = lift()
    fit = fits[0]
    assert joint.motor is not None
    through_gear = mass_kg * metres_per_rad / joint.motor.efficiency
    spun = CATALOGUE[joint.motor.model].rotor_inertia_kgm2 / metres_per_rad
    left_nm = fit.own.torque_available_nm - joint.motor.friction_nm - through_gear * GRAVITY_M_S2
    expected = left_nm / (2.0 * (through_gear + spun))
    assert fit.moving.managed == pytest.approx(1e3 * expected, rel=1e-3)
    assert fit.moving.asked == joint.acceleration_max
    assert fit.homing is not None
    assert fit.homing.managed > fit.moving.managed  # the search is slower


@pytest.mark.slow
@pytest.mark.parametrize("idle_percent", [None, 20, 50])
def test_an_elbow_accelerates_as_the_shoulders_motor_holds_against(idle_percent: int | None) -> None:
    """Twice what is left of its torque by the shoulder's friction and gear, which help to hold, is the pull-out torque.

    The elbow goes so slowly that nothing depends on its speed; a module lowers the current of a motor that stands.
    """
    robot = load_robot("lab-scara")
    if idle_percent:
        board = replace(robot.board, driver_profile="3a-module", osc_pf=None, idle_percent=idle_percent)
        robot = replace(robot, board=board)
    slow = replace(robot.joint("th3"), speed_max=1e-3, homing=None)
    robot = replace(robot, joints=tuple(slow if joint.name == "th3" else joint for joint in robot.joints))
    _, shoulder, elbow, _ = fits_of(robot, others=())
    drive = robot.joint("th2").motor
    assert drive is not None
    holding_nm = shoulder.pull_out_nm[0] * (idle_percent or 100) / 100
    felt_nm = (holding_nm / 2.0 + drive.friction_nm) / (2.0 - 1.0 / drive.efficiency)
    ratio = robot.joint("th2").transmission.ratio
    expected = np.rad2deg(ratio * felt_nm / felt_inertia_kgm2(robot, shoulder.pose["th3"]))
    assert elbow.moving.weakest == "th2"
    assert elbow.moving.managed == pytest.approx(expected, rel=2e-3)


def felt_inertia_kgm2(robot: Robot, elbow_deg: float) -> float:
    """Return what the laboratory arm's shoulder feels of the elbow's acceleration, by the textbook's planar arm."""
    assert robot.dynamics is not None
    links = [robot.joint(name).link for name in ("th3", "th4")]
    forearm, tool = (link for link in links if link is not None)
    upper_m, fore_m, tip_kg = 0.4, 0.4, tool.mass_kg + robot.dynamics.payload_kg
    moment = 1e-3 * forearm.mass_kg * forearm.centre_mm[0] + tip_kg * fore_m
    own = forearm.inertia_kgm2[2] + forearm.mass_kg * (1e-3 * forearm.centre_mm[0]) ** 2 + tip_kg * fore_m**2
    return float(own + tool.inertia_kgm2[2] + upper_m * moment * np.cos(np.deg2rad(elbow_deg)))


def test_all_motors_of_the_catalogue_are_judged_by_the_margin_that_is_left(fits: tuple[JointFit, ...]) -> None:
    for fit in fits:
        assert [other.motor for other in fit.others] == list(CATALOGUE)
        for other in fit.others:
            assert other.margin == pytest.approx(1.0 - other.torque_needed_nm / other.torque_available_nm)
            assert other.would_do == (other.margin >= MARGIN_MIN)
            assert other.current_a == min(CATALOGUE[other.motor].rated_current_a, 3.0)
        assert len(fit.pull_out_nm) == len(TABLE_RPM)
        assert list(fit.pull_out_nm) == sorted(fit.pull_out_nm, reverse=True)
    assert fits[0].own.motor == "23HS22-2804S"


def test_the_arms_inertia_is_greatest_where_the_arm_is_stretched(fits: tuple[JointFit, ...]) -> None:
    """The shoulder at the pose whose elbow is nearest to straight."""
    assert abs(fits[1].pose["th3"]) < 15.0
    assert abs(fits[2].natural_hz) > abs(fits[1].natural_hz)


@pytest.mark.parametrize("belt_nm_rad", [0.5, 8.0, 1e6])
def test_a_belt_makes_two_masses_whose_lower_frequency_is_told(belt_nm_rad: float) -> None:
    """Against the eigenvalues of the two masses."""
    load = 5e-5
    found = natural_hz(Drive(MOTOR, 0.6, stiffness_nm_rad=belt_nm_rad), 1.5, load)
    field = MOTOR.teeth * (MOTOR.torque_constant_nm_a * 1.5 + 4.0 * MOTOR.detent_torque_nm)
    stiffness = np.array([[field + belt_nm_rad, -belt_nm_rad], [-belt_nm_rad, belt_nm_rad]])
    masses = np.diag([1.0 / MOTOR.rotor_inertia_kgm2, 1.0 / load])
    lowest = np.sqrt(np.linalg.eigvals(masses @ stiffness).real.min()) / (2.0 * pi)
    assert found == pytest.approx(lowest, rel=1e-6)
    if belt_nm_rad == 1e6:
        assert found == pytest.approx(natural_hz(Drive(MOTOR, 0.6), 1.5, load), rel=1e-3)


@pytest.mark.slow
def test_a_motor_that_must_turn_faster_than_it_can_would_not_do() -> None:
    robot = load_robot("lab-scara")
    assert robot.dynamics is not None
    slow = replace(robot, dynamics=replace(robot.dynamics, supply_v=4.5))
    weak, own = fits_of(slow, others=())[0].own, fits_of(robot, others=())[0].own
    assert not weak.would_do
    assert weak.torque_available_nm < own.torque_available_nm
    assert weak.rpm == own.rpm


def test_poses_are_spread_by_haltons_sequence() -> None:
    """As scipy has it, for as many axes as a board drives; its first point is 0."""
    theirs = qmc.Halton(8, scramble=False).random(65)[1:]
    np.testing.assert_allclose(halton(64, 8), theirs, rtol=1e-14)
    np.testing.assert_array_equal(halton(4, 2), [[1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9], [1 / 8, 4 / 9]])
    with refusing(ValueError):
        halton(1, 9)
