"""Junk in the file of a scenario is refused in lines."""

from pathlib import Path

import pytest

from steptwin.features.faults.check import check_scenario
from steptwin.host.common.findings import Findings
from tests.junk import check_junk

CARRY = Path(__file__).parents[3] / "docs/examples/faults/carry.toml"


@pytest.mark.slow
@pytest.mark.parametrize("stride", [5, 305])
def test_junk_is_refused_in_lines_or_taken(stride: int) -> None:
    def read(text: str) -> None:
        check_scenario("", text, "teaching-scara", Findings())

    check_junk(CARRY.read_text(encoding="utf-8"), read, stride)
