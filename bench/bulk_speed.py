"""Measure what is computed in bulk: poses beside numpy's sine, text of waveforms beside a copy, emulated hardware.

Of the hardware: CLK edges that a driver processes, and motors that are turned by a run's record.
"""

import time
import tracemalloc
from collections.abc import Callable, Iterator
from statistics import median
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.bench.step_methods.motions import AXES
from steptwin.controller.motion.backend import fastest_kernel
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.features.motors.turning.after_run import rotors_after_run
from steptwin.features.motors.turning.driving import Driving
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.record.waveforms import SCALES, HeldValues, Pulses, Signal, SignalKind, Window
from steptwin.host.record.waveforms.export import csv, vcd
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.protocol.drivers import PROFILES
from steptwin.protocol.timer import COUNTS_PER_SECOND

BATCH: Final = 8192
_CALCULATIONS: Final = 50
_RATE_HZ: Final = 14_000
_DURATION_S: Final = 30
_REPEATS: Final = 3
_CLK_HIGH_COUNTS: Final = 2_376
PULSES: Final = 32_768
"""Number of pulses fed at a time: as many as the board's edge buffer holds."""
_STRETCHES: Final = 30
_PERIOD_COUNTS: Final = 36_000
_WIDTH_COUNTS: Final = 11_000
_TURNS: Final = 200
_DRIVERS: Final = ("chip-330pf", "3a-module", "slow-blue-board")
_RUNS: Final = (("warehouse-scara", "store"), ("lab-scara", "spiral"), ("hybrid-arm", "helix"))


def kinematics_table() -> Table:
    """Measure the kinematics of every robot with a tool, both ways: the best of all runs, for all branches together.

    The sines are as many as joint values are read or, over all branches, written.
    """
    return bench_table(
        f"Kinematics: batches of {BATCH}, one core; ratio to the sines of all joint values",
        "robot|way|branches|M poses/s|ns a pose|x numpy sin",
        (row for robot in map(load_robot, robot_names()) if has_poses(robot) for row in _kinematics_rows(robot)),
    )


def has_poses(robot: Robot) -> bool:
    """Return whether a robot has a tool, and so poses."""
    return make_kinematics(robot).task.width > 0


def _kinematics_rows(robot: Robot) -> list[str]:
    """Measure one robot with poses that it reaches."""
    kinematics = make_kinematics(robot)
    joints = _reached(robot)
    poses = kinematics.forward(joints)
    branches = len(kinematics.branches)
    return [
        _kinematics_row(robot, "forward", 1, joints, lambda: kinematics.forward(joints)),
        _kinematics_row(
            robot, "inverse", branches, np.tile(joints, branches), lambda: kinematics.inverse(poses, joints)
        ),
    ]


def _reached(robot: Robot) -> FloatArray:
    """Return random joint positions within the limits whose poses the first branch reaches."""
    kinematics = make_kinematics(robot)
    lower, upper = [joint.lower for joint in robot.joints], [joint.upper for joint in robot.joints]
    joints = np.random.default_rng(1).uniform(lower, upper, (4 * BATCH, len(lower)))
    branch = kinematics.solve(kinematics.forward(joints), kinematics.branches[0], joints)
    return joints[np.logical_and.reduce([constraint.kept for constraint in branch.mechanism])][:BATCH]


def _kinematics_row(robot: Robot, way: str, branches: int, values: FloatArray, calculate: Callable[[], object]) -> str:
    sines = np.empty_like(values)
    angles = np.deg2rad(values)
    sin_s, taken_s = best_s(lambda: np.sin(angles, out=sines), calculate)
    return (
        f"{robot.name}|{way}|{branches}|{BATCH / taken_s / 1e6:.2f}|{1e9 * taken_s / BATCH:.0f}|{taken_s / sin_s:.1f}"
    )


def best_s(*calculations: Callable[[], object]) -> list[float]:
    """Return each calculation's shortest processor time; they take turns, so that a slow moment affects all."""
    shortest_s = [float("inf")] * len(calculations)
    for _ in range(_CALCULATIONS):
        for which, calculate in enumerate(calculations):
            started = time.process_time()
            calculate()
            shortest_s[which] = min(shortest_s[which], time.process_time() - started)
    return shortest_s


def waveform_table() -> Table:
    """Measure STEP and DIR of all axes near the drivers' highest rate; the text is made in pieces and dropped.

    Memory is the largest that is used beside the edges, then that for a tenth of them.
    """
    return bench_table(
        f"Waveforms: {AXES} axes for {_DURATION_S} s at 14 kHz; ratio to copying the text once",
        "file|edges|M edges/s|x numpy copy|MB beside the edges|a tenth",
        map(_waveform_row, ("vcd 1us", "vcd 100ns", "csv")),
    )


def _waveform_row(form: str) -> str:
    signals, window = _record(_DURATION_S)
    edges = sum(_changes(signal) for signal in signals)
    seconds, copy_s = min(_once(form, signals, window) for _ in range(_REPEATS))
    peak_mb, peak_mb_tenth = (_peak_mb(form, *_record(duration_s)) for duration_s in (_DURATION_S, _DURATION_S // 10))
    return f"{form}|{edges}|{edges / seconds / 1e6:.1f}|{seconds / copy_s:.0f}|{peak_mb:.0f}|{peak_mb_tenth:.0f}"


def _record(duration_s: int) -> tuple[list[Signal], Window]:
    """Make axes with slightly different rates, so that edges do not coincide, and a reversal every 1000 steps."""
    signals = []
    for axis in range(AXES):
        rises = np.arange(0, duration_s * COUNTS_PER_SECOND, COUNTS_PER_SECOND // _RATE_HZ + 7 * axis)
        turns = rises[500::1000] - 1_200
        levels = (np.arange(turns.size) % 2).astype(np.int8)
        signals.append(Signal(f"axis{axis}", "step", SignalKind.WIRE, Pulses(rises, rises + _CLK_HIGH_COUNTS)))
        signals.append(Signal(f"axis{axis}", "dir", SignalKind.WIRE, HeldValues(turns, levels, 1)))
    return signals, Window(0, duration_s * COUNTS_PER_SECOND, 0)


def _changes(signal: Signal) -> int:
    return int(signal.changes.between(-1, 1 << 62)[0].size)


def _pieces(form: str, signals: list[Signal], window: Window) -> Iterator[bytes]:
    if form == "csv":
        return csv(signals, window)
    return vcd(signals, window, SCALES[form.removeprefix("vcd ")], "bench")


def _once(form: str, signals: list[Signal], window: Window) -> tuple[float, float]:
    started = time.process_time()
    copy_s = 0.0
    for piece in _pieces(form, signals, window):
        source = np.frombuffer(piece, np.uint8)
        before = time.process_time()
        source.copy()
        copy_s += time.process_time() - before
    return time.process_time() - started - copy_s, copy_s


def _peak_mb(form: str, signals: list[Signal], window: Window) -> float:
    tracemalloc.start()
    for _ in _pieces(form, signals, window):
        pass
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak_bytes / 1e6


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
