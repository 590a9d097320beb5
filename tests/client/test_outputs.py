"""Digital outputs through the client: switched one by one, at their times, and not waited for."""

import pytest

from controller.backend import Kernel
from host.client import Machine, OutputCommand
from host.client.outputs import OutputSchedule
from host.embedded import EmbeddedBoard
from host.robots import load_robot
from host.verify import OutputChange
from protocol.cia402 import DigitalOutput
from protocol.frame import COB_SYNC

MAGNET, LOCK = DigitalOutput.OUT1, DigitalOutput.OUT2
TH3 = 5


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(load_robot("warehouse-scara"), [0.0, 0.0, 100.0, 0.0, 60.0, 30.0], fast_kernel)


@pytest.fixture
def machine(board: EmbeddedBoard) -> Machine:
    made = Machine(board, ("sx", "sz", "L1", "th1", "th2", "th3"))
    made.connect()
    return made


def changes(board: EmbeddedBoard) -> list[OutputChange]:
    board.network.send_message(COB_SYNC, b"")  # evidence counts from a SYNC
    return list(board.evidence().outputs)


def test_one_output_leaves_the_others_alone(machine: Machine, board: EmbeddedBoard) -> None:
    th3 = machine.axes[TH3]
    for output, on in ((MAGNET, True), (LOCK, True), (MAGNET, True), (MAGNET, False)):
        th3.switch_output(output, on=on)
    assert [(change.name, change.level) for change in changes(board)] == [("magnet", 1), ("lock", 1), ("magnet", 0)]
    assert th3.read(0x60FE, 1) == LOCK


def test_what_nothing_is_wired_to_is_no_evidence(machine: Machine, board: EmbeddedBoard) -> None:
    machine.axes[0].switch_output(MAGNET, on=True)
    assert changes(board) == []


def test_a_schedule_sends_what_is_due_and_no_more(machine: Machine, board: EmbeddedBoard) -> None:
    started_s = board.now_s()
    commands = (
        OutputCommand(TH3, LOCK, on=True, from_s=0.5),
        OutputCommand(TH3, MAGNET, on=True, from_s=0.2),
        OutputCommand(TH3, MAGNET, on=False, from_s=9.0),
    )
    schedule = OutputSchedule(machine.axes, commands, started_s)
    for wait_s in (0.199, 0.002, 0.25, 0.1, 0.1):
        board.wait(wait_s)
        schedule.tend(board.now_s())
    made = changes(board)
    assert [(change.name, change.level) for change in made] == [("magnet", 1), ("lock", 1)]
    late_s = [change.counts / 72e6 - started_s for change in made]
    assert late_s == pytest.approx([0.201, 0.55], abs=0.005)
