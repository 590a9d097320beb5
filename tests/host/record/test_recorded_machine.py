"""The machine of a stored run at any instant, against its plan and its counts."""

import numpy as np
import pytest

from steptwin.host.record.recorded_machine import RecordedMachine
from tests.host.record.machines import perfect_run

RUN = perfect_run("warehouse-scara", "store")
MACHINE = RecordedMachine.of(RUN)
LOCK, UNLOCK = (change for change in RUN.comparison.expected.motion.output_changes if change.output == "lock")


def test_the_counts_at_an_instant_include_its_own_step() -> None:
    axis = next(i for i, counted in enumerate(RUN.comparison.counted) if counted.time_s.size > 10)
    counted = RUN.comparison.counted[axis]
    instants_s = counted.time_s[[5, 3, 4]]  # in any order
    assert MACHINE.counts(instants_s)[:, axis].tolist() == counted.positions[[6, 4, 5]].tolist()
    before_s = np.array([counted.time_s[5] - 1e-9, -1.0, 1e6])
    assert MACHINE.counts(before_s)[:, axis].tolist() == counted.positions[[5, 0, -1]].tolist()


def test_counted_joints_are_within_a_step_of_the_planned() -> None:
    t_s = np.linspace(0.0, MACHINE.duration_s, 500)
    off_steps = np.abs(RUN.robot.to_steps(MACHINE.counted_joints(t_s) - MACHINE.planned_joints(t_s)))
    assert 0.1 < off_steps.max() < 0.6
    poses = MACHINE.counted_poses(t_s)
    assert MACHINE.links(t_s)[-1].points_mm[:, -1] == pytest.approx(poses[:, :3])


def test_the_machine_stands_still_before_and_after_the_motion() -> None:
    ends = MACHINE.planned_joints(np.array([0.0, MACHINE.duration_s]))
    assert MACHINE.planned_joints(np.array([-1.0, MACHINE.duration_s + 1.0])).tolist() == ends.tolist()


def test_outputs_are_on_between_their_edges() -> None:
    (held,) = MACHINE.holds_s["lock"]
    assert held == pytest.approx((LOCK.from_s, UNLOCK.from_s))


def test_the_hand_pulls_the_drawer_out_and_pushes_it_shut() -> None:
    pulled_s = (LOCK.from_s + UNLOCK.from_s) / 2
    shifts_mm = MACHINE.box_shifts_mm(np.array([0.0, LOCK.from_s, pulled_s, UNLOCK.until_s, MACHINE.duration_s]))
    assert list(shifts_mm) == list(RUN.robot.boxes)
    assert shifts_mm["drawer-A1"][:, 1] == pytest.approx([0.0, 0.0, -180.0, 0.0, 0.0], abs=0.2)
    assert np.abs(shifts_mm["drawer-A1"][:, ::2]).max() < 0.2
    assert not any(moved_mm.any() for name, moved_mm in shifts_mm.items() if name != "drawer-A1")
