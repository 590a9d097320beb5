"""Motions that touch a joint's limit: between its knots one may be a fiftieth of a step beyond, and nowhere farther."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.findings import Findings
from steptwin.host.planning.checks import OutsideError, check_positions
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import hermite_spline
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot

TEACHING = load_robot("teaching-scara")


def program_at_limit(robot: Robot, seed: int) -> str:
    """Return a program through two corners at which one joint is at a limit, and the others anywhere."""
    rng = np.random.default_rng(seed)
    at, is_upper = int(rng.integers(len(robot.joints))), bool(rng.integers(2))

    def row(*, touches: bool) -> str:
        parts = [joint.lower + rng.uniform(0.1, 0.9) * (joint.upper - joint.lower) for joint in robot.joints]
        if touches:
            parts[at] = robot.joints[at].upper if is_upper else robot.joints[at].lower
        return ", ".join(f"{name} = {value!r}" for name, value in zip(robot.joint_names, parts, strict=True))

    rows = [f"[[step]]\ngo = {{ {row(touches=True)} }}\nblend_mm = {rng.uniform(2.0, 15.0):.1f}\n" for _ in range(2)]
    end = f"[[step]]\ngo = {{ {row(touches=False)} }}\n"
    return f"start = {{ {row(touches=False)} }}\n{''.join(rows)}{end}"


@pytest.mark.parametrize("seed", range(6))
def test_roundings_that_touch_a_limit_are_planned_and_keep_it_to_a_fiftieth_of_a_step(seed: int) -> None:
    robot = TEACHING if seed % 2 else load_robot("hybrid-arm")
    found = Findings()
    motion = compile_program(parse_program(program_at_limit(robot, seed), found), robot).motion
    assert not found.messages
    plan(robot, motion)
    joints = motion.positions(np.arange(0.0, motion.duration_s, 5e-4))
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.joints]).T
    beyond = np.maximum(joints - upper, lower - joints).max(axis=0)
    assert (beyond * np.abs(robot.steps_per_unit)).max() < 0.02  # neither robot's joints are coupled


@pytest.mark.parametrize(("name", "joint"), [("teaching-scara", 2), ("corexy-gantry", 0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_between_knots_it_may_be_a_fiftieth_of_a_step_beyond_a_limit_and_at_them_not(
    name: str, joint: int, sign: int
) -> None:
    robot = load_robot(name)
    own, home = robot.joints[joint], np.array(robot.home, float)
    a_step = 1.0 / robot.steps_per_unit[joint]  # both belts of the gantry turn as far as its x

    def motion(steps: float, *, at_knot: bool) -> Motion:
        rows, velocities, times_s = np.stack([home, home, home]), np.zeros((3, len(home))), np.array([0.0, 0.1, 0.2])
        rows[:, joint] = own.upper if sign > 0 else own.lower
        rows[1, joint] += sign * steps * a_step
        rows[:, 1], velocities[:, 1] = home[1] + times_s, 1.0  # where all joints rest there is a knot, too
        whole = hermite_spline(robot.joint_names, times_s, rows, velocities)
        return whole if at_knot else replace(whole, breakpoints_s=())

    check_positions(robot, motion(0.019, at_knot=False))
    for steps, at_knot in ((0.021, False), (0.001, True)):
        with pytest.raises(OutsideError) as refused:
            check_positions(robot, motion(steps, at_knot=at_knot))
        assert refused.value.joint == own
