"""A motor that falls out of step: no count shows it, its switches and the verifier do, and homing recovers it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.record.folder.edges_file import evidence_until, read_edges, write_edges
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.verify import Slips
from steptwin.host.verify.counted import counted_steps
from steptwin.protocol import od
from tests.host.twin.embedded.test_excitation import Master
from tests.messages import refusing
from tests.operations import Slip

LAB = load_robot("lab-scara")
JOINT = "d1"
LIMIT_METHOD = 17


def test_homing_finds_the_same_place_after_a_slip(fast_kernel: Kernel) -> None:
    limit = LAB.joint(JOINT).switches.negative_limit
    assert limit is not None
    board = BoardUnderTest(LAB, stand_at={JOINT: limit + 3}, kernel=fast_kernel)
    master = Master(board, JOINT)
    master.enable()
    master.home(LIMIT_METHOD, limit)
    step = board.joints()[JOINT] - master.position()
    master.move_to(limit + 2, 2)
    counted, told = master.read(od.ROTOR_POSITION_STEPS), master.position()
    board.operate(Slip(LAB.joint_names.index(JOINT), -8))
    board.wait(0.01)
    assert (master.read(od.ROTOR_POSITION_STEPS), master.read(od.LOST_STEPS)) == (counted, 0)
    lost = 8 * LAB.joint(JOINT).transmission.microsteps / LAB.steps_per_unit[LAB.joint_names.index(JOINT)]
    assert board.joints()[JOINT] - master.position() == pytest.approx(step - lost, abs=1e-9)
    assert master.position() == told

    master.home(LIMIT_METHOD, limit)
    assert board.joints()[JOINT] - master.position() == pytest.approx(step, abs=1e-9)


@pytest.fixture(scope="module")
def moved(fast_kernel: Kernel) -> BoardUnderTest:
    """A board whose first motor has slipped by four full steps before its motion, and by eight in it."""
    board = BoardUnderTest(LAB, stand_at={JOINT: 10}, kernel=fast_kernel)
    master = Master(board, JOINT)
    board.operate(Slip(0, 4))
    master.enable()
    master.home(37, 10)
    master.move_to(20, 0.1)
    board.operate(Slip(0, -8))
    board.wait(2)
    return board


def test_the_record_has_them_and_keeps_them(moved: BoardUnderTest, tmp_path: Path) -> None:
    evidence = moved.evidence()
    slips = evidence.axes[0].slips
    assert slips.full_steps.tolist() == [4, -8]
    steps = evidence.axes[0].step_counts
    assert slips.counts[0] < steps[0] < slips.counts[1] < steps[-1]
    assert not any(axis.slips.counts.size for axis in evidence.axes[1:])
    write_edges(tmp_path / "edges.npz", evidence)
    read = read_edges(tmp_path)
    assert [axis.slips.full_steps.tolist() for axis in read.axes] == [[4, -8], *[[]] * (len(read.axes) - 1)]
    assert read.axes[0].slips.counts.tolist() == slips.counts.tolist()
    with np.load(tmp_path / "edges.npz") as arrays:
        assert [key for key in arrays if "slip" in key] == [f"{JOINT}_slip_counts", f"{JOINT}_slip_full_steps"]
    cut = evidence_until(evidence, int(slips.counts[1]))
    assert cut.axes[0].slips.full_steps.tolist() == [4]


def test_the_count_is_the_motors_position(moved: BoardUnderTest) -> None:
    axis, microsteps = moved.evidence().axes[0], LAB.joints[0].transmission.microsteps
    in_motion = int(axis.slips.counts[1])
    plain = counted_steps(replace(axis, slips=Slips(*[np.empty(0, np.int64)] * 2)), in_motion, microsteps)
    slipped = counted_steps(axis, in_motion, microsteps)
    assert slipped.start_steps == plain.start_steps + 4 * microsteps
    assert (slipped.positions - plain.positions).tolist() == [-4 * microsteps] * plain.positions.size
    later = counted_steps(axis, in_motion + 1, microsteps)
    assert later.start_steps == plain.start_steps - 4 * microsteps
    with refusing(ValueError):
        counted_steps(axis, in_motion)
