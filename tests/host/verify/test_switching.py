"""Verify digital outputs: each planned change in its window and in order, and no other change."""

from dataclasses import replace

import pytest

from steptwin.host.planning.motion import OutputChange
from steptwin.host.verify import Expectation, OutputEdge, verify
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import RUN, START_COUNTS, expect, line, motion, perfect_evidence

STEADY = motion(1.0, line(0.0, 100.0))
GRIP = OutputChange("gripper", on=True, from_s=0.2, until_s=0.3)
LET_GO = OutputChange("gripper", on=False, from_s=0.7, until_s=0.8)


def expect_switchings(*output_changes: OutputChange) -> Expectation:
    return expect(replace(STEADY, output_changes=output_changes), 10.0)


def change(t_s: float, level: int, name: str = "gripper") -> OutputEdge:
    return OutputEdge(name, START_COUNTS + round(t_s * COUNTS_PER_SECOND), level)


def reasons(planned: tuple[OutputChange, ...], *made: OutputEdge) -> tuple[str, ...]:
    expected = expect_switchings(*planned)
    return verify(expected, replace(perfect_evidence(expected), outputs=made), RUN).reasons


@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.1])
def test_changes_in_time_pass(late_s: float) -> None:
    expected = expect_switchings(GRIP, LET_GO)
    evidence = replace(perfect_evidence(expected), outputs=(change(0.2 + late_s, 1), change(0.7 + late_s, 0)))
    report = verify(expected, evidence, RUN)
    assert report.passed
    assert [output.changed_s for output in report.outputs] == pytest.approx([0.2 + late_s, 0.7 + late_s])
    assert report.to_dict()["outputs"][0] == {
        "name": "gripper", "on": True, "from_s": 0.2, "until_s": 0.3, "changed_s": pytest.approx(0.2 + late_s),
        "already": False,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("made", "words"),
    [
        ((change(0.199, 1), change(0.75, 0)), "gripper: switched on at 0.199000 s (planned from 0.200 to 0.300 s)"),
        ((change(0.25, 1), change(0.801, 0)), "gripper: switched off at 0.801000 s (planned from 0.700 to 0.800 s)"),
        ((change(0.25, 1),), "gripper: switched off never (planned from 0.700 to 0.800 s)"),
        ((change(0.25, 1), change(0.75, 1)), "gripper: switched off never (planned from 0.700 to 0.800 s)"),
        ((change(0.25, 1, "lock"), change(0.75, 0)), "gripper: switched on never (planned from 0.200 to 0.300 s)"),
        ((change(0.25, 1), change(0.75, 0), change(0.9, 1)), "outputs: 1 changes that were not planned (limit 0)"),
    ],
)
def test_a_change_too_early_too_late_missing_or_wrong_fails(made: tuple[OutputEdge, ...], words: str) -> None:
    assert words in reasons((GRIP, LET_GO), *made)


def test_a_change_that_was_not_planned_fails() -> None:
    assert reasons((), change(0.5, 1)) == ("outputs: 1 changes that were not planned (limit 0)",)
    assert reasons(()) == ()


GRIP_AGAIN = OutputChange("gripper", on=True, from_s=0.4, until_s=0.5)
OFF_AT_FIRST = OutputChange("gripper", on=False, from_s=0.05, until_s=0.1)


def test_a_level_that_an_output_has_already_needs_no_change() -> None:
    planned = (OFF_AT_FIRST, GRIP, GRIP_AGAIN, LET_GO)
    expected = expect_switchings(*planned)
    evidence = replace(perfect_evidence(expected), outputs=(change(0.25, 1), change(0.75, 0)))
    report = verify(expected, evidence, RUN)
    assert report.reasons == ()
    assert [output.already for output in report.outputs] == [True, False, True, False]
    assert reasons(planned, change(0.25, 1)) == ("gripper: switched off never (planned from 0.700 to 0.800 s)",)
    blinks = (change(0.25, 1), change(0.41, 0), change(0.42, 1), change(0.75, 0))
    assert "outputs: 2 changes that were not planned (limit 0)" in reasons(planned, *blinks)


def test_what_an_output_did_before_the_motion_is_where_it_begins() -> None:
    before = change(-0.02, 1)
    assert reasons((LET_GO,), before, change(0.75, 0)) == ()
    assert reasons((GRIP, LET_GO), before, change(0.75, 0)) == ()
    assert reasons((OFF_AT_FIRST,), before, change(0.07, 0)) == ()
    assert reasons((OFF_AT_FIRST,), before) == ("gripper: switched off never (planned from 0.050 to 0.100 s)",)
    assert reasons((OFF_AT_FIRST,), before, change(-0.01, 0)) == ()


def test_the_document_of_a_run_without_outputs_has_an_empty_list() -> None:
    expected = expect_switchings()
    assert verify(expected, perfect_evidence(expected), RUN).to_dict()["outputs"] == []
