"""Make the runs of a campaign in this process, or on the workers of a Dask cluster, each run once."""

import asyncio
import gc
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from itertools import islice
from logging import CRITICAL
from multiprocessing import resource_tracker
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.row import Breach, Ended, Row
from steptwin.features.campaigns.running import run_seed
from steptwin.features.campaigns.sources import source_version
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.common.processes import collect_seldom

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

SEEDS_PER_TASK: Final = 4
"""Runs of a task. They take some tenths of a second each; the scheduler's cost of 1 ms a task is negligible."""
_TASKS_PER_THREAD: Final = 3
"""Number of submitted tasks for each thread of the cluster: one runs, the others wait."""
_TASKS_MIN: Final = 4
_THREADS_ASKED_EVERY_S: Final = 5.0
_LOCAL: Final = {"distributed.worker.profile.enabled": False}
"""Dask's settings for local workers, without its profiler, which would interrupt a run every 10 ms."""
_OF_THIS_COMPUTER: Final[Mapping[str, Any]] = {
    "threads_per_worker": 1,
    "dashboard_address": "127.0.0.1:0",  # no dashboard; a free port, since several campaigns may run at once
    "scheduler_kwargs": {"dashboard": False},
    "silence_logs": CRITICAL,
}
CONNECT_S: Final = 10.0
"""Longest wait for a scheduler's answer."""
_LEAVE_S: Final = 0.25
"""Time for a worker to end its run when the campaign is cancelled; then its process is killed."""


class Batch(NamedTuple):
    """The rows of a task, and the `source_version` that made them."""

    version: str
    rows: list[Row]


def run_here(campaign: Campaign, seeds: Iterable[int]) -> Iterator[list[Row]]:
    """Make runs in this process; yield each row."""
    for seed in seeds:
        yield run_batch(campaign, [seed]).rows


def run_batch(campaign: Campaign, seeds: Sequence[int]) -> Batch:
    """Make the runs of a task."""
    batch = Batch(source_version(), [run_seed(campaign, seed) for seed in seeds])
    _spare_what_lives()
    return batch


@cache
def _spare_what_lives() -> None:
    """Exempt objects of the first runs from later garbage collections, which took a tenth of a run."""
    gc.collect()
    gc.freeze()
    collect_seldom()


def run_on(client: "Client", campaign: Campaign, seeds: Iterable[int]) -> Iterator[list[Row]]:
    """Make runs on a cluster; yield the rows of each task as it ends, in any order.

    Just enough tasks are submitted to keep all workers busy. If a worker is lost, another one makes its runs. A run
    that ends its worker several times becomes a row with this error.

    Raises:
        InputError: the workers have another version of StepTwin, or cannot import it.
        BusError: the scheduler is lost.
    """
    from distributed import as_completed

    waiting = iter(seeds)
    # A task rather than scattered data: if all workers that hold it are lost, the scheduler makes it again.
    shared = client.submit(_same, campaign, pure=False)
    tasks: dict[Any, list[int]] = {}
    running = as_completed(loop=client.loop)
    threads = _Threads(client)

    def hand_out(some: list[int]) -> None:
        task = client.submit(run_batch, shared, some, pure=False)
        tasks[task] = some
        running.add(task)

    def fill_up() -> None:
        while len(tasks) < max(_TASKS_MIN, _TASKS_PER_THREAD * threads.count()):
            some = list(islice(waiting, SEEDS_PER_TASK))
            if not some:
                return
            hand_out(some)

    fill_up()
    while tasks:
        task = next(running)
        some = tasks.pop(task)
        try:
            batch = _result(client, task)
        except _KilledError:
            if len(some) == 1:
                yield [_killed(some[0])]
            for seed in some if len(some) > 1 else ():
                hand_out([seed])
        else:
            if batch.version != source_version():
                versions = f"a worker has StepTwin {batch.version}, this is {source_version()}"
                raise InputError(f"{versions}: they must be the same")
            yield batch.rows
        task.release()
        fill_up()


def _same(campaign: Campaign) -> Campaign:
    return campaign


class _KilledError(Exception):
    """A task has ended several workers."""


def _result(client: "Client", task: Any) -> Batch:
    """Return the result of an ended task."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        batch: Batch = client.gather(task)
    except KilledWorker as error:
        raise _KilledError from error
    except ModuleNotFoundError as error:
        raise InputError(f"a worker cannot import StepTwin: {error}: install the same version there") from error
    except (CancelledError, CommClosedError, TimeoutError, OSError) as error:
        raise BusError(f"the scheduler is lost: {error}") from error
    return batch


def _killed(seed: int) -> Row:
    breach = Breach("program", "the worker's process ended, again and again")
    return Row(seed, "", "", "", Ended.CRASHED, breach.what, breaches=(breach,))


class _Threads:
    """Number of threads of the cluster's workers, updated from time to time: workers come and go."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._asked_s = -_THREADS_ASKED_EVERY_S
        self._count = 0

    def count(self) -> int:
        """Return the number of threads."""
        now_s = monotonic()
        if now_s - self._asked_s >= _THREADS_ASKED_EVERY_S:
            self._asked_s = now_s
            self._count = sum(self._client.nthreads().values())
        return self._count


@contextmanager
def cluster(workers: int, scheduler: str | None) -> "Iterator[Client]":
    """Connect to a scheduler, or start a local cluster with `workers` workers, for the block.

    Raises:
        BusError: the scheduler does not answer.
    """
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        with _connected(lambda: Client(scheduler, timeout=CONNECT_S, set_as_default=False), scheduler) as client:
            yield client
        return
    with dask.config.set(_LOCAL), ExitStack() as stack:
        with _deaf_to_interrupts():
            local = stack.enter_context(LocalCluster(n_workers=workers, **_OF_THIS_COMPUTER))
        client = stack.enter_context(Client(local, set_as_default=False))
        try:
            yield client
        except BaseException:
            local.sync(_end_workers, local)
            raise


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Start workers in the block that ignore Ctrl-C, and so do their later replacements.

    A terminal sends it to all processes of a command. The campaign itself ends its workers, which would print
    tracebacks. A process inherits the blocked signals of the thread that starts it, and a thread those of its creator.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # otherwise it starts with the first worker, and unblocks the signal there
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


async def _end_workers(local: "LocalCluster") -> None:
    """End a cluster's workers at once; otherwise each is waited for, four seconds and more, until its run ends."""
    await asyncio.gather(*(nanny.close(timeout=_LEAVE_S) for nanny in local.workers.values()))


@contextmanager
def _connected(connect: "Callable[[], Client]", scheduler: str) -> "Iterator[Client]":
    try:
        client = connect()
    except (OSError, TimeoutError, ValueError) as error:
        raise BusError(f"scheduler={scheduler}: no Dask scheduler answers there: {error}") from error
    with client:
        yield client
