"""Digital outputs switched by the client: one by one, at their times, without delaying the motion."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.planning.motion import OutputChange
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.verify import OutputEdge
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalOutput
from steptwin.protocol.frame import COB_SYNC
from tests.host.client.machines import AXES, START, SX, TH3, WAREHOUSE, WIRING, connected, frames_to, ready, still

MAGNET, LOCK = DigitalOutput.OUT1, DigitalOutput.OUT2


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    """The board with the switches and the outputs of the robot's file."""
    return EmbeddedBoard(WAREHOUSE, fast_kernel, MachineOptions(stand_at=START))


@pytest.fixture
def machine(board: EmbeddedBoard) -> Machine:
    """A machine whose drives are off."""
    return connected(board)


def switched(output: str, from_s: float, *, on: bool) -> OutputChange:
    return OutputChange(output, on, from_s, from_s)


def changes(board: EmbeddedBoard) -> list[OutputEdge]:
    board.network.send_message(COB_SYNC, b"")  # evidence counts from a SYNC
    return list(board.evidence().outputs)


def test_one_output_leaves_the_others_alone(machine: Machine, board: EmbeddedBoard) -> None:
    th3 = machine.axes[TH3]
    for output, on in ((MAGNET, True), (LOCK, True), (MAGNET, True), (MAGNET, False)):
        th3.switch_output(output, on=on)
    assert [(change.name, change.level) for change in changes(board)] == [("magnet", 1), ("lock", 1), ("magnet", 0)]
    assert th3.read(od.DIGITAL_OUTPUTS) == LOCK


def test_outputs_without_a_wire_leave_no_evidence(machine: Machine, board: EmbeddedBoard) -> None:
    machine.axes[SX].switch_output(MAGNET, on=True)
    assert changes(board) == []


def test_outputs_are_switched_at_their_times(board: EmbeddedBoard) -> None:
    """Each output switches within 25 ms after its time, the last one at the trajectory's end, and none before."""
    machine = ready(board)
    commands = (
        switched("lock", 0.5, on=True),
        switched("magnet", 0.21, on=True),
        switched("magnet", 1.0, on=False),
    )
    run = machine.start(StreamedMotion(still(100, 10), [0] * AXES, commands, wiring=WIRING))
    while not run.ended:
        machine.wait(0.01)
    evidence = board.evidence()
    assert [(change.name, change.level) for change in evidence.outputs] == [("magnet", 1), ("lock", 1), ("magnet", 0)]
    at_s = [(change.counts - evidence.start_counts) / 72e6 for change in evidence.outputs]
    for changed_s, from_s in zip(at_s, (0.21, 0.5, 1.0), strict=True):
        assert from_s <= changed_s < from_s + 0.025


def test_an_output_amid_a_record_waits_for_the_next(board: EmbeddedBoard) -> None:
    machine = ready(board)
    machine.run(
        StreamedMotion(still(10, 200), [0] * AXES, (switched("magnet", 0.5, on=True),), wiring=WIRING), lambda _: None
    )
    evidence = board.evidence()
    assert (evidence.outputs[0].counts - evidence.start_counts) / 72e6 == pytest.approx(0.6, abs=0.02)


def test_the_board_is_asked_only_when_it_matters(board: EmbeddedBoard) -> None:
    """The client reads the record number a few times for each output, not at every poll."""
    machine = ready(board)
    commands = tuple(switched("magnet", 0.3 * i, on=bool(i % 2)) for i in range(1, 10))
    machine.run(StreamedMotion(still(300, 10), [0] * AXES, commands, wiring=WIRING), lambda _: None)
    assert len(frames_to(board, 0x610, bytes.fromhex("40122004"))) <= 3 * len(commands)
