"""Nodes that answer SDO requests wrongly: one line that names the axis, no other exception, no endless wait."""

from collections.abc import Callable
from contextlib import suppress
from queue import Queue

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.host.client import AxisClient, Machine
from steptwin.host.client.shared_node import SEGMENTS_MAX
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.host.client.machines import ready
from tests.messages import refusing

ABORT = 0x80
Answer = Callable[[bytes], bytes | None]


def answer_by(board: EmbeddedBoard, patch: pytest.MonkeyPatch, answer: Answer) -> None:
    """Let a function answer what node 0x10 is asked, in its place."""
    send: Callable[[int, bytes, bool], None] = board.network.send_message

    def send_message(can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id != 0x610:
            send(can_id, data, remote)
        elif data[0] != ABORT and (said := answer(bytes(data))) is not None:
            board.network.notify(0x590, bytearray(said), 0.0)

    patch.setattr(board.network, "send_message", send_message)


@pytest.fixture
def machine(board: EmbeddedBoard) -> Machine:
    return ready(board)


@pytest.fixture
def axis(machine: Machine) -> AxisClient:
    return machine.axes[0]


@pytest.mark.parametrize("said", ["4f7f600011000000", "4b7f600011220000"])
def test_fewer_bytes_than_the_object_has(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, said: str
) -> None:
    answer_by(board, monkeypatch, lambda _: bytes.fromhex(said))
    with refusing(BusError):
        axis.read(od.MAX_PROFILE_VELOCITY)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_a_frame_that_is_no_answer(
    board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    whole = bytes.fromhex("437f600000010000")
    answer_by(board, monkeypatch, lambda _: whole[:length])
    with refusing(BusError):
        axis.read(od.MAX_PROFILE_VELOCITY)


def test_a_string_without_end(board: EmbeddedBoard, axis: AxisClient, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def endless(request: bytes) -> bytes | None:
        asked.append(request[0])
        if request[0] == 0x40:
            return bytes.fromhex("41081000ffffffff")
        return bytes([request[0] & 0x10]) + b"endless" if request[0] & 0xE0 == 0x60 else None

    answer_by(board, monkeypatch, endless)
    with refusing(BusError):
        axis.read_text(od.DEVICE_NAME)
    assert len(asked) == 5 * (1 + SEGMENTS_MAX)


@pytest.mark.slow
@given(st.lists(st.binary(max_size=8), min_size=1, max_size=8))
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_answers(board: EmbeddedBoard, axis: AxisClient, said: list[bytes]) -> None:
    """Whatever a node says, the client returns a value or raises one of its own errors."""
    answers = iter(said * 400)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("steptwin.host.client.shared_node._PATIENCE_S", 0.001)
        patch.setattr("steptwin.host.client.shared_node._IMPATIENCE_S", 0.001)
        answer_by(board, patch, lambda _: next(answers))
        for exchange in (
            lambda: axis.read(od.STATUSWORD),
            lambda: axis.write(od.TARGET_POSITION, 1),
            lambda: axis.read_text(od.DEVICE_NAME),
        ):
            with suppress(BusError, DeviceFaultError):
                exchange()


def test_after_a_silent_node_the_others_are_asked_but_hardly_waited_for(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An answer of any node restores the patience."""
    first, second = machine.axes[:2]
    waited_s = []

    get = Queue.get

    def look(queue: Queue[object], timeout: float) -> object:
        waited_s.append(timeout)
        return get(queue, block=False)

    monkeypatch.setattr(Queue, "get", look)
    answer_by(board, monkeypatch, lambda _: None)
    for axis in (first, first, second, first):
        with suppress(BusError):
            axis.read(od.STATUSWORD)
    assert waited_s == [0.05] * (16 + 1 + 1 + 16)  # in pieces: 0.8 s, 0.05 s, 0.05 s, 0.8 s
