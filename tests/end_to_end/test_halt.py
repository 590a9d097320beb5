"""The drawer pull, halted at 3 s by one axis' halt bit and resumed: the same counts, the same path, only later."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.backend import Kernel
from host.client.axis import AxisClient
from host.embedded import EmbeddedBoard
from host.jobs import make_job
from host.planner import plan
from host.robots import load_robot
from host.run import Outcome, execute
from host.verify import AxisEvidence, Evidence
from protocol.cia402 import ENABLE_OPERATION, Control, Status
from protocol.frame import COB_SYNC

RUN = ENABLE_OPERATION | Control.START
TH1 = 3
HALT_AT_S, PAUSE_S = 3.0, 2.0


@dataclass
class Pause:
    """Halts and resumes from within the client's waiting, once the motion runs."""

    axis: AxisClient | None = None
    synced_s: float | None = None
    written: list[int] = field(default_factory=list)
    rested: bool = False

    def tend(self, now_s: float) -> None:
        if self.axis is None or self.synced_s is None:
            return
        for word, after_s in ((RUN | Control.HALT, HALT_AT_S), (RUN, HALT_AT_S + PAUSE_S)):
            if word not in self.written and now_s >= self.synced_s + after_s:
                self.rested |= bool(self.axis.read(0x6041) & Status.TARGET_REACHED)
                self.written.append(word)
                self.axis.write(0x6040, 0, word)


def pull(kernel: Kernel) -> tuple[Outcome, Evidence]:
    collected: list[Evidence] = []
    collect = EmbeddedBoard.evidence

    def evidence(board: EmbeddedBoard) -> Evidence:
        collected.append(collect(board))
        return collected[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EmbeddedBoard, "evidence", evidence)
        robot = load_robot("warehouse-scara")
        outcome = execute(plan(robot, make_job(robot, "drawer-pull", {})), "drawer-pull", kernel)
    return outcome, collected[0]


@pytest.fixture(scope="module")
def planned(fast_kernel: Kernel) -> Evidence:
    return pull(fast_kernel)[1]


def steps_off_the_path(
    before: AxisEvidence, after: AxisEvidence, th1_before: AxisEvidence, th1_after: AxisEvidence
) -> NDArray[np.float64]:
    """How far each step lies outside the piece of the path on which th1 says that the arm is, in steps of its axis.

    th1 moves one way only. A step made between two of its steps belongs between the same two in the planned motion.
    """
    pieces = np.concatenate(([-np.inf], th1_before.step_counts, [np.inf]))
    at = np.searchsorted(th1_after.step_counts, after.step_counts)
    planned_counts = before.step_counts.astype(np.float64)
    outside_counts = np.maximum(pieces[at] - planned_counts, planned_counts - pieces[at + 1])
    off: NDArray[np.float64] = np.maximum(outside_counts, 0) / np.gradient(planned_counts)
    return off


def signed_places(axis: AxisEvidence) -> list[int]:
    return [int(place) for place in axis.start_steps + np.cumsum(axis.step_signs)]


def test_the_drawer_pull_rests_on_its_path_and_goes_on(
    fast_kernel: Kernel, planned: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause = Pause()
    wait, send = EmbeddedBoard.wait, AxisClient.send_latched_controlword

    def waiting(board: EmbeddedBoard, dt_s: float) -> None:
        wait(board, dt_s)
        if pause.synced_s is None and any(frame.cob_id == COB_SYNC for _, frame in board.bus_log):
            pause.synced_s = board.now_s()
        pause.tend(board.now_s())

    def remember(axis: AxisClient, controlword: int) -> None:
        pause.axis = axis if axis.name == "th2" else pause.axis
        send(axis, controlword)

    monkeypatch.setattr(EmbeddedBoard, "wait", waiting)
    monkeypatch.setattr(AxisClient, "send_latched_controlword", remember)
    outcome, halted = pull(fast_kernel)

    assert outcome.fault is None
    assert pause.written == [RUN | Control.HALT, RUN]
    assert pause.rested
    arm = range(3, 6)
    for axis in arm:
        before, after = planned.axes[axis], halted.axes[axis]
        assert not after.violations.counts.size
        assert signed_places(after) == signed_places(before)
        ending_s = (after.step_counts[-1] - halted.start_counts - before.step_counts[-1] + planned.start_counts) / 72e6
        assert PAUSE_S < ending_s < PAUSE_S + 0.5
        assert steps_off_the_path(before, after, planned.axes[TH1], halted.axes[TH1]).max() < 0.1
    assert all(len(halted.axes[axis].step_counts) == 0 for axis in range(3))
