"""Measure six-axis arms: their kinematics beside EAIK if it is installed, and programs of the AR4 from text to verdict.

The time is the processor time of one core, so that other programs count little. That of kinematics is the shortest of
all runs, in which the calculations take turns; ratios are to numpy's sine of as many values as joint values are read or
written. Beside the time of programs stands that of a bare bus, a loop of plain Python that passes as many frames on:
it says how fast the computer was meanwhile.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from statistics import median
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.bulk_speed import BATCH, best_s
from steptwin.bench.drawer_pull import bare_bus_s
from steptwin.controller.motion.backend import Kernel
from steptwin.features.arms.six_axis_arm import SixAxisArm
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.findings import Findings
from steptwin.host.common.processes import collect_seldom
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs.compiling import compile_program
from steptwin.host.planning.programs.program_file import parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry, axes_of
from steptwin.host.robots.poses.rotations import matrix
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify import compare, verify_comparison

MISS_MM: Final = 1.774
"""Distance of axis 5 from axis 4 in the arm without a closed form: as far as they miss each other in Arctos' URDF."""
NEAR_DEG: Final = 3.0
"""Standard deviation of the joints from which the numeric inverse starts."""
ALONE: Final = 500
"""Poses that EAIK solves one after the other, as its interface has them."""
_WANTED: Final = {"forward": 2e6, "all branches in closed form": 1e5, "from a near start": 1e4}
ROUNDS: Final = 5
_ROBOT: Final = "ar4-mk3"
_LIFT: Final = "speed_mm_s = 60.0\nramp_s = 2.0\n"
_DOWN_AND_UP: Final = (
    f"[[step]]\nby = {{ z = -100.0 }}\n{_LIFT}[[step]]\npause = 0.3\n[[step]]\nby = {{ z = 100.0 }}\n{_LIFT}"
)
PICK_AND_PLACE: Final = f"""
[[step]]
go = {{ x = 300.0, y = 0.0, z = 250.0, rpy_deg = [180.0, 0.0, 180.0] }}
{_DOWN_AND_UP}
[[step]]
go = {{ x = 150.0, y = 250.0, z = 250.0, rpy_deg = [165.0, 0.0, -120.0] }}
{_DOWN_AND_UP}
"""
"""From above a tray and a fixture, turned and tilted, straight down and up: 22 s."""
LONG: Final = """
[[step]]
go = { x = 300.0, y = -200.0, z = 250.0, rpy_deg = [180.0, 0.0, 180.0] }
[[step]]
repeat = 12
steps = [
    { by = { y = 400.0 }, speed_mm_s = 10.0, ramp_s = 2.0 },
    { by = { y = -400.0 }, speed_mm_s = 10.0, ramp_s = 2.0 },
]
"""
"""Straight to and fro, each millisecond of it looked at: 1 010 s."""


def arms_table() -> Table:
    """Measure forward kinematics, the inverse with all branches, and that from a near start."""
    arms = {"ar4-mk3": load_robot("ar4-mk3"), f"its axis 5 off by {MISS_MM} mm": _missing()}
    return bench_table(
        f"Six-axis arms: batches of {BATCH}, processor time of one core",
        "arm|way|poses a second|wanted|x numpy sin",
        (row for name, robot in arms.items() for row in _rows(name, robot)),
    )


def _missing() -> Robot:
    """Return the AR4 with its wrist's axes missing each other."""
    robot = load_robot("ar4-mk3")
    geometry = read_geometry(ChainGeometry, robot)
    chain = tuple((name, replace(joint, a_mm=MISS_MM) if name == "J5" else joint) for name, joint in geometry.chain)
    return replace(robot, geometry={**robot.geometry, "chain": chain})


def _rows(name: str, robot: Robot) -> Iterator[str]:
    kinematics = make_kinematics(robot)
    assert isinstance(kinematics, SixAxisArm)
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    rng = np.random.default_rng(1)
    joints = rng.uniform(lower, upper, (BATCH, len(lower)))
    poses, near = kinematics.forward(joints), joints + rng.normal(0.0, NEAR_DEG, joints.shape)
    every = np.tile(joints, (len(kinematics.branches), 1))
    how = "in closed form" if kinematics.has_closed_form else "numerically"
    yield _row(name, "forward", lambda: kinematics.forward(joints), joints)
    yield _row(name, f"all branches {how}", lambda: kinematics.inverse(poses), every)
    yield _row(name, "from a near start", lambda: kinematics.numeric.near(poses, near), joints)
    if kinematics.has_closed_form and find_spec("eaik"):
        alone = np.tile(joints[:ALONE], (len(kinematics.branches), 1))
        yield _row(name, "all branches by EAIK", _eaik(kinematics, robot, poses[:ALONE]), alone, ALONE)


def _row(name: str, way: str, calculate: Callable[[], object], values: FloatArray, count: int = BATCH) -> str:
    """Measure one way for this many poses; `values` are the joints that it reads or writes."""
    angles = np.deg2rad(values)
    sines = np.empty_like(angles)
    sin_s, taken_s = best_s(lambda: np.sin(angles, out=sines), calculate)
    wanted = f"{_WANTED[way]:,.0f}" if way in _WANTED else "-"
    return f"{name}|{way}|{count / taken_s:,.0f}|{wanted}|{taken_s / sin_s:.1f}"


def _eaik(kinematics: Kinematics, robot: Robot, poses: FloatArray) -> Callable[[], object]:
    """Return what solves poses, of shape (n, 7), with EAIK, each by itself."""
    axes = axes_of(kinematics.dh, robot.joint_names)
    points = np.vstack([np.zeros(3), axes.points_mm, axes.home_mm])
    arm = import_module("eaik.IK_HP").HPRobot(axes.directions, np.diff(points, axis=0))
    targets = np.tile(np.eye(4), (len(poses), 1, 1))
    targets[:, :3, :3], targets[:, :3, 3] = matrix(poses[:, 3:]) @ axes.home_rotation.T, poses[:, :3]
    return lambda: [arm.IK(target) for target in targets]


def programs_tables(kernels: Iterable[Kernel]) -> list[Table]:
    """Measure the pick-and-place with each kernel, and the planning of both programs."""
    collect_seldom()
    return [
        bench_table(
            "Six-axis arm: planning, processor time",
            "program|duration s|steps and motion s|points s|both s|s a 1000 s of motion",
            (_planning_row(*each) for each in (("pick-and-place", PICK_AND_PLACE), ("long straight lines", LONG))),
        ),
        bench_table(
            "Six-axis arm: a pick-and-place, processor time",
            "kernel|frames|emulation s|verification s|x real time, emulation|both|x bare bus",
            map(_run_row, kernels),
        ),
    ]


def _compiled(text: str) -> Motion:
    return compile_program(parse_program(text, Findings()), load_robot(_ROBOT)).motion


def _planning_row(name: str, text: str) -> str:
    robot, motion = load_robot(_ROBOT), _compiled(text)
    compile_s, plan_s = (median(_taken_s(make) for _ in range(ROUNDS)) for make in _ways(text))
    both_s, duration_s = compile_s + plan_s, plan(robot, motion).motion.duration_s
    return f"{name}|{duration_s:.1f}|{compile_s:.2f}|{plan_s:.2f}|{both_s:.2f}|{1000 * both_s / duration_s:.2f}"


def _ways(text: str) -> tuple[Callable[[], object], Callable[[], object]]:
    robot, motion = load_robot(_ROBOT), _compiled(text)
    return lambda: _compiled(text), lambda: plan(robot, motion)


def _taken_s(calculate: Callable[[], object]) -> float:
    started = time.process_time()
    calculate()
    return time.process_time() - started


def _verify(outcome: Outcome) -> None:
    comparison = outcome.comparison
    verify_comparison(compare(comparison.expected, comparison.evidence), outcome.report.run)


def _run_row(kernel: Kernel) -> str:
    """Run the program ROUNDS times after a warm-up; raise AssertionError if a run fails its verification."""
    planned = plan(load_robot(_ROBOT), _compiled(PICK_AND_PLACE))
    run, verification, bare = [], [], []
    for _ in range(ROUNDS + 1):
        started = time.process_time()
        outcome = execute(planned, "pick-and-place", kernel)
        run.append(time.process_time() - started)
        assert outcome.report.passed, outcome.report.reasons
        verification.append(_taken_s(partial(_verify, outcome)))
        bare.append(bare_bus_s(outcome.bus_log, time.process_time))
    run_s, verification_s, bare_s = (median(each[1:]) for each in (run, verification, bare))
    emulation_s, simulated_s = run_s - verification_s, outcome.report.run.simulated_s
    return (
        f"{kernel.name}|{outcome.report.run.bus.frames}|{emulation_s:.2f}|{verification_s:.2f}"
        f"|{simulated_s / emulation_s:.0f}|{simulated_s / run_s:.0f}|{emulation_s / bare_s:.0f}"
    )
