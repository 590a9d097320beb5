"""The planner: points on the wire, and each check on both sides of its limit."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motion import JointFunctions, Motion
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Transmission
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.messages import refusing
from tests.work import counting, function_calls

ROBOT = load_robot("warehouse-scara")
HOME = np.array(ROBOT.home)
TH1 = 3
SPU_TH1 = ROBOT.joint("th1").transmission.steps_per_unit

Scalar = Callable[[FloatArray], FloatArray]


def one_joint(
    position: Scalar,
    velocity: Scalar,
    duration_s: float = 1.0,
    breakpoints_s: tuple[float, ...] = (),
    axis: int = TH1,
) -> Motion:
    """Return a motion of one joint from the home position by given functions."""

    def positions(t_s: FloatArray) -> FloatArray:
        positions = np.tile(HOME, (len(t_s), 1))
        positions[:, axis] += position(t_s)
        return positions

    def velocities(t_s: FloatArray) -> FloatArray:
        velocities = np.zeros((len(t_s), len(HOME)))
        velocities[:, axis] = velocity(t_s)
        return velocities

    return Motion(ROBOT.joint_names, duration_s, JointFunctions(positions, velocities), breakpoints_s)


def moved_by(law: Trapezoid, axis: int = TH1) -> Motion:
    return one_joint(law.position, law.velocity, law.duration_s, law.breakpoints_s, axis)


def law_of(speed: float) -> Trapezoid:
    """Return a law over about 40 deg at this highest speed, which is reached in 0.2 s."""
    steady_and_ramp_ms = round(40_000 / abs(speed)) + 200
    return Trapezoid(speed * steady_and_ramp_ms / 1000, (steady_and_ramp_ms + 200) / 1000, 0.2)


def zero(t_s: FloatArray) -> FloatArray:
    return np.zeros_like(t_s)


def swing(amplitude: float, period_s: float = 1.0, **changes: float) -> Motion:
    """Return a motion forth and back: a (1 - cos wt)."""
    w = 2 * np.pi / period_s
    motion = one_joint(lambda t: amplitude * (1 - np.cos(w * t)), lambda t: amplitude * w * np.sin(w * t), period_s)
    return dataclasses.replace(motion, **changes)  # type: ignore[arg-type]


def complaint(motion: Motion, robot: Robot = ROBOT, point_ms: int = 10) -> str:
    return complaint_of(lambda: plan(robot, motion, point_ms))


def with_joint(name: str, **changes: object) -> Robot:
    joints = tuple(
        dataclasses.replace(joint, **changes) if joint.name == name else joint  # type: ignore[arg-type]
        for joint in ROBOT.joints
    )
    return dataclasses.replace(ROBOT, joints=joints)


def endless(name: str) -> Robot:
    """Return the robot with one joint whose speed only the wire and the driver limit."""
    return with_joint(name, speed_max=1e9, acceleration_max=1e12)


@pytest.fixture(scope="module")
def drawer() -> Plan:
    return plan(ROBOT, make_job(ROBOT, "pull-line", {}))


class TestPoints:
    def test_of_the_drawer_pull(self, drawer: Plan) -> None:
        assert drawer.times_ms.tolist() == list(range(0, 10_001, 10))
        assert drawer.records()[0].durations_ms == [10] * 1000
        t_s = drawer.times_ms / 1000
        units = drawer.motion.positions(t_s) * [81920, 327680, 655360, *[200 * 16384 / 72] * 2, 200 * 16384 / 120]
        assert np.abs(drawer.points_units - units).max() <= 0.5 + 1e-6
        assert drawer.start_units == [0, 0, 65_536_000, 0, 2_730_667, 819_200]
        assert drawer.start_joints == pytest.approx([0, 0, 100, 0, 60, 30])
        per_ms = drawer.motion.velocities(t_s) * ROBOT.wire_units_per_unit * 64 / 1000
        assert np.abs(drawer.velocities - per_ms).max() <= 0.5 + 1e-6
        assert not drawer.velocities[[0, -1]].any()

    def test_displacements_are_differences_of_rounded_positions(self, drawer: Plan) -> None:
        for axis in range(6):
            displacements, end_velocities, durations_ms = drawer.records()[axis]
            assert len(displacements) == len(end_velocities) == len(durations_ms) == 1000
            assert sum(displacements) == drawer.points_units[-1, axis] - drawer.points_units[0, axis]
            assert end_velocities == drawer.velocities[1:, axis].tolist()

    def test_breakpoints_and_the_end_are_points(self) -> None:
        planned = plan(ROBOT, moved_by(Trapezoid(1.0, 0.107, 0.033)), 25)
        assert planned.times_ms.tolist() == [0, 25, 33, 50, 74, 75, 100, 107]
        assert planned.records()[0].durations_ms == [25, 8, 17, 24, 1, 25, 7]

    @pytest.mark.parametrize("point_ms", [1, 255])
    def test_the_widest_choice_of_durations(self, point_ms: int) -> None:
        durations = plan(ROBOT, swing(5.0), point_ms).records()[0].durations_ms
        assert max(durations) == point_ms
        assert sum(durations) == 1000

    @pytest.mark.parametrize("point_ms", [0, 256, -1])
    def test_no_other_durations(self, point_ms: int) -> None:
        assert complaint(swing(5.0), point_ms=point_ms) == f"{point_ms} ms between points is not from 1 to 255 ms"

    def test_halves_are_rounded_up(self) -> None:
        """On absolute positions: -0.5, 0.5 and 1.5 units become 0, 1 and 2."""
        unit = 1 / ROBOT.wire_units_per_unit[0]
        for units, rounded in ((0.5, 1), (1.5, 2), (2.4999, 2)):
            still = one_joint(lambda t, units=units: np.full_like(t, units * unit), zero, axis=0)  # type: ignore[misc]
            assert plan(ROBOT, still).points_units[:, 0].tolist() == [rounded] * 101

    def test_they_are_read_only(self, drawer: Plan) -> None:
        for array in (drawer.times_ms, drawer.points_units, drawer.velocities):
            with refusing(ValueError):
                array[0] = 1

    @pytest.mark.slow
    @settings(max_examples=40, deadline=None)
    @given(
        distance=st.floats(-100.0, 100.0),
        ramp_ms=st.integers(400, 900),
        steady_ms=st.integers(0, 900),
        point_ms=st.integers(1, 255),
    )
    def test_nothing_drifts(self, distance: float, ramp_ms: int, steady_ms: int, point_ms: int) -> None:
        law = Trapezoid(distance, (2 * ramp_ms + steady_ms) / 1000, ramp_ms / 1000)
        planned = plan(endless("th1"), moved_by(law), point_ms)
        assert np.all(np.diff(planned.times_ms) >= 1)
        assert np.all(np.diff(planned.times_ms) <= point_ms)
        assert sum(planned.records()[TH1].durations_ms) == 2 * ramp_ms + steady_ms
        running = planned.start_units[TH1] + np.cumsum(planned.records()[TH1].displacements_units)
        exact = moved_by(law).positions(planned.times_ms[1:] / 1000)[:, TH1] * ROBOT.wire_units_per_unit[TH1]
        assert np.abs(running - exact).max() <= 0.5 + 1e-6
        assert planned.velocities[0, TH1] == planned.velocities[-1, TH1] == 0


class TestJointLimits:
    """th1 within +-120 deg, home at 0."""

    def test_both_sides_of_the_limit(self) -> None:
        assert plan(ROBOT, swing(60.0, 4.0)).points_units[:, TH1].max() == 120 * 200 * 16384 // 72
        told = complaint(swing(60.5, 4.0))
        assert told.startswith("th1: 120.0")
        assert told.endswith("is outside -120..120 deg, by up to 1 deg; the nearest is 120 deg")

    def test_the_lower_one(self) -> None:
        assert plan(ROBOT, swing(-60.0, 4.0)).times_ms[-1] == 4000
        assert complaint(swing(-60.001, 4.0)).startswith("th1: -120.0")

    def test_between_two_points(self) -> None:
        """Points every 250 ms miss the bump between them; the checks' grid of 1 ms sees it."""
        bump = one_joint(lambda t: 121 * np.exp(-(((t - 0.125) / 0.01) ** 2)) * (t > 0), zero)
        assert complaint(bump, point_ms=250).endswith(
            "s is outside -120..120 deg, by up to 1 deg; the nearest is 120 deg"
        )

    def test_a_tiny_excess_is_not_shown_as_the_limit(self) -> None:
        assert complaint(swing(60.0000001, 4.0)).startswith("th1: 120.0000002 deg at t = 2.000 s")


class TestSpeed:
    def test_both_sides(self) -> None:
        """120 deg/s in both cases, once from the trajectory's own velocity alone."""
        assert plan(ROBOT, moved_by(Trapezoid(96.0, 1.0, 0.2))).times_ms[-1] == 1000
        told = complaint(moved_by(Trapezoid(96.1, 1.0, 0.2)))
        assert told.startswith("th1: a speed of 120.1 deg/s at t = 0.200 s is more than 120.0 deg/s; ")
        assert told.endswith("; 1.002 times slower passes (stretch=1.002)")

    def test_backwards(self) -> None:
        assert complaint(moved_by(Trapezoid(-96.1, 1.0, 0.2))).startswith("th1: a speed of 120.1 deg/s")

    def test_a_linear_joint(self) -> None:
        told = complaint(moved_by(Trapezoid(40.04, 2.0, 1.0), axis=2))
        assert told.startswith("L1: a speed of 40.04 mm/s at t = 1.000 s is more than 40.00 mm/s; ")
        assert told.endswith("; 1.001 times slower passes (stretch=1.001)")


class TestAcceleration:
    """720 deg/s^2 at th1, as the mean over each millisecond."""

    def test_at_the_limit_and_beyond(self) -> None:
        """S / ((T - t1) t1) = 720: rounding does not push a law made for the limit over it."""
        at_limit = Trapezoid(720 * 0.5 * 0.1, 0.6, 0.1)
        assert plan(ROBOT, moved_by(at_limit)).times_ms[-1] == 600
        told = complaint(moved_by(Trapezoid(36.01, 0.6, 0.1)))
        assert told.startswith("th1: a mean acceleration over 1 ms of 720.2 deg/s^2 at t = 0.0")
        assert "s is more than 720.0 deg/s^2; " in told

    @pytest.mark.slow
    def test_a_jump_of_speed(self) -> None:
        """100 deg/s from one millisecond to the next: 100 000 deg/s^2."""
        jump = one_joint(
            lambda t: 100 * np.clip(t - 0.5, 0, 0.1), lambda t: np.where((t > 0.5) & (t < 0.6), 100.0, 0.0)
        )
        assert complaint(jump).startswith("th1: a mean acceleration over 1 ms of 100000.0 deg/s^2 at t = 0.")


class TestStepRate:
    """At th1, 15 kHz are 337.5 deg/s."""

    @pytest.mark.parametrize("side", [-1, 1])
    def test_both_sides(self, side: int) -> None:
        """At constant acceleration the cubics are exact and the hull is the speed itself."""
        fastest = plan(endless("th1"), moved_by(law_of(side * 337.4))).velocities[:, TH1]
        assert np.abs(fastest).max() == pytest.approx(337.4 * SPU_TH1 * 1024 * 64 / 1000, abs=1)
        told = complaint(moved_by(law_of(side * 338.0)), endless("th1"))
        assert told.startswith("th1: 15.02 kHz of steps at t = 0.2")
        assert " s is more than the driver's 15.00 kHz; " in told

    def test_it_is_the_drivers_own_limit(self) -> None:
        slow = dataclasses.replace(ROBOT, board=dataclasses.replace(ROBOT.board, step_rate_max_hz=4000))
        assert "is more than the driver's 4.0 kHz; " in complaint(moved_by(law_of(100.0)), slow)
        assert plan(slow, moved_by(law_of(89.9))).velocities.any()

    def test_long_segments_are_judged_as_the_firmware_judges_them(self) -> None:
        """Judged by its Bernstein coefficients, a sine of 14.04 kHz with a point every 200 ms has 15.9 kHz."""
        sine = swing(316 / (2 * np.pi), 1.0)
        assert plan(endless("th1"), sine, 10).velocities.any()
        assert complaint(sine, endless("th1"), 200).startswith("th1: 15.9 kHz of steps at t = 0.200 s")

    def test_the_firmware_agrees_to_the_last_bit(self) -> None:
        """The values that the kernel's `push` computes in Q16 steps, computed again here, are within its limit."""
        planned = plan(endless("th1"), moved_by(law_of(337.49)), 7)
        tail = 0
        for d, end, dt in zip(*planned.records()[3], strict=True):
            distance, a, e = d * 16 << 2, (tail * dt * 16 + 8) >> 4, (end * dt * 16 + 8) >> 4
            assert max(abs(a), abs(3 * distance - a - e), abs(e)) <= 983_040 * dt  # 15 steps/ms
            tail = end


class TestWire:
    """With full steps the limits of i24 are in reach: 512 full steps per segment, 8 full steps per millisecond."""

    def robot(self) -> Robot:
        """Return a robot with a slide of 10 full steps per mm and a fast driver."""
        board = dataclasses.replace(ROBOT.board, step_rate_max_hz=125e3, steplen_ns=4000, stepspace_ns=4000)
        slide = with_joint("sx", transmission=Transmission(200, 1, 20.0), speed_max=1e9, acceleration_max=1e12)
        return dataclasses.replace(slide, board=board)

    @pytest.mark.parametrize(("speed_mm_s", "fits"), [(799.9, True), (800.1, False)])
    def test_velocity(self, speed_mm_s: float, fits: bool) -> None:
        motion = moved_by(Trapezoid(speed_mm_s * 0.8, 1.0, 0.2), axis=0)
        if fits:
            assert plan(self.robot(), motion).velocities.max() < 1 << 23
        else:
            told = complaint(motion, self.robot())
            assert told.startswith("sx: a velocity of 8389657 1/64 unit per ms at t = 0.200 s does not fit")
            assert "-8388608..8388607; " in told

    @pytest.mark.parametrize(("speed_mm_s", "fits"), [(200.0, True), (201.0, False)])
    def test_displacement(self, speed_mm_s: float, fits: bool) -> None:
        """The limit is 51.2 mm per segment: 200 mm/s for 255 ms are 51 mm, 201 mm/s are 51.255 mm."""
        motion = moved_by(Trapezoid(speed_mm_s * 1.755, 2.04, 0.285), axis=0)
        if fits:
            assert max(plan(self.robot(), motion, 255).records()[0].displacements_units) < 1 << 23
        else:
            told = complaint(motion, self.robot(), point_ms=255)
            assert told.startswith("sx: a displacement of 8397619 units at t = 0.510 s does not fit")

    @pytest.mark.slow
    def test_a_velocity_beyond_every_integer(self) -> None:
        """Near a singular pose speeds can be any finite number; they must not wrap when they become integers."""
        absurd = one_joint(zero, lambda t: np.where((t > 0) & (t < 1), 1e300, 0.0))
        assert "does not fit a PVT record" in complaint(absurd)


class TestShape:
    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_every_value_is_finite(self, bad: float) -> None:
        position = one_joint(lambda t: np.where(t == 0.123, bad, 0.0), zero)
        assert complaint(position).startswith("th1: at t = 0.123 s the position is ")
        velocity = one_joint(zero, lambda t: np.where(t == 0.5, bad, 0.0))
        assert "must be finite" in complaint(velocity)

    @pytest.mark.parametrize(("when", "t_s"), [("starts at t = 0.000 s", 0.0), ("ends at t = 1.000 s", 1.0)])
    def test_it_starts_and_ends_at_rest(self, when: str, t_s: float) -> None:
        moving = one_joint(zero, lambda t: np.where(t == t_s, 0.25, 0.0))
        assert complaint(moving) == f"th1: the motion {when} with 0.25 deg/s instead of 0 deg/s, at rest"
        nearly = one_joint(zero, lambda t: np.where(t == t_s, 1e-10, 0.0))
        assert not plan(ROBOT, nearly).velocities.any()

    @pytest.mark.parametrize("names", [("sx",), ROBOT.joint_names[::-1]])
    def test_it_moves_the_robots_joints(self, names: tuple[str, ...]) -> None:
        told = complaint(swing(5.0, joint_names=names))  # type: ignore[arg-type]
        assert told.startswith(f"the trajectory moves the joints {' '.join(names)}, but warehouse-scara has sx sz L1")

    @pytest.mark.parametrize(
        ("duration_s", "breakpoints_s"),
        [
            (1.0005, ()),
            (0.0, ()),
            (-1.0, ()),
            pytest.param(float("inf"), (), id="endless"),
            (1.0, (0.5, 0.1234)),
            (1.0, (1.001,)),
        ],
    )
    def test_its_times_are_whole_milliseconds(self, duration_s: float, breakpoints_s: Sequence[float]) -> None:
        complaint(one_joint(zero, zero, duration_s, tuple(breakpoints_s)))

    def test_the_shortest_motion(self) -> None:
        assert plan(ROBOT, one_joint(zero, zero, 0.001)).records()[0].durations_ms == [1]


def by_speeds(nodes_s: Sequence[float], speeds: Sequence[float], breakpoints_s: tuple[float, ...] = ()) -> Motion:
    """Return a motion whose speed is straight between nodes."""
    at_s, at = np.array(nodes_s), np.array(speeds)
    ways = np.concatenate([[0.0], np.cumsum(np.diff(at_s) * (at[1:] + at[:-1]) / 2)])

    def velocity(t_s: FloatArray) -> FloatArray:
        return np.asarray(np.interp(t_s, at_s, at))

    def position(t_s: FloatArray) -> FloatArray:
        i = np.clip(np.searchsorted(at_s, t_s, side="right") - 1, 0, len(at_s) - 2)
        return np.asarray(ways[i] + (t_s - at_s[i]) * (at[i] + velocity(t_s)) / 2)

    return one_joint(position, velocity, float(at_s[-1]), breakpoints_s)


class TestBetweenPoints:
    """What the board executes are cubics between points every 10 ms: they are judged, too."""

    LIMIT = ROBOT.joints[TH1]

    def late_stop(self, acceleration: float, breakpoints_s: tuple[float, ...] = ()) -> Motion:
        """Return a motion that speeds up in the first half of a record and slows down in the second half of another."""
        speed = 0.005 * acceleration
        return by_speeds([0.0, 0.005, 0.095, 0.1], [0.0, speed, speed, 0.0], breakpoints_s)

    def test_an_acceleration_that_jumps_between_two_points(self) -> None:
        """From rest, with a T^2 3/8 and a T/2 at its end, a cubic begins with 5/4 a and loses 3/2 a."""
        limit = self.LIMIT.acceleration_max
        mean = 0.9 * limit * (1.25 - 1.5 * 0.05)
        text = complaint(self.late_stop(0.9 * limit))
        assert text.startswith(f"th1: a mean acceleration over 1 ms of {mean:.1f} deg/s^2 at t = ")
        assert "times slower passes" in text

    def test_both_sides_and_the_same_jump_at_a_point(self) -> None:
        limit = self.LIMIT.acceleration_max
        plan(ROBOT, self.late_stop(limit / (1.25 - 1.5 * 0.05)))
        assert "acceleration" in complaint(self.late_stop(1.001 * limit / (1.25 - 1.5 * 0.05)))
        plan(ROBOT, self.late_stop(limit, (0.005, 0.095)))

    @pytest.mark.parametrize(("below", "passes"), [(0.0, False), (0.2, False), (0.25, True)])
    def test_a_speed_between_two_points(self, below: float, passes: bool) -> None:
        """A hump of a T/6 between two points has the mean height of a T 5/36, and its cubic is 3/2 of this high."""
        limit, hump = self.LIMIT.speed_max - below, self.LIMIT.acceleration_max * 0.01 / 6
        ramp_s = 0.5
        nodes_s = [0.0, ramp_s, 0.6, 0.6 + 0.01 / 6, 0.6 + 0.05 / 6, 0.61, 0.7, 0.7 + ramp_s]
        motion = by_speeds(nodes_s, [0.0, *[limit - hump] * 2, limit, limit, *[limit - hump] * 2, 0.0], (ramp_s, 0.7))
        if passes:
            plan(ROBOT, motion)
        else:
            assert complaint(motion).startswith(f"th1: a speed of {limit + hump / 4:.1f} deg/s at t = 0.600 s is more")


class TestStart:
    """Half a step is 0.01125 deg at th1 and 0.01875 deg at th3."""

    @pytest.mark.parametrize(("axis", "half_step"), [(0, 0.0125), (2, 0.0015625), (3, 0.01125), (5, 0.01875)])
    @pytest.mark.parametrize("side", [-1, 1])
    def test_both_sides(self, drawer: Plan, axis: int, half_step: float, side: int) -> None:
        board = list(drawer.start_joints)
        start = board[axis]
        board[axis] = start + side * 0.999 * half_step
        drawer.check_start(board)
        board[axis] = start + side * 1.01 * half_step
        joint = ROBOT.joints[axis]
        told = complaint_of(lambda: drawer.check_start(board))
        assert told.startswith(f"{joint.name}: the trajectory starts at {start:.4f} {joint.unit}, the board stands at ")
        assert f"{board[axis]:.4f} {joint.unit}" in told


def test_planning_the_drawer_pull_takes_little_work() -> None:
    """One position and one velocity for each of 20 001 milliseconds, and no loop over milliseconds or points."""
    motion, law = counting(make_job(ROBOT, "pull-line", {"duration_s": "20"}))
    points = len(plan(ROBOT, motion).times_ms)
    assert points == 2001
    assert law.instants == 2 * 20_001
    assert function_calls(lambda: plan(ROBOT, motion)) < points
