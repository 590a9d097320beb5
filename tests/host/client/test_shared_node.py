"""SDO writes of one frame, as CiA 301 has them (7.2.4.3.3): what is sent, and answers that do not fit."""

import pytest
from canopen import Network
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from steptwin.host.client.shared_node import Patience, SharedSdoClient
from tests.messages import refusing

OBJECT = bytes.fromhex("7a6000")
WRITTEN = b"\x60" + OBJECT + bytes(4)


class Wire(Network):
    """What a client sends, and answers to it, which come at once."""

    def __init__(self, *answers: bytes) -> None:
        super().__init__()
        self.sent: list[str] = []
        self._answers = list(answers)
        self.client = SharedSdoClient(0x610, 0x590, ObjectDictionary())  # type: ignore[no-untyped-call]
        self.client.network = self
        self.client.patience = Patience()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert (can_id, remote) == (0x610, False)
        self.sent.append(bytes(data).hex(" "))
        if self._answers:
            self.client.on_response(0x590, bytearray(self._answers.pop(0)), 0.0)


@pytest.mark.parametrize(
    ("data", "request_frame"),
    [
        ("01", "2f 7a 60 00 01 00 00 00"),
        ("0102", "2b 7a 60 00 01 02 00 00"),
        ("010203", "27 7a 60 00 01 02 03 00"),
        ("01020304", "23 7a 60 00 01 02 03 04"),
    ],
)
def test_up_to_four_bytes_are_one_frame(data: str, request_frame: str) -> None:
    wire = Wire(WRITTEN)
    wire.client.download(0x607A, 0, bytes.fromhex(data))
    assert wire.sent == [request_frame]


@pytest.mark.parametrize(
    ("data", "segment", "forced"),
    [
        ("0102030405", "05 01 02 03 04 05 00 00", False),
        ("0102", "0b 01 02 00 00 00 00 00", True),
        ("", "0f 00 00 00 00 00 00 00", False),
    ],
)
def test_more_bytes_or_none_come_in_segments(data: str, segment: str, forced: bool) -> None:
    wire = Wire(WRITTEN, b"\x20" + bytes(7))
    wire.client.download(0x607A, 0, bytes.fromhex(data), force_segment=forced)
    assert wire.sent == [f"21 7a 60 00 {len(data) // 2:02x} 00 00 00", segment]


def test_a_refusal_has_its_code() -> None:
    wire = Wire(b"\x80" + OBJECT + bytes.fromhex("30000906"))
    with pytest.raises(SdoAbortedError) as caught:
        wire.client.download(0x607A, 0, b"\x01")
    assert caught.value.code == 0x0609_0030
    assert len(wire.sent) == 1


@pytest.mark.parametrize(
    "strange", ["60 7b 60 00 00 00 00 00", "60 7a 60 00", "80 7a 60 01 00 00 09 06", "43 7a 60 00 00 00 00 00"]
)
def test_answers_to_others_and_parts_of_answers_do_not_count(strange: str) -> None:
    wire = Wire(bytes.fromhex(strange))
    wire.client.patience.timeout_s = 0.01
    with refusing(SdoCommunicationError):
        wire.client.download(0x607A, 0, b"\x01")
    assert wire.client.malformed == (len(bytes.fromhex(strange)) != 8)
    assert wire.sent[1:] == ["80 00 00 00 00 00 04 05"]  # 0504 0000h, time-out
