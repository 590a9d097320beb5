"""Measure the whole drawer pull: six axes over CAN at 100 points a second, in simulated seconds per wall second.

How fast that is depends on the machine. So the time of a bare bus is measured in turns with it: a loop of plain Python
that makes each of the run's frames, finds who listens to its identifier, calls this receiver and keeps a log. No
emulation that is driven frame by frame can be faster than that, and the ratio to it hardly depends on the machine.

Two workers of a campaign make more drawer pulls than one, but two cores that share caches and memory seldom do twice
the work of one. So plain processes that make the same runs without a cluster are measured in turns with the workers:
how many more two of them make is the computer's own limit.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Final

from rich.table import Table

from steptwin.bench import bench_table
from steptwin.controller.motion.backend import Kernel
from steptwin.emulator import simulation
from steptwin.features.campaigns.campaign import Campaign, JobMotion, ScenarioChoice
from steptwin.features.campaigns.workers import cluster, run_batch, run_on
from steptwin.host.common.processes import collect_seldom
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import compare, verify_comparison
from steptwin.protocol.frame import Frame

REPEATS = 9
ROUNDS: Final = 3
_MEASURE: Final = """
import sys
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

package, compiled = sys.argv[1], sys.argv[2] == "compiled"
if not compiled:
    only_sources = FileFinder.path_hook((SourceFileLoader, SOURCE_SUFFIXES))

    def ours(path):
        if not path.startswith(package):
            raise ImportError(path)
        return only_sources(path)

    sys.path_hooks.insert(0, ours)

from steptwin.bench.drawer_pull import compiled_here, measure
from steptwin.controller.motion.backend import fastest_kernel

assert compiled_here() is compiled
figure = measure(fastest_kernel())
print(figure.emulation_s, figure.bare_bus_ratio)
"""


@dataclass(frozen=True)
class DrawerPullFigure:
    """One row of the table: medians over REPEATS runs after a warm-up."""

    kernel: str
    frames: int
    emulation_s: float
    verification_s: float
    simulated_per_wall: float
    """Simulated time divided by the wall time from switching the board on to switching the drives off."""
    bare_bus_ratio: float
    """Wall time divided by that of a bare bus with the same frames."""
    error_steps_max: float
    timing_us_p50: float


def measure(kernel: Kernel) -> DrawerPullFigure:
    """Run the job REPEATS times after a warm-up; raise AssertionError if a run fails its verification.

    Garbage is collected as seldom as in a process of the command line.
    """
    collect_seldom()
    robot = load_robot("warehouse-scara")
    planned = plan(robot, make_job(robot, "pull-line", {}))
    emulation, verification, bare = [], [], []
    for repeat in range(REPEATS + 1):
        outcome = execute(planned, "pull-line", kernel)
        assert outcome.report.passed, outcome.report.reasons
        started = time.perf_counter()
        verify_comparison(compare(outcome.comparison.expected, outcome.comparison.evidence), outcome.report.run)
        if repeat:  # run 0 warms up
            emulation.append(outcome.report.run.wall_s)
            verification.append(time.perf_counter() - started)
            bare.append(bare_bus_s(outcome.bus_log))
    report = outcome.report
    moving = [axis for axis in report.axes if axis.pulses]
    return DrawerPullFigure(
        kernel.name,
        report.run.bus.frames,
        median(emulation),
        median(verification),
        report.run.simulated_s / median(emulation),
        median(emulation) / median(bare),
        max(axis.position_error_steps_max for axis in moving),
        max(axis.timing_error_us_p50 for axis in moving),
    )


def bare_bus_s(log: list[tuple[int, Frame]], clock_s: Callable[[], float] = time.perf_counter) -> float:
    """Return the time that plain Python takes to deliver the frames of a bus log, and to keep a log of them."""
    heard: list[bytes] = []

    def receive(frame: Frame, _counts: int) -> None:
        heard.append(frame.data)

    receivers = {frame.cob_id: receive for _, frame in log}
    sent = [(counts, frame.cob_id, bytes(frame.data)) for counts, frame in log]
    delivered: list[tuple[int, Frame]] = []
    started = clock_s()
    for counts, cob_id, data in sent:
        frame = Frame(cob_id, data)
        receivers[cob_id](frame, counts)
        delivered.append((counts, frame))
    bare_s = clock_s() - started
    assert delivered == log
    assert len(heard) == len(log)
    return bare_s


def drawer_pull_table(kernels: Iterable[Kernel]) -> Table:
    """Measure with each kernel."""
    return bench_table(
        "Drawer pull: six axes over CAN at 100 points/s, 10 s of motion",
        "kernel|frames|emulation s|verification s|x real time|x bare bus|position error, steps|timing p50, us",
        (
            f"{row.kernel}|{row.frames}|{row.emulation_s:.3f}|{row.verification_s:.3f}|{row.simulated_per_wall:.0f}|"
            f"{row.bare_bus_ratio:.0f}|{row.error_steps_max:.4f}|{row.timing_us_p50:.2f}"
            for row in map(measure, kernels)
        ),
    )


def compiled_here() -> bool:
    """Return whether this installation has its hot modules compiled."""
    return Path(str(simulation.__file__)).suffix != ".py"


def compiled_text() -> str:
    """Return what compiling the hot modules saves: the shortest of ROUNDS medians with them and with their sources."""
    if not compiled_here():
        return "No modules are compiled here: docs/evidence.md says how to install a wheel with compiled ones"
    rounds = [(_measured("compiled"), _measured("sources")) for _ in range(ROUNDS)]
    (compiled_s, compiled_ratio), (sources_s, sources_ratio) = map(min, zip(*rounds, strict=True))
    return (
        f"Drawer pull with compiled modules {compiled_s:.3f} s, with their sources {sources_s:.3f} s:"
        f" {sources_s / compiled_s:.2f} times as long;"
        f" {compiled_ratio:.0f} and {sources_ratio:.0f} times as long as a bare bus with the same frames"
    )


def _measured(how: str) -> tuple[float, float]:
    """Return the emulation's time, s, and its ratio to a bare bus, measured in a process of its own."""
    package = str(Path(str(simulation.__file__)).parents[1])
    command = [sys.executable, "-c", _MEASURE, package, how]
    emulation_s, ratio = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(emulation_s), float(ratio)


_WORKER_ROUNDS: Final = 5
_RUNS_EACH: Final = 40
"""Runs that a worker or a process makes in a round: some seconds."""
_ROBOT: Final = "warehouse-scara"


def workers_table() -> Table:
    """Make the same runs by one and two workers and processes, in turns, after a warm-up of each; take medians."""
    campaign = _drawer_pulls()
    with ExitStack() as stack:
        pool = stack.enter_context(ProcessPoolExecutor(2, mp_context=get_context("spawn")))
        clients = [stack.enter_context(cluster(count, None)) for count in (1, 2)]

        def by_processes(count: int, runs: int) -> None:
            for done in [pool.submit(run_batch, campaign, range(runs)) for _ in range(count)]:
                done.result()

        def by_workers(count: int, runs: int) -> None:
            for _ in run_on(clients[count - 1], campaign, range(count * runs)):
                pass

        ways = [(make, count) for count in (1, 2) for make in (by_processes, by_workers)]
        for make, count in ways:
            make(count, 4)
        seconds = [[_round_s(make, count) for make, count in ways] for _ in range(_WORKER_ROUNDS)]
    rates = [
        count * _RUNS_EACH / median(column) for (_, count), column in zip(ways, zip(*seconds, strict=True), strict=True)
    ]
    return bench_table(
        "Campaigns: drawer pulls a second, verified, without recovery",
        "made by|one|two|two against one",
        (
            f"{words}|{one:.2f}|{two:.2f}|{two / one:.2f}"
            for words, one, two in (("plain processes", *rates[::2]), ("workers", *rates[1::2]))
        ),
    )


def _round_s(make: Callable[[int, int], None], count: int) -> float:
    started_s = time.perf_counter()
    make(count, _RUNS_EACH)
    return time.perf_counter() - started_s


def _drawer_pulls() -> Campaign:
    robots = (_ROBOT,)
    return Campaign(
        runs=1,
        first_seed=0,
        robots={_ROBOT: load_robot(_ROBOT)},
        motion=(JobMotion("pull-line", robots=robots),),
        scenario=(ScenarioChoice("nothing", robots=robots),),
        vary={},
        recover=False,
    )
