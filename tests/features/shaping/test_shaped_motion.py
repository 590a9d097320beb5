"""Shaped motions: they end exactly, keep the limits and the times, and leave the oscillation out."""

from itertools import pairwise

import numpy as np
import pytest

from steptwin.features.motors.limits.motor_rows import MotorLimits
from steptwin.features.shaping.shaped_motion import oscillations_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import changed_motion
from steptwin.host.planning.motion import JointFunctions, Motion, OutputChange
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.joint_move import fastest_law
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import executed_duration_s, plan, plan_executed, plan_stretched
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute

START = np.array([100.0, 100.0, 50.0])
HZ = 40.0
PLAIN = load_robot("corexy-gantry")


def gantry(*joints: str, kind: str = "mzv", hz: float = HZ, more: str = "damping = 0.0") -> Robot:
    """Return the CoreXY gantry with these joints shaped."""
    tables = (f'[shaping.{joint}]\nkind = "{kind}"\nfrequency_hz = {hz}\n{more}' for joint in joints)
    return parse_robot("\n".join([PLAIN.toml, *tables]), "own.toml")


def moved(*goals: tuple[float, float, float]) -> Motion:
    """Return moves of all joints from START to one place after another, whose accelerations jump."""
    composer = Composer(PLAIN, START)
    for goal in goals:
        composer.go_by(fastest_law(PLAIN, np.array(goal) - composer.joints), np.array(goal))
    return composer.sequence()


def residual_mm(planned: Plan, hz: float = HZ, joint: int = 0) -> float:
    """Return how far an undamped oscillator that hangs at a joint swings when the motion of the wire's cubics ends."""
    t_s = planned.times_ms / 1000
    positions = planned.robot.to_positions(planned.points_units)[:, joint]
    axes = planned.velocities / 64.0 * 1000.0 / planned.robot.wire_units_per_unit
    velocities = planned.robot.coupling.to_joints(axes)[:, joint]
    omega, total = 2.0 * np.pi * hz, 0.0 + 0.0j
    for (at, to), (q0, q1), (v0, v1) in zip(pairwise(t_s), pairwise(positions), pairwise(velocities), strict=True):
        dt = to - at
        first, last = (6 * (q1 - q0) / dt - 4 * v0 - 2 * v1) / dt, (4 * v1 + 2 * v0 - 6 * (q1 - q0) / dt) / dt
        jerk = (last - first) / dt
        begin, end = (np.exp(-1j * omega * each) * 1j / omega for each in (at, to))
        total += last * end - first * begin - 1j / omega * jerk * (end - begin)
    return float(abs(total) / omega)


def test_a_robot_without_shaping_executes_the_very_motion() -> None:
    motion = moved((150.0, 120.0, 50.0))
    planned = plan(PLAIN, motion)
    assert planned.motion is motion
    assert planned.changed is None
    assert changed_motion(PLAIN, motion) is None


@pytest.mark.parametrize(("kind", "longer_ms", "residual_um"), [("zv", 13, 0.1), ("mzv", 19, 0.1), ("ei", 25, 6.6)])
def test_the_oscillation_is_gone_at_the_end(kind: str, longer_ms: int, residual_um: float) -> None:
    motion = moved((141.0, 100.0, 50.0))
    unshaped, shaped = plan(PLAIN, motion), plan(gantry("X", kind=kind), motion)
    assert round(1000 * (shaped.motion.duration_s - motion.duration_s)) == longer_ms
    assert 1000 * residual_mm(unshaped) == pytest.approx(132.2, abs=0.2)
    assert 1000 * residual_mm(shaped) == pytest.approx(residual_um, abs=0.15)


def test_ei_leaves_a_twentieth_where_the_frequency_is_a_fifth_off() -> None:
    motion = moved((141.0, 100.0, 50.0))
    for hz in (0.8 * HZ, 1.2 * HZ):
        unshaped = residual_mm(plan(PLAIN, motion), hz)
        left = {kind: residual_mm(plan(gantry("X", kind=kind), motion), hz) / unshaped for kind in ("zv", "ei")}
        assert left == {"zv": pytest.approx(0.31, abs=0.01), "ei": pytest.approx(0.05, abs=0.003)}


def test_it_ends_exactly_and_at_rest_in_every_stop() -> None:
    goals = [(141.0, 112.3, 50.0), (141.0, 112.3, 61.7), (33.3, 200.1, 60.0)]
    motion, robot = moved(*goals), gantry("X", "Y", kind="ei")
    changed = changed_motion(robot, motion)
    assert changed is not None
    for parts in range(1, 4):
        before_s = moved(*goals[:parts]).duration_s
        at_s = np.array([changed.later_s(before_s)])
        assert changed.motion.positions(at_s)[0].tolist() == motion.positions(np.array([before_s]))[0].tolist()
        assert np.abs(changed.motion.velocities(at_s)).max() < 1e-12
    assert at_s[0] == changed.motion.duration_s == executed_duration_s(robot, motion)
    assert plan(robot, motion).points_units[-1].tolist() == plan(PLAIN, motion).points_units[-1].tolist()


def test_it_is_never_faster_than_the_motion() -> None:
    motion = moved((141.0, 180.0, 50.0), (20.0, 180.0, 80.0))
    unshaped, shaped = plan(PLAIN, motion), plan(gantry("X", "Y", "Z"), motion)
    for plain, each in zip(unshaped.peaks, shaped.peaks, strict=True):
        assert each.value <= plain.value * (1.0 + 1e-3)


def test_equal_shapers_keep_a_straight_move_straight_and_others_are_told() -> None:
    motion = moved((190.0, 130.0, 50.0))

    def off(robot: Robot) -> str:
        changed = changed_motion(robot, motion)
        assert changed is not None
        return changed.described()

    assert off(gantry("X", "Y", "Z")) == (
        "shaped (X mzv 40.0 Hz, Y mzv 40.0 Hz, Z mzv 40.0 Hz): 0.019 s longer, the tool at most 0.000 mm off its path"
    )
    assert off(gantry("X")) == "shaped (X mzv 40.0 Hz): 0.019 s longer, the tool at most 0.019 mm off its path"


def test_at_constant_speed_the_joints_are_as_late_as_each_other() -> None:
    composer = Composer(PLAIN, START)
    composer.go(np.array([240.0, 240.0, 50.0]))
    changed = changed_motion(gantry("X", kind="ei", hz=20.0), composer.sequence())
    assert changed is not None
    middle_s = np.array([changed.motion.duration_s / 2.0])
    x, y, _ = changed.motion.positions(middle_s)[0].tolist()
    speed = float(changed.motion.velocities(middle_s)[0, 0])
    assert speed > 100.0
    assert x - y == pytest.approx(0.0, abs=1e-3)


def test_pauses_waits_and_outputs_begin_when_the_machine_has_settled() -> None:
    robot = gantry("X", "Y")
    composer = Composer(PLAIN, START)
    composer.go(np.array([150.0, 100.0, 50.0]))
    first_s = composer.now_s
    composer.switch("gripper", on=True)
    composer.go(np.array([150.0, 150.0, 50.0]))
    second_s = composer.now_s
    composer.pause(0.2)
    composer.go(START)
    motion = composer.sequence()
    changed = changed_motion(robot, motion)
    assert changed is not None
    (change,) = changed.motion.output_changes
    assert (change.from_s, change.until_s) == pytest.approx((first_s + 0.019, first_s + 0.319))
    assert changed.later_s(second_s) == pytest.approx(second_s + 0.038)
    assert changed.later_s(second_s + 0.2) == pytest.approx(second_s + 0.238)
    assert changed.motion.duration_s == pytest.approx(motion.duration_s + 0.057)
    still_s = np.arange(second_s + 0.038, second_s + 0.239, 0.001)
    assert np.abs(changed.motion.velocities(still_s)).max() == 0.0


def test_an_output_on_the_way_changes_where_it_would_and_a_motion_of_pauses_stays() -> None:
    composer = Composer(PLAIN, START)
    composer.pause(0.3)
    still = composer.sequence()
    changed = changed_motion(gantry("X"), still)
    assert changed is not None
    assert changed.motion.duration_s == 0.3
    composer.go(np.array([240.0, 100.0, 50.0]))
    composer.add_output_changes([OutputChange("gripper", True, 0.6, 0.61, on_the_way=True)])
    motion = composer.sequence()
    changed = changed_motion(gantry("X"), motion)
    assert changed is not None
    (change,) = changed.motion.output_changes
    assert (change.from_s, change.until_s) == pytest.approx((0.61, 0.62))
    there, planned = (
        float(each.positions(np.array([at]))[0, 0]) for each, at in ((changed.motion, 0.61), (motion, 0.6))
    )
    assert there == pytest.approx(planned, abs=0.3)  # within 1 ms


def test_it_is_shaped_after_it_was_stretched() -> None:
    motion = moved((141.0, 100.0, 50.0))
    robot = gantry("X")
    for stretch in (1.0, 1.4, 3.0):
        planned = plan_stretched(robot, motion, stretch)
        assert planned.motion.duration_s == pytest.approx(motion.duration_s * stretch + 0.019, abs=0.0011)
        assert 1000 * residual_mm(planned) < 0.3


def test_a_stored_motion_is_not_shaped_again() -> None:
    planned = plan(gantry("X"), moved((141.0, 100.0, 50.0)))
    again = plan_executed(planned.robot, planned.motion)
    assert again.points_units.tolist() == planned.points_units.tolist()


def test_a_motion_that_does_not_start_at_rest_is_refused_as_it_is() -> None:
    def positions(t_s: FloatArray) -> FloatArray:
        return START + 10.0 * t_s[:, np.newaxis]

    def velocities(t_s: FloatArray) -> FloatArray:
        return np.full((len(t_s), 3), 10.0)

    sliding = Motion(PLAIN.joint_names, 0.1, JointFunctions(positions, velocities))
    messages = []
    for robot in (PLAIN, gantry("X")):
        with pytest.raises(InputError) as refused:
            plan(robot, sliding)
        messages.append(str(refused.value))
    assert messages[0] == messages[1] == ("X: the motion starts at t = 0.000 s with 10 mm/s instead of 0 mm/s, at rest")


def test_the_motors_model_gives_each_slide_the_frequency_of_its_mass_on_its_belts() -> None:
    """Both motors hold each slide of a CoreXY, with the inertia of two rotors; x carries y, and y carries z."""
    links = "".join(
        f'[joints.{name}.motor]\nmodel = "17HS19-2004S1"\n[joints.{name}.link]\nmass_kg = {mass}\n'
        for name, mass in (("X", 0.4), ("Y", 0.6), ("Z", 0.5))
    )
    model = "[dynamics]\nsupply_v = 24.0\npayload_kg = 0.1\n"
    tables = "".join(f'[shaping.{name}]\nkind = "zv"\nfrom = "motors"\n' for name in "XY")
    robot = parse_robot(f"{PLAIN.toml}\n{links}{model}{tables}", "own.toml")
    found = oscillations_of(robot, moved((150.0, 180.0, 60.0)))
    limits = MotorLimits.of(robot, 0.0)
    motor, spring_nm_rad = limits.drives[0].motor, limits.drives[0].motor.teeth * float(limits.curves[0].torque_nm[0])
    m_rad = 0.04 / (2.0 * np.pi)
    for name, mass_kg in (("X", 0.4 + 0.6 + 0.5 + 0.1), ("Y", 0.6 + 0.5 + 0.1)):
        mass, stiffness = mass_kg + 2.0 * motor.rotor_inertia_kgm2 / m_rad**2, 2.0 * spring_nm_rad / m_rad**2
        assert found[name].frequency_hz == pytest.approx(np.sqrt(stiffness / mass) / (2.0 * np.pi), rel=1e-6)
        damping = 2.0 * motor.drag_nm_s / m_rad**2 / (2.0 * np.sqrt(stiffness * mass))
        assert found[name].damping == pytest.approx(damping, rel=1e-6)


def test_waits_are_kept() -> None:
    inputs = '[inputs]\nready = { joint = "X", input = 1 }'
    plain = parse_robot(f"{PLAIN.toml}\n{inputs}", "own.toml")
    table = '[shaping.X]\nkind = "zv"\nfrequency_hz = 20.0\ndamping = 0.0'
    robot = parse_robot(f"{PLAIN.toml}\n{inputs}\n{table}", "own.toml")
    composer = Composer(plain, START)
    composer.go(START + 5.0)
    composer.wait("ready", on=True, timeout_s=2.0)
    motion = composer.sequence()
    (before,), (after,) = motion.waits, plan(robot, motion).motion.waits
    assert (after.input, after.timeout_s) == (before.input, before.timeout_s)
    assert after.at_s == pytest.approx(before.at_s + 0.025)


def test_the_run_of_a_shaped_motion_is_verified_against_it() -> None:
    shaped = plan(gantry("X", "Y", hz=60.0), moved((110.0, 104.0, 50.0)))
    outcome = execute(shaped, "shaped")
    assert outcome.passed
    assert outcome.report.run.duration_s == shaped.motion.duration_s
