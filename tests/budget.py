"""Charge each test the processor time that it uses, and fail one that uses too much without the mark `slow`.

Processor time includes that of ended child processes. It hardly depends on what else the computer does, but it
depends on the computer: the budget holds for a reference computer and faster ones, and a short loop tells how much
slower this one is. A test that uses too much runs twice more, and the least counts: the first test of a process pays
for imports and caches that the others find, and a neighbour on the same core makes any of them dearer. Fixtures that
tests share are charged by their own names, not to the test that happens to ask first.
"""

import os
import time
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, Final

import pytest
from _pytest.runner import runtestprotocol
from _pytest.terminal import TerminalReporter

BUDGET_S: Final = 0.25  # processor time that a test without the mark `slow` may use on the reference computer
TOLERANCE: Final = 2  # a test fails above this many budgets
TRIALS: Final = 3  # of a test that uses too much
REFERENCE_TURNS_S: Final = 0.28  # ten million turns of an empty loop on the reference computer
UNBOUNDED: Final = ("slow", "live")  # marks of the tests that may use more
_TEST, _FIXTURES = "processor_s", "fixtures_processor_s"

_fixtures: Final[defaultdict[str, float]] = defaultdict(float)
"""Processor time of the shared fixtures that the running test has set up."""
_charges: Final[defaultdict[str, float]] = defaultdict(float)
"""Processor time of each test and shared fixture of all workers, in the process that prints the summary."""


def processor_s() -> float:
    """Return the processor time that this process and its ended children have used."""
    children = os.times()
    return time.process_time() + children.children_user + children.children_system


def turns_s() -> float:
    """Return the processor time of ten million turns of an empty loop, the least of three short trials."""

    def trial() -> float:
        begin_s = time.process_time()
        for _ in range(200_000):
            pass
        return (time.process_time() - begin_s) * 50

    return min(trial() for _ in range(3))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--dearest N`, the number of tests and shared fixtures whose processor time the summary lists."""
    parser.addoption("--dearest", type=int, default=10, metavar="N", help="list the N dearest tests (default: 10)")


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[object]) -> Iterator[None]:
    """Measure a fixture that several tests share, less those that it asks for itself."""
    if fixturedef.scope == "function":
        return (yield)
    begin_s, others_s = processor_s(), sum(_fixtures.values())
    try:
        return (yield)
    finally:
        own_s = processor_s() - begin_s - (sum(_fixtures.values()) - others_s)
        _fixtures[f"{fixturedef.baseid}::{fixturedef.argname} (shared fixture)"] += own_s


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, charge it, and run it again if it used too much, since the second time tells more."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports, used_s = _run(item, nextitem)
    fixtures = dict(_fixtures)
    if _is_bounded(item) and all(report.passed for report in reports):
        for _ in range(TRIALS - 1):
            if used_s > TOLERANCE * BUDGET_S:
                item._initrequest()  # type: ignore[attr-defined]  # noqa: SLF001, as pytest-rerunfailures does
                used_s = min(used_s, _run(item, nextitem)[1])
        if used_s > TOLERANCE * BUDGET_S and used_s > (limit_s := _limit_s()):
            reports[-1].outcome = "failed"
            reports[-1].longrepr = (
                f"{item.nodeid} used {used_s:.2f} s of processor time at least; {limit_s:.2f} s is the most on this "
                "computer (tests/budget.py): make it cheaper, or mark it `slow`"
            )
    reports[-1].user_properties += [(_TEST, used_s), (_FIXTURES, fixtures)]
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _run(item: pytest.Item, nextitem: pytest.Item | None) -> tuple[list[pytest.TestReport], float]:
    _fixtures.clear()
    begin_s = processor_s()
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    return reports, processor_s() - begin_s - sum(_fixtures.values())


def _is_bounded(item: pytest.Item) -> bool:
    """Return False for a marked test, and while coverage makes all of them dearer."""
    marked = any(item.get_closest_marker(name) for name in UNBOUNDED)
    return not marked and not item.config.pluginmanager.hasplugin("_cov")


def _limit_s() -> float:
    return TOLERANCE * BUDGET_S * max(1.0, turns_s() / REFERENCE_TURNS_S)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add what a test and its shared fixtures used, as its last report tells it."""
    properties: dict[str, Any] = dict(report.user_properties)
    if report.when == "teardown" and _TEST in properties:
        _charges[report.nodeid] += properties[_TEST]
        for name, used_s in properties[_FIXTURES].items():
            _charges[name] += used_s


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    """List the dearest tests and shared fixtures, and what all of them used."""
    terminalreporter.section("processor time")
    dearest = sorted(_charges.items(), key=lambda charge: -charge[1])
    for name, used_s in dearest[: config.getoption("dearest")]:
        terminalreporter.line(f"{used_s:7.2f} s  {name}")
    terminalreporter.line(
        f"{sum(_charges.values()):7.2f} s  in all; ten million turns of an empty loop take {turns_s():.2f} s here, "
        f"{REFERENCE_TURNS_S} s on the computer for which a test's budget is {BUDGET_S} s"
    )
