"""Say at the end which tests were repeated because this computer was too slow: a habit of it may hide a fault.

A worker of pytest-xdist counts; its reports carry the counts to the process that prints the summary.
"""

import os
from collections import Counter
from typing import Final

import pytest
from _pytest.terminal import TerminalReporter

REPEATS: Final[Counter[str]] = Counter()
"""How often each test was repeated in this process, by its node id."""
_PROPERTY: Final = "repeats"


def count_repeat() -> None:
    """Note that the test which runs now is going to be repeated."""
    REPEATS[os.environ.get("PYTEST_CURRENT_TEST", "").removesuffix(" (call)")] += 1


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Let the report of a test carry its repeats, which only the process knows in which it ran."""
    if report.when == "call" and report.nodeid in REPEATS:
        report.user_properties.append((_PROPERTY, REPEATS.pop(report.nodeid)))


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    """List the tests that were repeated."""
    reports = [each for kind in ("passed", "failed") for each in terminalreporter.stats.get(kind, ())]
    repeated = {each.nodeid: value for each in reports for name, value in each.user_properties if name == _PROPERTY}
    if repeated:
        terminalreporter.section("repeated because this computer was too slow")
        for nodeid, repeats in repeated.items():
            terminalreporter.line(f"{nodeid}: {repeats}")
