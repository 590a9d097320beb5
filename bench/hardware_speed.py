"""Measure the emulated hardware: CLK edges that a driver processes, and motors that are turned by a run's record."""

import time
from statistics import median
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.controller.motion.backend import fastest_kernel
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.motors.after_run import rotors_after_run
from steptwin.host.twin.motors.driving import Driving
from steptwin.protocol.drivers import PROFILES

PULSES: Final = 32_768
"""Number of pulses fed at a time: as many as the board's edge buffer holds."""
_STRETCHES: Final = 30
_PERIOD_COUNTS: Final = 36_000
_WIDTH_COUNTS: Final = 11_000
_TURNS: Final = 200
_DRIVERS: Final = ("chip-330pf", "3a-module", "slow-blue-board")
_RUNS: Final = (("warehouse-scara", "store"), ("lab-scara", "spiral"), ("hybrid-arm", "helix"))
_REPEATS: Final = 3


def driver_table() -> Table:
    """Measure drivers with pulses at 2 kHz that break no limit, with about 200 reversals in each stretch.

    A row is the best of all stretches, beside a plain numpy copy of its edges.
    """
    return bench_table(
        f"Drivers: CLK edges processed, {PULSES} pulses at a time; ratio to copying them",
        "driver|M edges/s|x numpy copy",
        map(_driver_row, _DRIVERS),
    )


def _driver_row(name: str) -> str:
    driver = Driver(fitted(PROFILES[name], 16))
    driver.feed(_stretch(0))
    best_s = copy_s = float("inf")
    for index in range(1, _STRETCHES + 1):
        stretch = _stretch(index)
        clk = np.ravel(np.column_stack((stretch.clk_rise_counts, stretch.clk_fall_counts)))
        copy = clk.copy()
        started = time.perf_counter()
        np.copyto(copy, clk)
        copied = time.perf_counter()
        driver.feed(stretch)
        copy_s = min(copy_s, copied - started)
        best_s = min(best_s, time.perf_counter() - copied)
    assert not driver.violations.counts.size
    return f"{name}|{2 * PULSES / best_s / 1e6:.0f}|{best_s / copy_s:.1f}"


def _stretch(index: int) -> TerminalEdges:
    begin = index * (PULSES + 1) * _PERIOD_COUNTS
    rises: Int64Array = begin + np.arange(1, PULSES + 1, dtype=np.int64) * _PERIOD_COUNTS
    turns = rises[:: PULSES // _TURNS] - 2_500
    levels = (np.arange(turns.size) % 2).astype(np.int8)
    supply = (*Rail, Pin.RESET, Pin.ENABLE)
    changes = () if index else tuple(LevelChange(0, pin, 1) for pin in supply)
    return TerminalEdges(rises, rises + _WIDTH_COUNTS, turns, levels, changes, begin + (PULSES + 1) * _PERIOD_COUNTS)


def rotor_table() -> Table:
    """Make each run once, then turn its motors by its record several times; a row is the median of these."""
    return bench_table(
        "Motors after a run: rotors of all axes, one core",
        "run|axes|simulated s|s|x real time",
        (_rotor_row(*run) for run in _RUNS),
    )


def _rotor_row(robot_name: str, job: str) -> str:
    robot = load_robot(robot_name)
    outcome = execute(plan(robot, make_job(robot, job, {})), job, fastest_kernel())
    driving = Driving.of(robot, outcome.comparison.evidence)
    took_s = []
    for _ in range(1 + _REPEATS):  # the first one compiles
        began_s = time.perf_counter()
        rotors_after_run(driving)
        took_s.append(time.perf_counter() - began_s)
    simulated_s, wall_s = driving.total_ms / 1000, median(took_s[1:])
    return f"{robot_name} {job}|{len(robot.joints)}|{simulated_s:.1f}|{wall_s:.2f}|{simulated_s / wall_s:.1f}"
