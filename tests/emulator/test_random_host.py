"""A few sessions of the random host, the sessions that once failed, and proof that the random host sees faults."""

from pathlib import Path

import pytest

from tests.emulator.random_host.session import Session
from tests.emulator.random_host.trial import fault_of, trial

CASES = sorted((Path(__file__).parent / "random_host" / "cases").glob("*.jsonl"))


@pytest.mark.parametrize("seed", range(1, 33))
def test_random_sessions_hold(seed: int) -> None:
    outcome = trial(seed)
    assert not outcome.fault, f"python -m tests.emulator.random_host --seed {seed} --shrink"


@pytest.mark.parametrize("case", CASES, ids=lambda path: path.stem)
def test_sessions_that_once_failed_hold(case: Path) -> None:
    assert fault_of(Session.load(case)) == ""
