"""Measure motions as fast as the limits or the motors allow: beside the optimum of their path, and by their rotors.

The corners that motions pass are measured, too, and no rotor may lose a step.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.features.fastest.chain import timed_chains
from steptwin.features.fastest.corners import JointLeg, MotionLeg, ToolLeg, flowing
from steptwin.features.fastest.executed import timed
from steptwin.features.fastest.pieces import FollowedPath
from steptwin.features.fastest.solve import fastest_squares
from steptwin.features.motors.limits import motor_limits
from steptwin.features.motors.turning import motors_of_run
from steptwin.features.motors.turning.after_run import first_slip
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.drives import DriveAnswer
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import Arc, StraightLine, ToolPath
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute

ROBOT: Final = load_robot("teaching-scara")
PICK: Final = np.array([[0.0, 90, 50, 0], [0, 90, 5, 0], [-60, 60, 5, 20], [-60, 60, 50, 20]])
"""A pick and place: up, over, down."""
GLUE_START: Final[tuple[float, ...]] = (172.0, -55.0, -70.0, 0.0)
CORNERS: Final = 10_000
LEFT_PERCENT: Final = 30.0
RANDOM: Final = 200
"""Number of random picks and places."""
LAB: Final = load_robot("lab-scara")

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


def motions_table() -> Table:
    """Measure a pick and place, stopped and rounded, and a path of glue of lines and tangential arcs."""
    return bench_table(
        "As fast as the limits allow: teaching-scara, processor time of one core",
        "motion|averaged s|lasts s|x optimum of its path|at the tool's speed %|planned in ms|ms for 10 s",
        (*_picks(), *_glues()),
    )


def gcode_table() -> Table:
    """Measure how long parts of G-code take to be read and planned, on one core."""
    return bench_table("G-code: teaching-scara", "part|lines|lasts s|planned in s", (_part(400, 5), _part(20_000, 160)))


def _part(lines: int, turns: int) -> str:
    """Return the row of a part: a pocket milled by a spiral of short lines."""
    text = ["G21 G90 G17 G64 P0.02 Q0.01", "G0 X0 Y0 Z3", "G1 Z0 F900"]
    for i in range(lines):
        angle, r_mm = 2.0 * np.pi * turns * i / lines, 4.0 + 26.0 * i / lines
        text.append(f"G1 X{r_mm * np.cos(angle):.4f} Y{0.7 * r_mm * np.sin(angle):.4f} F3000")
    with TemporaryDirectory() as folder:
        (Path(folder) / "part.ngc").write_text("\n".join(text), encoding="utf-8")
        for _ in range(2):  # the first time compiles
            begin_s = process_time()
            compiled = compile_program(parse_program(_PART, Findings(), Path(folder)), ROBOT)
            took_s = process_time() - begin_s
    return f"pocket|{lines}|{compiled.motion.duration_s:.3f}|{took_s:.2f}"


_PART: Final = """
start = { x = 130.0, y = 0.0, z = -50.0, phi = 0.0, branch = "right" }
[frames.plate]
x = 130.0
y = 0.0
z = -60.0
[[step]]
gcode = "part.ngc"
frame = "plate"
"""


def corners_text() -> str:
    """Measure how far random corners of lines are passed from where the formula says."""
    random = np.random.default_rng(1)
    start = np.array([20.0, 105.0, 30.0, 0.0])
    kinematics = make_kinematics(ROBOT)
    pose = kinematics.forward(start[np.newaxis])[0]
    branch, worst = present_branch(ROBOT, start), 0.0
    for _ in range(CORNERS):
        ways = random.uniform(-1.0, 1.0, (2, 3)) * [16.0, 16.0, 6.0]
        ways *= np.maximum(1.0, 8.0 / np.linalg.norm(ways, axis=1))[:, np.newaxis]
        r_mm = random.uniform(0.2, 0.9) * np.linalg.norm(ways, axis=1).min()
        places = np.vstack([pose[:3], pose[:3] + np.cumsum(ways, axis=0)])
        legs, joints = list[MotionLeg](), start
        for begin, end in pairwise(places):
            path = StraightLine((*begin.tolist(), float(pose[3])), (*end.tolist(), float(pose[3])))
            legs.append(ToolLeg(FollowedPath.along(ROBOT, path, branch, joints), Pace()))
            joints = legs[-1].followed.end  # type: ignore[attr-defined]
        turn = np.linalg.norm(np.diff(ways / np.linalg.norm(ways, axis=1)[:, np.newaxis], axis=0))
        worst = max(worst, abs(flowing(ROBOT, legs, [r_mm]).corners[0].passes_mm - 3 / 16 * r_mm * turn))
    return f"{CORNERS} random corners of lines pass where the formula says, to {worst:.4f} mm (promised: 0.01 mm)"


def _picks() -> Iterator[str]:
    composer = Composer(ROBOT, PICK[0])
    for goal in PICK[1:]:
        composer.go(goal)
    yield f"pick, S-curves at 80 %, stops|0.1|{composer.now_s:.3f}|-|-|-|-"
    legs = [JointLeg(ROBOT, start, goal, Pace()) for start, goal in pairwise(PICK)]
    stops_s = sum(timed_chains(ROBOT, [leg], [])[0].timed.law.duration_s for leg in legs)
    yield f"pick, stops|0.05|{stops_s:.3f}|-|-|-|-"
    for r_mm, average_s in ((20.0, 0.02), (20.0, 0.05), (10.0, 0.02), (10.0, 0.05), (2.0, 0.05)):
        yield _row(f"pick, corners of {r_mm:g} mm", legs, [r_mm, r_mm], average_s)


def _glues() -> Iterator[str]:
    for speed_mm_s, average_s in ((60.0, 0.02), (60.0, 0.05), (120.0, 0.02), (120.0, 0.05), (250.0, 0.05)):
        legs = glue_legs(Pace(100.0, speed_mm_s))
        yield _row(f"glue of 343 mm at {speed_mm_s:g} mm/s", legs, [0.0] * (len(legs) - 1), average_s, speed_mm_s)


def glue_legs(pace: Pace) -> list[ToolLeg]:
    """Return three lines of 100, 80 and 100 mm with quarter circles of 20 mm radius between them."""
    here: tuple[float, ...] = GLUE_START
    branch, legs = "right", list[ToolLeg]()
    joints = make_kinematics(ROBOT).solve(np.array([here]), branch, np.array(ROBOT.home)).joints[0]

    def add(path: ToolPath) -> tuple[float, ...]:
        nonlocal joints
        legs.append(ToolLeg(FollowedPath.along(ROBOT, path, branch, joints), pace))
        joints = legs[-1].followed.end
        return tuple(path.poses(np.array([path.length_mm]))[0].tolist())

    here = add(StraightLine(here, (here[0], here[1] + 100.0, *here[2:])))
    here = add(Arc.around(here, (here[0] - 20.0, here[1]), 90.0, turned=False))
    here = add(StraightLine(here, (here[0] - 80.0, *here[1:])))
    here = add(Arc.around(here, (here[0], here[1] - 20.0), 90.0, turned=False))
    add(StraightLine(here, (here[0], here[1] - 100.0, *here[2:])))
    return legs


def _row(
    name: str, legs: list[JointLeg] | list[ToolLeg], radii_mm: list[float], average_s: float, speed_mm_s: float = 0.0
) -> str:
    begin_s = process_time()
    path = flowing(ROBOT, legs, radii_mm).path
    found = timed(ROBOT, path, average_s)
    took_s = process_time() - begin_s
    rates = path.rates()
    lasts_s = found.law.duration_s
    optimum_s = _duration_s(rates.s, fastest_squares(rates.s, path.limits().rows(ROBOT, rates)))
    share = f"{_share_at(found.law.at, path.tool, lasts_s, speed_mm_s):.1f}" if speed_mm_s else "-"
    return (
        f"{name}|{average_s:g}|{lasts_s:.3f}|{lasts_s / optimum_s:.3f}|{share}|{1000 * took_s:.0f}"
        f"|{1000 * took_s * 10.0 / lasts_s:.0f}"
    )


def _duration_s(s: FloatArray, squares: FloatArray) -> float:
    """Return how long a motion takes with the squares of its speeds at places, both of shape (n,)."""
    roots, steps = np.sqrt(squares), np.diff(s)
    moved = steps > 0
    return float((2.0 * steps[moved] / (roots[:-1] + roots[1:])[moved]).sum())


_Law = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
_Tool = Callable[[FloatArray], FloatArray]


def _share_at(law: _Law, tool: _Tool, lasts_s: float, speed_mm_s: float) -> float:
    """Return the percentage of the time at which the tool's speed is within 1.7 % of the wanted one."""
    s, rate = law(np.arange(0.0, lasts_s, 0.001))
    speeds = tool(s)[:, 0] * rate
    return float(100.0 * np.mean(np.abs(speeds - speed_mm_s) < 0.017 * speed_mm_s))


def _pick(robot: Robot, places: FloatArray, blend_mm: float, left: float) -> tuple[Motion, list[DriveAnswer]]:
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
    return made.motion, [row.drives for row in made.steps if row.drives]


def _position(robot: Robot, at: FloatArray) -> str:
    return ", ".join(f"{joint} = {value:.3f}" for joint, value in zip(robot.joint_names, at, strict=True))


def motor_limited_table() -> Table:
    """Measure the laboratory's spiral and a pick and place, and one of the classroom's arm with raised limits."""
    raised = replace(
        ROBOT,
        joints=tuple(replace(each, acceleration_max=3000.0 if each.unit == "mm" else 9000.0) for each in ROBOT.joints),
    )
    lab = np.array([[80.0, -45, 60, 0], [140.0, -45, 60, 0], [140.0, 45, 60, 0], [80.0, 45, 60, 0]])
    desk = np.array([[0.0, 90, 25, 0], [0, 90, 5, 0], [-60, 60, 5, 20], [-60, 60, 25, 20]])
    return bench_table(
        "As fast as the motors manage, 30 % of their torque left",
        "motion|lasts s|left %|rotors behind by deg|slips at stretch|planned in s",
        (
            _motor_row("lab-scara spiral, 18.8 s in the paper", LAB, lambda: (_spiral(), [])),
            _motor_row("lab-scara, pick and place, corners of 20 mm", LAB, lambda: _pick(LAB, lab, 20.0, LEFT_PERCENT)),
            _motor_row(
                "teaching-scara, pick and place, raised accelerations",
                raised,
                lambda: _pick(raised, desk, 20.0, LEFT_PERCENT),
            ),
        ),
    )


def _spiral() -> Motion:
    return make_job(LAB, "spiral", {"law": "fastest"}, drives=motor_limits(LAB, LEFT_PERCENT))


def _motor_row(name: str, robot: Robot, make: Callable[[], tuple[Motion, list[DriveAnswer]]]) -> str:
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
