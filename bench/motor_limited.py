"""Measure motions as fast as the motors manage, and let their rotors turn: none may lose a step."""

from collections.abc import Callable
from dataclasses import replace
from time import process_time
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.fastest import DriveAnswer
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.motor_limits import motor_limits
from steptwin.host.twin.motors import motors_of_run
from steptwin.host.twin.motors.after_run import first_slip

LEFT_PERCENT: Final = 30.0
RANDOM: Final = 200
"""Number of random picks and places."""
LAB: Final = load_robot("lab-scara")
TEACHING: Final = load_robot("teaching-scara")

_PICK: Final = """
law = "fastest"
start = "{0[0]}"
[limits]
from = "motors"
left_percent = {left:g}
[positions]
{positions}
{steps}
"""


def _pick(robot: Robot, places: FloatArray, blend_mm: float, left: float) -> tuple[Trajectory, list[DriveAnswer]]:
    """Return a pick and place through positions of the joints, corners rounded, and what the motors say of it."""
    names = [f"p{i}" for i in range(len(places))]
    positions = "\n".join(f"{name} = {{ {_position(robot, at)} }}" for name, at in zip(names, places, strict=True))
    blends = [f"blend_mm = {blend_mm:g}"] * (len(names) - 2) + [""]
    steps = "\n".join(
        f'[[step]]\ngo = "{name}"\nspeed_percent = 100.0\n{blend}'
        for name, blend in zip(names[1:], blends, strict=True)
    )
    program = parse_program(_PICK.format(names, left=left, positions=positions, steps=steps), Findings())
    made = compile_program(program, robot, drives=motor_limits)
    return made.trajectory, [row.drives for row in made.steps if row.drives]


def _position(robot: Robot, at: FloatArray) -> str:
    return ", ".join(f"{joint} = {value:.3f}" for joint, value in zip(robot.joint_names, at, strict=True))


def motor_limited_table() -> Table:
    """Measure the laboratory's spiral and a pick and place, and one of the classroom's arm with raised limits."""
    raised = replace(
        TEACHING,
        joints=tuple(
            replace(each, acceleration_max=3000.0 if each.unit == "mm" else 9000.0) for each in TEACHING.joints
        ),
    )
    lab = np.array([[80.0, -45, 60, 0], [140.0, -45, 60, 0], [140.0, 45, 60, 0], [80.0, 45, 60, 0]])
    desk = np.array([[0.0, 90, 25, 0], [0, 90, 5, 0], [-60, 60, 5, 20], [-60, 60, 25, 20]])
    return bench_table(
        "As fast as the motors manage, 30 % of their torque left",
        "motion|lasts s|left %|rotors behind by deg|slips at stretch|planned in s",
        (
            _row("lab-scara spiral, 18.8 s in the paper", LAB, lambda: (_spiral(), [])),
            _row("lab-scara, pick and place, corners of 20 mm", LAB, lambda: _pick(LAB, lab, 20.0, LEFT_PERCENT)),
            _row(
                "teaching-scara, pick and place, raised accelerations",
                raised,
                lambda: _pick(raised, desk, 20.0, LEFT_PERCENT),
            ),
        ),
    )


def _spiral() -> Trajectory:
    return make_job(LAB, "spiral", {"law": "fastest"}, drives=motor_limits(LAB, LEFT_PERCENT))


def _row(name: str, robot: Robot, make: Callable[[], tuple[Trajectory, list[DriveAnswer]]]) -> str:
    make()  # compiles
    begin_s = process_time()
    motion, _ = make()
    took_s = process_time() - begin_s
    run = motors_of_run(robot, execute(plan(robot, motion), name).comparison)
    if not run.verdict.kept_step:
        raise ValueError(f"{name}: loses steps")
    left = 100.0 * float(run.torques.margins.min())
    behind = float(np.abs(run.trace.load_deg).max())
    stretches = [each / 100 for each in range(87, 49, -1)]
    slips = next((f"{each:.2f}" for each in stretches if first_slip(run.driving.stretched(each))), "-")
    return f"{name}|{motion.duration_s:.3f}|{left:.0f}|{behind:.0f}|{slips}|{took_s:.2f}"


def random_text() -> str:
    """Turn the rotors by random picks and places of the laboratory's arm, as planned and in 0.6 of the time."""
    random = np.random.default_rng(1)
    lower, upper = np.array([30.0, -100.0, -100.0, -180.0]), np.array([180.0, 100.0, 100.0, 180.0])
    kept = slipped = refused = 0
    for _ in range(RANDOM):
        at, to = random.uniform(lower, upper, (2, 4))
        lift_mm = random.uniform(20.0, 60.0)
        lift = np.array([lift_mm, 0.0, 0.0, 0.0])
        lifted, over = at + lift, np.array([at[0] + lift_mm, *to[1:]])
        places = np.array([at, lifted, over, over - lift])
        try:
            motion, _ = _pick(LAB, places, 5.0, LEFT_PERCENT)
        except InputError:
            refused += 1
            continue
        run = motors_of_run(LAB, execute(plan(LAB, motion), "pick").comparison)
        kept += run.verdict.kept_step
        slipped += first_slip(run.driving.stretched(0.6)) is not None
    return (
        f"{RANDOM} random picks and places of lab-scara as fast as its motors manage: {refused} are refused, {kept}"
        f" keep step; in 0.6 of their time {slipped} lose steps"
    )
