"""The plan made of received records: independent of their order among the axes, in bounded memory."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.planning.trajectory_file import read_trajectory
from steptwin.host.robots import load_robot
from steptwin.host.twin.received_plan import ReceivedPlan
from steptwin.protocol.pvt import QUEUE_DEPTH, PvtRecord

ROBOT = load_robot("warehouse-scara")
RECORDS = tuple(PvtRecord(100 * i, 64 * i, 10, i) for i in range(1, 9))
END_UNITS = sum(record.displacement_units for record in RECORDS)
ORDERS = st.permutations([0] * len(RECORDS) + [3] * len(RECORDS))


def text_of(order: list[int], before: int, folder: Path) -> str:
    """Give two joints the same records in this order of joints, `before` of them before the SYNC; return the text."""
    plan = ReceivedPlan(folder, ROBOT)
    counts = {0: 0, 3: 0}
    for i, joint in enumerate([*order, None]):
        if i == before:
            plan.begin([0] * 6, [counts.get(axis, 0) for axis in range(6)])
        if joint is not None:
            plan.accept(joint, RECORDS[counts[joint]])
            counts[joint] += 1
    plan.end([END_UNITS, 0, 0, END_UNITS, 0, 0])
    plan.finish()
    assert plan.lacking is None
    return (folder / "trajectory.csv").read_text()


@settings(max_examples=20)
@given(ORDERS, st.integers(1, 2 * len(RECORDS)))
def test_the_order_among_the_axes_changes_nothing(order: list[int], before: int) -> None:
    if len(set(order[:before])) < 2:
        before = len(order)  # both axes start with that SYNC
    with TemporaryDirectory() as folder:
        assert text_of(order, before, Path(folder)) == text_of([0, 3] * len(RECORDS), 2, Path(folder))


def test_the_file_is_a_trajectory_to_the_unit(tmp_path: Path) -> None:
    text_of([0, 3] * len(RECORDS), 2, tmp_path)
    motion = read_trajectory(str(tmp_path / "trajectory.csv"), ROBOT)
    (end,) = motion.positions(np.array([motion.duration_s])) * ROBOT.wire_units_per_unit
    assert motion.duration_s == pytest.approx(0.01 * len(RECORDS))
    assert end.tolist() == pytest.approx([END_UNITS, 0, 0, END_UNITS, 0, 0], abs=1e-6)


@pytest.mark.parametrize(("ahead", "lacks"), [(2 * QUEUE_DEPTH, False), (2 * QUEUE_DEPTH + 1, True)])
def test_an_axis_far_ahead_of_the_others_ends_the_plan(ahead: int, lacks: bool, tmp_path: Path) -> None:
    plan = ReceivedPlan(tmp_path, ROBOT)
    for joint in (0, 3):
        plan.accept(joint, RECORDS[0])
    plan.begin([0] * 6, [1, 0, 0, 1, 0, 0])
    for _ in range(ahead):
        plan.accept(0, RECORDS[0])
    plan.fail("whatever comes then")
    assert (plan.lacking == "the axes' records do not last equally long") is lacks
    plan.finish()
    assert not list(tmp_path.iterdir())
