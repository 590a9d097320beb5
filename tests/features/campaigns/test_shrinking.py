"""Shrinking: what matters stays, all else goes, and it ends."""

import tomllib
from typing import Any

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from steptwin.features.campaigns.campaign_report import shrunk
from steptwin.features.campaigns.values import AtPart

FAULTS: list[dict[str, Any]] = [
    {"do": "estop", "pressed": True, "at_s": 0.734512},
    {"do": "supply", "supply_v": 9.21733, "at_s": 0.2134, "for_s": 0.05},
    {"do": "loss", "frames": "records", "rate": 0.48121, "at_s": AtPart(0.3317), "count": 17},
    {"do": "switch", "joint": "th1", "at_position": {"joint": "th1", "value": 12.3457}},
]


def test_only_the_fault_that_matters_stays() -> None:
    small = shrunk({"fault": FAULTS}, lambda table: any(fault.get("do") == "supply" for fault in table["fault"]))
    assert small == {"fault": [{"do": "supply"}]}


def test_two_faults_that_matter_together_stay() -> None:
    def fails(table: dict[str, Any]) -> bool:
        return {"estop", "loss"} <= {fault.get("do") for fault in table["fault"]}

    assert shrunk({"fault": FAULTS}, fails) == {"fault": [{"do": "estop"}, {"do": "loss"}]}


def test_numbers_become_simple() -> None:
    def fails(table: dict[str, Any]) -> bool:
        return any(fault.get("supply_v", 20.0) < 9.5 and "at_s" in fault for fault in table["fault"])

    (fault,) = shrunk({"fault": [FAULTS[1]]}, fails)["fault"]
    assert set(fault) == {"supply_v", "at_s"}
    assert 0 < fault["at_s"] <= 0.001
    assert 0 < fault["supply_v"] <= 0.001


def test_a_number_stays_above_what_matters() -> None:
    def fails(table: dict[str, Any]) -> bool:
        return any(fault.get("count", 0) >= 11 and fault.get("rate", 0.0) > 0.4 for fault in table["fault"])

    assert shrunk({"fault": [FAULTS[2]]}, fails) == {"fault": [{"rate": 0.48, "count": 17}]}


def test_no_run_is_made_twice_and_their_number_is_bounded() -> None:
    seen: list[str] = []

    def fails(table: dict[str, Any]) -> bool:
        seen.append(repr(table))
        return len(seen) % 3 != 0

    shrunk({"fault": FAULTS}, fails, tries=25)
    assert len(seen) == len(set(seen)) <= 25


def test_a_failure_without_any_fault_shrinks_to_none() -> None:
    assert shrunk({"fault": FAULTS}, lambda _: True) == {"fault": []}


_TEXTS = st.dictionaries(
    st.sampled_from(["a", "b", "drawer-A1", "two words", 'ä".']),
    st.one_of(st.text(), st.floats(-1e9, 1e9), st.booleans()),
)


@pytest.mark.slow
@given(st.lists(_TEXTS, min_size=1, max_size=2), _TEXTS)
def test_written_tables_are_read_again(tables: list[dict[str, Any]], inner: dict[str, Any]) -> None:
    table = {"seed": 3, **inner, "fault": tables, "until": {"numbers": [1, 2.5], **inner, "deep": {"er": inner}}}
    assert tomllib.loads(tomlkit.dumps(table)) == table
