"""Measure programs of the six-axis AR4: a pick-and-place from the text to the verdict, and planning of 1 000 s.

All times are processor time, so that other programs on the computer count little. That of a bare bus, a loop of plain
Python that passes as many frames on, says how fast the computer was meanwhile.
"""

import time
from collections.abc import Callable, Iterable
from functools import partial
from statistics import median
from typing import Final

from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.bench.drawer_pull import bare_bus_s
from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.findings import Findings
from steptwin.host.common.processes import collect_seldom
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs.compiling import compile_program
from steptwin.host.planning.programs.program_file import parse_program
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify import compare, verify_comparison

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
"""Straight to and fro, of which each millisecond is looked at: 1 010 s."""


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


def _compiled(text: str) -> Trajectory:
    return compile_program(parse_program(text, Findings()), load_robot(_ROBOT)).trajectory


def _planning_row(name: str, text: str) -> str:
    robot, motion = load_robot(_ROBOT), _compiled(text)
    compile_s, plan_s = (median(_taken_s(make) for _ in range(ROUNDS)) for make in _ways(text))
    both_s, duration_s = compile_s + plan_s, plan(robot, motion).trajectory.duration_s
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
