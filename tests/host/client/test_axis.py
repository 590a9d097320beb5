"""The client when a node refuses a request, does not answer, or sends a malformed report."""

import pytest

from steptwin.host.client import Machine
from steptwin.host.client.words import error_text
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, Mode
from steptwin.protocol.frame import Frame
from tests.host.client.machines import AXES, ROBOT, SETTINGS, STEP, SX, TH1, TH2, connected
from tests.messages import refusing


@pytest.fixture
def machine(board: EmbeddedBoard) -> Machine:
    """A machine whose drives are off."""
    return connected(board)


def test_objects_are_read_and_written(machine: Machine) -> None:
    th1 = machine.axes[TH1]
    th1.write(od.STEPSPACE_NS, 40_000)
    assert th1.read(od.STEPSPACE_NS) == 40_000
    assert th1.read(od.SUPPORTED_DRIVE_MODES) == 0b1_1110_0101


@pytest.mark.parametrize(
    ("address", "value"),
    [
        (od.MICROSTEPS, 3),
        (od.DEVICE_TYPE, 1),
        (od.MODE_OF_OPERATION, 4),
    ],
)
def test_a_refusal_names_axis_object_and_value(machine: Machine, address: int, value: int) -> None:
    with refusing(DeviceFaultError):
        machine.axes[TH2].write(address, value)
    assert DeviceFaultError.exit_code == 3


def test_reading_what_is_write_only_is_refused(machine: Machine) -> None:
    with refusing(DeviceFaultError):
        machine.axes[SX].read(od.BUFFER_CLEAR)


def test_a_node_that_is_not_there(board: EmbeddedBoard) -> None:
    with refusing(BusError):
        Machine(board, (*ROBOT.joint_names, "seventh")).connect()
    with refusing(BusError):
        Machine(board, (*ROBOT.joint_names, "seventh")).axes[6].write(od.CONTROLWORD, 0)


def test_a_drive_that_cannot_be_enabled(
    machine: Machine, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An underrun leaves the drive in FAULT, and enabling does not reset a fault; a late host may be the cause."""
    machine.configure((SETTINGS,) * AXES)
    machine.enable()
    th1 = machine.axes[TH1]
    th1.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION)
    for sequence in range(5):  # 4 kHz without a ramp to rest: an underrun
        velocity = 4 * STEP * 64
        displacement = 40 * STEP if sequence == 0 else 80 * STEP
        data = displacement.to_bytes(3, "little") + velocity.to_bytes(3, "little") + bytes((20, sequence))
        board.network.send_message(0x513, data)
    th1.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
    board.wait(2.0)
    assert th1.in_fault
    assert th1.error_codes == [0xFF01]
    monkeypatch.setattr(EmbeddedBoard, "held_up_s", 0.099)
    assert str(th1.fault()) == "th1: pvt underrun (EMCY 0xFF01)"
    monkeypatch.setattr(EmbeddedBoard, "held_up_s", 0.574)
    slow = "; this computer was too slow: this program was held up for 574 ms"
    assert str(th1.fault()) == f"th1: pvt underrun (EMCY 0xFF01){slow}"
    assert th1.fault().plain == f"th1: the motion came too late{slow}"
    with refusing(DeviceFaultError) as refused:
        th1.enable()
    assert refused.value.plain == "th1 cannot be switched on: the motion came too late"


def test_unknown_error_codes() -> None:
    assert error_text(0xFF01) == "pvt underrun"
    assert error_text(0x1234) == "unknown error"


def test_of_remote_frames_only_node_guarding_has_an_answer(machine: Machine, board: EmbeddedBoard) -> None:
    del machine
    before = len(board.bus_log)
    board.network.send_message(0x181, b"", remote=True)
    board.network.send_message(0x710, b"", remote=True)
    board.wait(0.0005)
    identifiers = [frame.cob_id & 0x7FF for _, frame in board.bus_log[before:]]
    assert [each for each in identifiers if each in (0x181, 0x710)] == [0x181, 0x710, 0x710]


def test_malformed_reports_are_ignored(machine: Machine, board: EmbeddedBoard) -> None:
    th1 = machine.axes[TH1]
    board.network.notify(0x193, bytearray(b"\x08"), 0.0)
    board.network.notify(0x393, bytearray(7), 0.0)
    assert not th1.in_fault
    assert th1.pvt_status is None


def test_the_bus_log_holds_every_frame_once(machine: Machine, board: EmbeddedBoard) -> None:
    before = len(board.bus_log)
    machine.axes[SX].read(od.DEVICE_TYPE)
    request, response = board.bus_log[before:]
    assert request[1] == Frame(0x610, bytes.fromhex("4000100000000000"))
    assert response[1] == Frame(0x590, bytes.fromhex("4300100092010400"))
    assert request[0] < response[0]
