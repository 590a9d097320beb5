"""Measure how many more drawer pulls two workers of a campaign make than one.

Two cores that share caches and memory seldom do twice the work of one. So plain processes that make the same runs
without a cluster are measured in turns with the workers: how many more two of them make is the computer's own limit.
"""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from statistics import median
from typing import Final

from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.host.robots import load_robot
from steptwin.host.studies.campaign.campaign import Campaign, JobMotion, MotionChoice, ScenarioChoice
from steptwin.host.studies.campaign.workers import cluster, run_batch, run_on

_ROUNDS: Final = 5
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
        seconds = [[_seconds(make, count) for make, count in ways] for _ in range(_ROUNDS)]
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


def _seconds(make: Callable[[int, int], None], count: int) -> float:
    started_s = time.perf_counter()
    make(count, _RUNS_EACH)
    return time.perf_counter() - started_s


def _drawer_pulls() -> Campaign:
    robots = (_ROBOT,)
    return Campaign(
        runs=1,
        first_seed=0,
        robots={_ROBOT: load_robot(_ROBOT)},
        motions=(MotionChoice(JobMotion("drawer-pull", {}), robots, 1.0),),
        scenarios=(ScenarioChoice("nothing", {}, robots, 1.0),),
        vary={},
        recover=False,
    )
