"""Turns of pytest-xdist's workers: a test in real time that this computer was too slow for is repeated alone.

Each test of a worker is in the hall, with those of the others. A test that wants to be alone leaves it, waits at the
head of the queue until all others have left, and lets none in meanwhile. Without workers a test is alone anyway.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import gettempdir
from typing import IO, Final

import pytest

if sys.platform != "win32":
    import fcntl

    _SHARED, _ALONE, _LEAVE = fcntl.LOCK_SH, fcntl.LOCK_EX, fcntl.LOCK_UN
_LOCKS: Final[list[IO[bytes]]] = []
"""The queue and the hall, of a worker."""


def _lock(place: int, how: int) -> None:
    if _LOCKS:
        fcntl.flock(_LOCKS[place], how)


def _enter() -> None:
    _lock(0, _ALONE)
    _lock(1, _SHARED)
    _lock(0, _LEAVE)


@contextmanager
def alone() -> Iterator[None]:
    """Let no other worker's test run while the block runs: wait for those that have begun."""
    if not _LOCKS:
        yield
        return
    _lock(1, _LEAVE)
    _lock(0, _ALONE)
    _lock(1, _ALONE)
    try:
        yield
    finally:
        _lock(1, _LEAVE)
        _lock(0, _LEAVE)
        _enter()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let a worker's test be in the hall, from its fixtures' beginning to their end."""
    worker = getattr(item.config, "workerinput", None)
    if worker is None or sys.platform == "win32":
        return (yield)
    if not _LOCKS:
        for name in ("queue", "hall"):
            path = Path(gettempdir()) / f"steptwin-{worker['testrunuid']}.{name}"
            _LOCKS.append(path.open("ab"))
    _enter()
    try:
        return (yield)
    finally:
        _lock(1, _LEAVE)


def pytest_sessionfinish() -> None:
    """Remove a run's locks; files that other workers still have open go when they close them."""
    if _LOCKS:
        for lock in _LOCKS:
            lock.close()
            Path(lock.name).unlink(missing_ok=True)
        _LOCKS.clear()
