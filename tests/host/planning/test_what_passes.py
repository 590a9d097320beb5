"""What a refusal says would pass does pass, and hardly less does: each suggestion is run."""

import re
from dataclasses import replace
from math import floor, log10

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Cubic, Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import standstill
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint, Transmission
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")


def with_joints(robot: Robot, **joints: Joint) -> Robot:
    return replace(robot, joints=tuple(joints.get(joint.name, joint) for joint in robot.joints))


def tireless(robot: Robot) -> Robot:
    """Return the robot with joints whose motors could do anything: only the driver limits their speeds."""
    joints = {joint.name: replace(joint, speed_max=1e6, acceleration_max=1e9) for joint in robot.joints}
    return with_joints(robot, **joints)


class TestPositions:
    @pytest.mark.parametrize("joint", ROBOT.joints, ids=lambda joint: joint.name)
    @pytest.mark.parametrize("side", [-1, 1])
    def test_the_nearest_one(self, joint: Joint, side: int) -> None:
        i = ROBOT.joint_names.index(joint.name)

        def to(position: float) -> Motion:
            goal = [0.0, 10.0, 1.0, 0.0]
            goal[i] = position
            return joint_move(ROBOT.joint_names, (0.0, 10.0, 1.0, 0.0), tuple(goal), Cubic(1.0, 20.0))

        beyond = (joint.upper if side > 0 else joint.lower) + side * 0.123
        told = complaint_of(lambda: plan(ROBOT, to(beyond)))
        excess, near = re.findall(r"by up to (\S+) .*; the nearest is (\S+) ", told)[0]
        assert plan(ROBOT, to(float(near))).motion.duration_s == 20.0
        assert plan(ROBOT, to(beyond - side * float(excess))).motion.duration_s == 20.0
        complaint_of(lambda: plan(ROBOT, to(beyond - side * float(excess) * 0.99)))


def lift(distance_mm: float, duration_s: float) -> Motion:
    goal = (0.0, 10.0, distance_mm, 0.0)
    return joint_move(ROBOT.joint_names, (0.0, 10.0, 0.0, 0.0), goal, Trapezoid(1.0, duration_s, 0.1))


class TestDrives:
    """With motors that can do anything, the step rate alone is too high, and another drive would do."""

    def settings(self, robot: Robot, motion: Motion) -> dict[str, dict[str, float]]:
        """Return the keys and values for each joint that the refusal names."""
        told = complaint_of(lambda: plan(robot, motion))
        assert " kHz of steps at t = " in told
        joints = told.split(", and so does ", 1)[1].split(" and ")
        return {
            joint.split(".")[1]: {key: float(value) for key, value in re.findall(r"(\w+) = ([\d.]+)", joint)}
            for joint in joints
        }

    def refitted(self, robot: Robot, changes: dict[str, dict[str, float]]) -> Robot:
        joints = {}
        for name, keys in changes.items():
            old = robot.joint(name).transmission
            drive = Transmission(
                old.full_steps_per_rev,
                int(keys.get("microsteps", old.microsteps)),
                keys.get("travel_per_turn", old.travel_per_turn),
                keys.get("ratio", old.ratio),
            )
            joints[name] = replace(robot.joint(name), transmission=drive)
        return with_joints(robot, **joints)

    @pytest.mark.parametrize(("times_too_fast", "microsteps"), [(1.01, 8), (1.99, 8), (2.01, 2), (7.9, 2), (8.1, 1)])
    def test_the_microsteps(self, times_too_fast: float, microsteps: int) -> None:
        robot = tireless(with_joints(ROBOT, d3=self.sixteenths("d3")))
        per_mm = robot.joint("d3").transmission.steps_per_unit
        speed_mm_s = times_too_fast * robot.board.driver_rate_max_hz / per_mm
        motion = lift(60.0, round(60.0 / speed_mm_s + 0.1, 3))
        changes = self.settings(robot, motion)
        assert changes == {"d3": {"microsteps": microsteps}}
        plan(self.refitted(robot, changes), motion)
        more = {1: 2, 2: 8, 8: 16}[microsteps]
        complaint_of(lambda: plan(self.refitted(robot, {"d3": {"microsteps": more}}), motion))

    def sixteenths(self, name: str) -> Joint:
        joint = ROBOT.joint(name)
        return replace(joint, transmission=replace(joint.transmission, microsteps=16))

    def test_of_two_joints(self) -> None:
        robot = tireless(ROBOT)
        motion = joint_move(ROBOT.joint_names, (0.0,) * 4, (100.0, 90.0, 0.0, 0.0), Cubic(1.0, 0.2))
        changes = self.settings(robot, motion)
        assert set(changes) == {"th1", "th2"}
        plan(self.refitted(robot, changes), motion)

    @pytest.mark.parametrize(("name", "key", "duration_s"), [("d3", "travel_per_turn", 1.0), ("th1", "ratio", 0.15)])
    def test_the_lead_or_the_ratio_where_full_steps_are_too_many(self, name: str, key: str, duration_s: float) -> None:
        """The driver is a slow one: the wire's records could not tell 15 kHz of full steps."""
        robot = replace(tireless(ROBOT), board=replace(ROBOT.board, step_rate_max_hz=1000.0))
        goal = tuple(60.0 if joint == name else 0.0 for joint in ROBOT.joint_names)
        motion = joint_move(ROBOT.joint_names, (0.0,) * 4, goal, Cubic(1.0, duration_s))
        changes = self.settings(robot, motion)
        assert changes == {name: {"microsteps": 1, key: changes[name][key]}}
        plan(self.refitted(robot, changes), motion)
        hardly = {name: changes[name] | {key: changes[name][key] * (0.999 if name == "d3" else 1.001)}}
        complaint_of(lambda: plan(self.refitted(robot, hardly), motion))

    def test_no_drive_helps_motors_that_are_too_slow(self) -> None:
        told = complaint_of(lambda: plan(ROBOT, lift(60.0, 1.0)))
        assert told.startswith("d3: ")
        assert " kHz of steps at t = " in told
        assert "so does" not in told


class TestStretches:
    def test_a_motion_made_too_fast_is_told_the_stretch_of_itself(self) -> None:
        """The factor counts from the motion as it is, not from the one made faster."""
        slow = make_job(ROBOT, "carry", {"duration_s": "20"})
        told = complaint_of(lambda: plan_stretched(ROBOT, slow, 0.02))
        factor = float(told.rsplit("; stretch=", 1)[1].removesuffix(" passes"))
        assert 0.02 < factor < 1
        plan_stretched(ROBOT, slow, factor)
        complaint_of(lambda: plan_stretched(ROBOT, slow, factor - 0.001))

    def test_a_stretch_that_is_not_enough(self) -> None:
        fast = make_job(ROBOT, "carry", {"duration_s": "0.2"})
        first = complaint_of(lambda: plan(ROBOT, fast)).split("; ")[-1]
        told = complaint_of(lambda: plan_stretched(ROBOT, fast, 1.5))
        assert told.endswith(f"; {first}")
        plan_stretched(ROBOT, fast, float(first.rsplit("stretch=", 1)[1].removesuffix(")")))


class TestStepsOfPrograms:
    """Each key of a step that a refusal names is tried at its value, which passes, and hardly faster."""

    @pytest.mark.parametrize(
        ("step", "keys"),
        [
            ("go = { th1 = 90 }\nduration_s = 0.3", ["duration_s"]),
            ("go = { th1 = 90 }\nduration_s = 0.3\nlaw = 'quintic'", ["duration_s"]),
            ("line = { x = 60 }\nspeed_mm_s = 400", ["speed_mm_s", "ramp_s"]),
            pytest.param("line = { x = 60 }\nspeed_mm_s = 1200", ["speed_mm_s", "ramp_s"], marks=pytest.mark.slow),
            ("circle = { x = 90, y = 110 }\nspeed_mm_s = 1e4", ["speed_mm_s"]),
            pytest.param("by = { z = -50 }\nspeed_mm_s = 3000\nramp_s = 0.1", ["speed_mm_s"], marks=pytest.mark.slow),
            pytest.param(
                "repeat = 3\nsteps = [{ by = { x = -20 }, speed_mm_s = 900, ramp_s = 0.3 }]",
                ["speed_mm_s", "ramp_s"],
                marks=pytest.mark.slow,
            ),
            (
                "repeat = 2\nsteps = [{ line = { x = 60 }, speed_mm_s = 900, ramp_s = 0.2 }, { go = 's' }]",
                ["speed_mm_s"],
            ),
        ],
    )
    def test_the_values_of_a_step(self, step: str, keys: list[str]) -> None:
        (told,) = self.fast_steps(step)
        values = self.values(told)
        assert list(values) == keys
        for key, value in values.items():
            assert self.fast_steps(self.with_value(step, key, value)) == []
            digit = 0.001 if key == "duration_s" else 10.0 ** (floor(log10(value)) - 2)
            faster = value - digit if key in ("duration_s", "ramp_s") else value + digit
            assert len(self.fast_steps(self.with_value(step, key, round(faster, 9)))) == 1

    def test_the_percentage_where_the_driver_is_slower_than_the_joint(self) -> None:
        slow = replace(ROBOT, board=replace(ROBOT.board, step_rate_max_hz=3000.0))
        step = "go = { th1 = 90 }\nspeed_percent = 100"
        (told,) = self.fast_steps(step, slow)
        ((key, value),) = self.values(told).items()
        assert (key, self.fast_steps(self.with_value(step, key, value), slow)) == ("speed_percent", [])
        assert len(self.fast_steps(self.with_value(step, key, value + 0.1), slow)) == 1

    @pytest.mark.slow
    def test_all_steps_with_the_values_told_make_a_plan(self) -> None:
        """Every step that is too fast is told at once; the planner, too, names the first one and the stretch."""
        steps = ["line = { x = 60 }\nspeed_mm_s = 400", "go = { th1 = 90 }\nduration_s = 0.3", "pause = 0.1"]
        program = "\n[[step]]\n".join(steps)
        told = self.fast_steps(program)
        assert [message.split(" (")[0] for message in told] == ["step 1", "step 2"]
        compiled = self.compiled(program)
        with pytest.raises(InputError) as caught, compiled.explained():
            plan(ROBOT, compiled.motion)
        assert str(caught.value).startswith(f"{told[0]}; 1 more step is too fast; or the whole program: ")
        stretch = float(str(caught.value).rsplit("stretch=", 1)[1].removesuffix(")"))
        plan_stretched(ROBOT, compiled.motion, stretch)
        with refusing(InputError), compiled.explained(stretch - 0.01):
            plan_stretched(ROBOT, compiled.motion, stretch - 0.01)
        firsts = [next(iter(self.values(message).items())) for message in told]
        slower = [self.with_value(step, *first) for step, first in zip(steps, firsts, strict=False)]
        plan(ROBOT, self.compiled("\n[[step]]\n".join([*slower, steps[2]])).motion)

    def test_a_step_that_no_value_makes_slow_enough(self) -> None:
        slow = replace(ROBOT, board=replace(ROBOT.board, step_rate_max_hz=1.0))
        (told,) = self.fast_steps("by = { d3 = 10 }\nduration_s = 0.1", slow)
        assert told.endswith("; no duration_s alone passes")

    def compiled(self, step: str, robot: Robot = ROBOT) -> CompiledProgram:
        head = "start = { x = 107, y = 110, z = -40, phi = 70 }\n[positions]\ns = { x = 107 }\n[[step]]\n"
        return compile_program(parse_program(head + step, Findings()), robot)

    def fast_steps(self, step: str, robot: Robot = ROBOT) -> list[str]:
        return list(self.compiled(step, robot).fast_steps())

    def values(self, told: str) -> dict[str, float]:
        return {key: float(value) for key, value in re.findall(r"(\w+) = ([\d.e+-]+)(?= or | passes)", told)}

    def with_value(self, step: str, key: str, value: float) -> str:
        if f"{key} = " not in step:
            return f"{step}\n{key} = {value:.10g}"
        return re.sub(rf"{key} = [\d.e+-]+", f"{key} = {value:.10g}", step)


def test_a_pause_is_as_long_as_told() -> None:
    told = complaint_of(lambda: plan(ROBOT, standstill(ROBOT.joint_names, ROBOT.home, 0.3004)))
    near_s = float(told.rsplit("the nearest is ", 1)[1].removesuffix(" s"))
    assert plan(ROBOT, standstill(ROBOT.joint_names, ROBOT.home, near_s)).times_ms[-1] == 300
