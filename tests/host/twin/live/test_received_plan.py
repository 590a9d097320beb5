"""The plan made of received records: independent of their order among the axes, in bounded memory."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.planning.trajectory_file import trajectory_of_csv
from steptwin.host.robots import load_robot
from steptwin.host.twin.live.live_plan import ReceivedPlan
from steptwin.protocol.pvt import QUEUE_DEPTH, PvtRecord

ROBOT = load_robot("warehouse-scara")
RECORDS = tuple(PvtRecord(100 * i, 64 * i, 10, i) for i in range(1, 9))
END_UNITS = sum(record.displacement_units for record in RECORDS)
ORDERS = st.permutations([0] * len(RECORDS) + [3] * len(RECORDS))


def text_of(order: list[int], before: int) -> str:
    """Give two joints the same records in this order of joints, `before` of them before the SYNC; return the text."""
    plan = ReceivedPlan(ROBOT)
    rows: list[str] = []
    counts = {0: 0, 3: 0}
    for i, joint in enumerate([*order, None]):
        if i == before:
            plan.begin([0] * 6, [counts.get(axis, 0) for axis in range(6)])
        if joint is not None:
            plan.accept(joint, RECORDS[counts[joint]])
            counts[joint] += 1
        rows += [row for taken in plan.take() for row in taken.rows]
    plan.end([END_UNITS, 0, 0, END_UNITS, 0, 0])
    assert plan.lacking is None
    return "".join(rows)


@settings(max_examples=20)
@given(ORDERS, st.integers(1, 2 * len(RECORDS)))
def test_the_order_among_the_axes_changes_nothing(order: list[int], before: int) -> None:
    if len(set(order[:before])) < 2:
        before = len(order)  # both axes start with that SYNC
    assert text_of(order, before) == text_of([0, 3] * len(RECORDS), 2)


def test_the_rows_are_a_trajectory_to_the_unit() -> None:
    motion = trajectory_of_csv(text_of([0, 3] * len(RECORDS), 2), ROBOT)
    (end,) = motion.positions(np.array([motion.duration_s])) * ROBOT.wire_units_per_unit
    assert motion.duration_s == pytest.approx(0.01 * len(RECORDS))
    assert end.tolist() == pytest.approx([END_UNITS, 0, 0, END_UNITS, 0, 0], abs=1e-6)


@pytest.mark.parametrize(("ahead", "lacks"), [(2 * QUEUE_DEPTH, False), (2 * QUEUE_DEPTH + 1, True)])
def test_an_axis_far_ahead_of_the_others_ends_the_plan(ahead: int, lacks: bool) -> None:
    plan = ReceivedPlan(ROBOT)
    for joint in (0, 3):
        plan.accept(joint, RECORDS[0])
    plan.begin([0] * 6, [1, 0, 0, 1, 0, 0])
    for _ in range(ahead):
        plan.accept(0, RECORDS[0])
    plan.fail("whatever comes then")
    assert (plan.lacking == "the axes' records do not last equally long") is lacks


def test_only_new_rows_are_taken_each_with_the_number_of_its_plan() -> None:
    plan = ReceivedPlan(ROBOT)
    assert plan.take() == []
    for number in (1, 2):
        plan.accept(0, RECORDS[0])
        plan.begin([0] * 6, [1, 0, 0, 0, 0, 0])
        *rest, (taken, rows) = plan.take()
        assert [(plan_number, len(more)) for plan_number, more in rest] == [(1, 1)] * (number - 1)  # to its very end
        assert taken == number
        assert rows[0].startswith("t,sx,")
        assert [row.split(",")[0] for row in rows[1:]] == ["0.0", "0.01"]
        plan.accept(0, RECORDS[0])
        ((taken, rows),) = plan.take()
        assert taken == number
        assert [row.split(",")[0] for row in rows] == ["0.02"]
