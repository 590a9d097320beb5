"""A campaign on a real Dask cluster: a scheduler and two workers as processes, of which one is killed in the middle."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

import pytest

from steptwin.features.campaigns import workers as workers_module
from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.results import Results
from steptwin.features.campaigns.row import Row
from steptwin.features.campaigns.workers import cluster, run_here, run_on
from steptwin.host.cli.app import run
from tests.emulator.live.live_rig import TIMEOUT_S, await_true
from tests.features.campaigns.campaigns import SMALL, campaign_of

RUNS: Final = 24
_LISTENING: Final = re.compile(r"Scheduler at:\s+(tcp://\S+)")


@contextmanager
def _program(name: str, *words: str) -> "Iterator[subprocess.Popen[str]]":
    """Start a program of distributed; end it with the block, whatever has become of it."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{name}", *words, "--host", "127.0.0.1", "--no-dashboard"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler on a free port."""
    with _program("scheduler", "--port", "0") as process:
        assert process.stderr
        yield next(found[1] for line in process.stderr if (found := _LISTENING.search(line)))


def _worker(scheduler: str) -> "AbstractContextManager[subprocess.Popen[str]]":
    """Start a worker without a nanny, so that one that is killed stays away."""
    return _program("worker", scheduler, "--nthreads", "1", "--no-nanny")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return campaign_of(SMALL.replace("runs = 6", f"runs = {RUNS}"), tmp_path_factory.mktemp("cluster"))


@pytest.fixture(scope="module")
def expected(small: Campaign) -> list[Row]:
    """The rows as one process makes them."""
    return [row for rows in run_here(small, small.seeds) for row in rows]


def test_a_killed_worker_costs_nothing_but_time(
    scheduler: str, small: Campaign, expected: list[Row], tmp_path: Path
) -> None:
    results, killed = Results(tmp_path), False
    with ExitStack() as stack:
        workers = [stack.enter_context(_worker(scheduler)) for _ in range(2)]
        client = stack.enter_context(cluster(0, scheduler))
        client.wait_for_workers(2, timeout=60)
        with results.writing():
            for rows in run_on(client, small, small.seeds):
                results.add(rows)
                if not killed:
                    workers[0].kill()  # while it has tasks of its own, and results that were not fetched
                    killed = True
    rows = sorted(results.rows(small.seeds), key=lambda row: row.seed)
    assert killed
    assert rows == expected


def test_the_command_continues_on_a_cluster(
    scheduler: str, expected: list[Row], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some runs are made here, the others on the cluster; each is made once."""
    file = tmp_path / "small.toml"
    file.write_text(SMALL.replace("runs = 6", f"runs = {RUNS}"), encoding="utf-8")
    words = ["campaign", str(file), "--out", str(tmp_path / "out")]
    assert run([*words, "--runs", "5", "--workers", "1"]) == 0
    with _worker(scheduler):
        assert run([*words, "--scheduler", scheduler]) == 0
    assert f"5 of {RUNS} runs are there already" in capsys.readouterr().err
    assert sorted(Results(tmp_path / "out").rows(range(1000)), key=lambda row: row.seed) == expected


def test_a_scheduler_that_is_not_there_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers_module, "CONNECT_S", 0.5)
    file = tmp_path / "small.toml"
    file.write_text(SMALL, encoding="utf-8")
    words = ["campaign", str(file), "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]
    assert run(words) == 4
    assert "--scheduler tcp://127.0.0.1:1: no Dask scheduler answers there" in capsys.readouterr().err


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="looks for processes as Linux shows them")
def test_an_interrupt_ends_the_workers_without_their_tracebacks(tmp_path: Path) -> None:
    """A terminal sends Ctrl-C to all processes of a command: here as soon as there are workers, and once more."""
    file = tmp_path / "small.toml"
    file.write_text(SMALL.replace("runs = 6", "runs = 1000"), encoding="utf-8")
    words = [sys.executable, "-m", "steptwin", "campaign", str(file), "--out", str(tmp_path / "out"), "--workers", "2"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        await_true(lambda: _workers_of(process.pid) == 2, "two workers")
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 130
    assert re.fullmatch(r"interrupted: \d+ of 1000 runs are there; the same command makes the others\n+", errors)
    await_true(lambda: _workers_of(process.pid) == 0, "the workers' end")


def _workers_of(group: int) -> int:
    """Return how many of the processes of a group are workers."""
    count = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended meanwhile
            count += b"spawn_main" in path.read_bytes() and os.getpgid(int(path.parent.name)) == group
    return count
