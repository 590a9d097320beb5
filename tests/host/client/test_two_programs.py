"""Two programs ask the same node: each sees the other's answers and waits for its own, or asks again."""

from collections.abc import Callable

import pytest

from steptwin.host.client import AxisClient
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.host.client.machines import ready

IS_TWO_BYTES_OF_6064 = bytes.fromhex("4b64600034120000")
WRITTEN_6064 = bytes.fromhex("6064600000000000")
NO_SUCH_OBJECT_5FFF = bytes.fromhex("80ff5f0000000206")
WRITTEN_607F = bytes.fromhex("607f600000000000")


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


@pytest.fixture
def axis(board: EmbeddedBoard) -> AxisClient:
    return ready(board).axes[0]


@pytest.mark.parametrize("answer", [IS_TWO_BYTES_OF_6064, WRITTEN_6064, NO_SUCH_OBJECT_5FFF])
def test_answers_about_other_objects(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    """Any number of answers about other objects is dropped."""
    answers_first(board, monkeypatch, answer, times=1000)
    assert axis.read(od.MAX_PROFILE_VELOCITY) == 15_360_000
    axis.write(od.TARGET_POSITION, 4711)
    assert axis.read(od.TARGET_POSITION) == 4711


def test_another_dialogue_about_the_same_object(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other program writes the object that this one reads, so this one asks again."""
    answers_first(board, monkeypatch, WRITTEN_607F, times=4)
    assert axis.read(od.MAX_PROFILE_VELOCITY) == 15_360_000


def test_the_client_gives_up_after_five_dialogues(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers_first(board, monkeypatch, WRITTEN_607F, times=5)
    with pytest.raises(BusError, match=r"^sx: node 0x10 gives no valid answer \(Unexpected response 0x60\)$"):
        axis.read(od.MAX_PROFILE_VELOCITY)


@pytest.mark.parametrize("code", ["00000305", "01000405"])
def test_reading_in_segments(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, code: str
) -> None:
    answers_first(board, monkeypatch, bytes.fromhex("80081000" + code), times=2)
    assert axis.read_text(od.DEVICE_NAME).startswith("StepTwin TB6560 axis")


def test_a_refusal_is_final(axis: AxisClient) -> None:
    with pytest.raises(DeviceFaultError, match=r"writing 7 to 0x605A:00 was refused"):
        axis.write(od.QUICK_STOP_OPTION, 7)
