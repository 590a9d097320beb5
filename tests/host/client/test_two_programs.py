"""Two programs ask the same node: each sees the other's answers and waits for its own, or asks again."""

from collections.abc import Callable

import pytest

from steptwin.host.client import AxisClient
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.host.client.machines import ready
from tests.messages import refusing

IS_TWO_BYTES_OF_6064 = bytes.fromhex("4b64600034120000")
WRITTEN_6064 = bytes.fromhex("6064600000000000")
NO_SUCH_OBJECT_5FFF = bytes.fromhex("80ff5f0000000206")
WRITTEN_607F = bytes.fromhex("607f600000000000")
WRITES_607A = bytes.fromhex("237a600001000000")
WRITTEN_607A = bytes.fromhex("607a600000000000")
REFUSED_607A = bytes.fromhex("807a600022000008")


def answers_first(board: EmbeddedBoard, patch: pytest.MonkeyPatch, answer: bytes, times: int) -> None:
    """Let an answer to another program arrive before the answer to each of the next `times` requests to node 0x10."""
    send: Callable[[int, bytes, bool], None] = board.network.send_message
    left = [times]

    def send_message(can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id == 0x610 and data[0] != 0x80 and left[0]:
            left[0] -= 1
            board.network.notify(0x590, bytearray(answer), 0.0)
        send(can_id, data, remote)

    patch.setattr(board.network, "send_message", send_message)


def rivalry(
    board: EmbeddedBoard, patch: pytest.MonkeyPatch, request: bytes, answer: bytes, *, times: int, theirs_first: bool
) -> Callable[[], int]:
    """Let another program ask node 0x10, too, at each of the next `times` requests, and be answered first or second.

    Return a function that tells how often it has asked.
    """
    send: Callable[[int, bytes, bool], None] = board.network.send_message
    asked = [0]

    def send_message(can_id: int, data: bytes, remote: bool = False) -> None:
        rival = can_id == 0x610 and data[0] != 0x80 and asked[0] < times
        if rival:
            asked[0] += 1
            board.network.notify(0x610, bytearray(request), 0.0)
        if rival and theirs_first:
            board.network.notify(0x590, bytearray(answer), 0.0)
        send(can_id, data, remote)
        if rival and not theirs_first:
            board.network.notify(0x590, bytearray(answer), 0.0)

    patch.setattr(board.network, "send_message", send_message)
    return lambda: asked[0]


def sent(patch: pytest.MonkeyPatch, board: EmbeddedBoard, action: Callable[[], None]) -> list[bytes]:
    """Return the SDO requests to node 0x10 of an action."""
    send: Callable[[int, bytes, bool], None] = board.network.send_message
    requests = []

    def send_message(can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id == 0x610:
            requests.append(bytes(data))
        send(can_id, data, remote)

    with patch.context() as here:
        here.setattr(board.network, "send_message", send_message)
        action()
    return requests


@pytest.fixture
def axis(board: EmbeddedBoard) -> AxisClient:
    return ready(board).axes[0]


@pytest.mark.parametrize("answer", [IS_TWO_BYTES_OF_6064, NO_SUCH_OBJECT_5FFF, WRITTEN_607F])
def test_answers_to_other_requests(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    """Any number of answers about other objects, or to another command, is dropped."""
    answers_first(board, monkeypatch, answer, times=1000)
    assert axis.read(od.MAX_PROFILE_VELOCITY) == 15_360_000
    axis.write(od.TARGET_POSITION, 4711)
    assert axis.read(od.TARGET_POSITION) == 4711


@pytest.mark.parametrize("answer", [REFUSED_607A, WRITTEN_607A])
@pytest.mark.parametrize("theirs_first", [True, False])
def test_another_program_writes_the_same_object(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, answer: bytes, theirs_first: bool
) -> None:
    """This one hears that request, so it waits for both answers and asks again: neither is surely its own."""
    rivals = rivalry(board, monkeypatch, WRITES_607A, answer, times=4, theirs_first=theirs_first)
    axis.write(od.TARGET_POSITION, 4711)
    assert (rivals(), axis.read(od.TARGET_POSITION)) == (4, 4711)
    with refusing(DeviceFaultError):
        axis.write(od.MODE_OF_OPERATION, 99)


def test_a_value_is_anyones(board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch) -> None:
    rivals = rivalry(board, monkeypatch, WRITES_607A, WRITTEN_607A, times=1, theirs_first=True)
    assert (axis.read(od.TARGET_POSITION), rivals()) == (0, 1)


def test_the_client_gives_up_after_five_dialogues(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    rivalry(board, monkeypatch, WRITES_607A, WRITTEN_607A, times=5, theirs_first=True)
    with refusing(BusError):
        axis.write(od.TARGET_POSITION, 4711)


@pytest.mark.usefixtures("impatient")
def test_a_program_that_never_gets_its_answer_holds_nobody_up(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its answer was lost: this program waits for it as long as for its own, then asks again."""
    board.network.notify(0x610, bytearray(WRITES_607A), 0.0)
    axis.write(od.TARGET_POSITION, 4711)
    assert len(sent(monkeypatch, board, lambda: axis.write(od.TARGET_POSITION, 4712))) == 1


@pytest.mark.parametrize("code", ["00000305", "01000405"])
def test_reading_in_segments(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, code: str
) -> None:
    answers_first(board, monkeypatch, bytes.fromhex("80081000" + code), times=2)
    assert axis.read_text(od.DEVICE_NAME).startswith("StepTwin stepper axis")


def test_a_refusal_is_final(axis: AxisClient) -> None:
    with refusing(DeviceFaultError):
        axis.write(od.QUICK_STOP_OPTION, 7)
