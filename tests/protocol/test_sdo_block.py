"""SDO block transfers: in raw bytes, and by the canopen library's own client over a loop-back without threads."""

from binascii import crc_hqx
from collections.abc import Callable

import canopen
import pytest
from canopen.sdo.client import SdoClient
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.sdo_server import SdoServer
from tests.compiled import on_sources_only
from tests.one_example import one_example

pytestmark = on_sources_only
NODE = 0x10
NAME = b"StepTwin stepper axis (SIMULATED)"
BLOB = bytes(i * 7 % 251 for i in range(2000))


class BlobDictionary(ObjectDictionary):
    """A dictionary with one long object more, 2F10h, which no axis has."""

    def __init__(self) -> None:
        super().__init__(NODE)
        self.blob = BLOB

    def read(self, address: int) -> bytes:
        return self.blob if address == 0x2F10_00 else super().read(address)

    def write(self, address: int, data: bytes) -> None:
        if address == 0x2F10_00:
            self.blob = data
        else:
            super().write(address, data)

    def size_to_write(self, address: int) -> int:
        return 5000 if address == 0x2F10_00 else super().size_to_write(address)


Filter = Callable[[bytes], bool]


class LoopBack(canopen.Network):
    """A network that delivers inside `send`: requests to the server, its answers to the client."""

    def __init__(self, server: SdoServer, arrives: Filter = lambda _data: True) -> None:
        super().__init__()
        self._server = server
        self._arrives = arrives
        self.answers: list[bytes] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert (can_id, remote) == (0x600 + NODE, False)
        if self._arrives(bytes(data)):
            for answer in self._server.handle(bytes(data)):
                self.answers.append(answer)
                self.notify(0x580 + NODE, bytearray(answer), 0.0)


def client_of(dictionary: ObjectDictionary, arrives: Filter = lambda _data: True) -> SdoClient:
    network = LoopBack(SdoServer(dictionary), arrives)
    node = canopen.RemoteNode(NODE, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    network.add_node(node)
    sdo: SdoClient = node.sdo
    return sdo


def read(client: SdoClient, index: int, *, crc: bool = True) -> bytes:
    stream = client.open(index, 0, "rb", block_transfer=True, request_crc_support=crc)  # type: ignore[no-untyped-call]
    with stream:
        return bytes(stream.read())


def write(client: SdoClient, index: int, data: bytes, *, crc: bool = True, buffering: int = 1024) -> None:
    stream = client.open(  # type: ignore[no-untyped-call]
        index, 0, "wb", size=len(data), block_transfer=True, request_crc_support=crc, buffering=buffering
    )
    with stream:
        stream.write(data)


class TestWithTheCanopenClient:
    @pytest.mark.parametrize("crc", [True, False])
    def test_upload_of_an_axis_own_string(self, crc: bool) -> None:
        assert read(client_of(ObjectDictionary(NODE)), 0x1008, crc=crc) == NAME

    @pytest.mark.parametrize("size", [0, 1, 6, 7, 8, 888, 889, 890, 2000])
    def test_upload_of_any_length(self, size: int) -> None:
        """A block of the client's 127 segments holds 889 bytes."""
        dictionary = BlobDictionary()
        dictionary.blob = BLOB[:size]
        assert read(client_of(dictionary), 0x2F10) == BLOB[:size]

    @pytest.mark.parametrize("crc", [True, False])
    @pytest.mark.parametrize("size", [1, 6, 7, 8, 216, 217, 218, 2000])
    def test_download_of_any_length(self, size: int, crc: bool) -> None:
        """A block of the server's 31 segments holds 217 bytes."""
        dictionary = BlobDictionary()
        write(client_of(dictionary), 0x2F10, BLOB[::-1][:size], crc=crc)
        assert dictionary.blob == BLOB[::-1][:size]

    def test_download_of_an_axis_own_number(self) -> None:
        dictionary = ObjectDictionary(NODE)
        write(client_of(dictionary), 0x607C, (123_456).to_bytes(4, "little"))
        assert dictionary.get(od.HOME_OFFSET) == 123_456

    def test_a_segment_that_is_lost_on_the_way_in_is_sent_again(self) -> None:
        lost: list[bytes] = []

        def arrives(data: bytes) -> bool:
            lose = data[0] == 5 and not lost
            if lose:
                lost.append(data)
            return not lose

        dictionary = BlobDictionary()
        write(client_of(dictionary, arrives), 0x2F10, BLOB[:1000][::-1])
        assert lost
        assert dictionary.blob == BLOB[:1000][::-1]

    @pytest.mark.parametrize(
        ("index", "data", "code"),
        [
            (0x1000, b"\1\2\3\4", 0x0601_0002),
            (0x9999, b"\1\2\3\4", 0x0602_0000),
            (0x607C, b"\1\2\3\4\5", 0x0607_0012),
            (0x607C, b"\1\2\3", 0x0607_0013),
            (0x1019, b"\xff", 0x0609_0031),
        ],
    )
    def test_refusals_reach_the_client(self, index: int, data: bytes, code: int) -> None:
        with pytest.raises(canopen.SdoAbortedError) as caught:
            write(client_of(ObjectDictionary(NODE)), index, data, buffering=0)
        assert caught.value.code == code

    def test_reading_nothing_is_refused(self) -> None:
        with pytest.raises(canopen.SdoAbortedError) as caught:
            read(client_of(ObjectDictionary(NODE)), 0x9999)
        assert caught.value.code == 0x0602_0000


def exchange(server: SdoServer, *requests: str) -> list[str]:
    """Return the answers to the last of these requests."""
    answers: list[bytes] = []
    for request in requests:
        answers = server.handle(bytes.fromhex(request))
    return [answer.hex(" ") for answer in answers]


READ_NAME = "a4 08 10 00 7f 00 00 00"
START = "a3 00 00 00 00 00 00 00"
WRITE_OFFSET = "c6 7c 60 00 04 00 00 00"
OFFSET = bytes.fromhex("40 e2 01 00")
SEGMENT = "81 40 e2 01 00 00 00 00"
END = f"cd {crc_hqx(OFFSET, 0).to_bytes(2, 'little').hex(' ')} 00 00 00 00 00"
"""End of the download; three bytes of its only segment are fill bytes."""


def abort(code: int, head: str) -> list[str]:
    return [f"80 {head} " + code.to_bytes(4, "little").hex(" ")]


class TestRawUpload:
    def test_the_frames(self) -> None:
        server = SdoServer(ObjectDictionary(NODE))
        assert exchange(server, READ_NAME) == ["c6 08 10 00 21 00 00 00"]
        segments = [bytes.fromhex(line) for line in exchange(server, START)]
        assert [segment[0] for segment in segments] == [1, 2, 3, 4, 0x85]
        assert b"".join(segment[1:] for segment in segments) == NAME + bytes(2)
        crc = crc_hqx(NAME, 0).to_bytes(2, "little").hex(" ")
        assert exchange(server, "a2 05 7f 00 00 00 00 00") == [f"c9 {crc} 00 00 00 00 00"]
        assert exchange(server, "a1 00 00 00 00 00 00 00") == []
        assert exchange(server, START) == abort(0x0504_0001, "00 00 00")

    def test_segments_without_acknowledgement_are_sent_again_in_blocks_of_the_new_size(self) -> None:
        server = SdoServer(ObjectDictionary(NODE))
        exchange(server, READ_NAME, START)
        again = exchange(server, "a2 02 02 00 00 00 00 00")
        assert [bytes.fromhex(line) for line in again] == [b"\1" + NAME[14:21], b"\2" + NAME[21:28]]
        assert exchange(server, "a2 02 02 00 00 00 00 00") == [(b"\x81" + NAME[28:] + bytes(2)).hex(" ")]

    @pytest.mark.parametrize("size", ["00", "80", "ff"])
    def test_block_sizes_that_do_not_exist(self, size: str) -> None:
        server = SdoServer(ObjectDictionary(NODE))
        assert exchange(server, f"a4 08 10 00 {size} 00 00 00") == abort(0x0504_0002, "08 10 00")
        exchange(server, READ_NAME, START)
        assert exchange(server, f"a2 02 {size} 00 00 00 00 00") == abort(0x0504_0002, "08 10 00")

    def test_more_acknowledged_than_sent(self) -> None:
        server = SdoServer(ObjectDictionary(NODE))
        exchange(server, READ_NAME, START)
        assert exchange(server, "a2 06 7f 00 00 00 00 00") == abort(0x0504_0003, "08 10 00")
        assert exchange(server, "a2 05 7f 00 00 00 00 00") == abort(0x0504_0001, "00 00 00")

    @pytest.mark.parametrize("requests", [[START, START], ["a2 01 7f 00 00 00 00 00"], ["60 00 00 00 00 00 00 00"]])
    def test_requests_that_are_not_due(self, requests: list[str]) -> None:
        server = SdoServer(ObjectDictionary(NODE))
        assert exchange(server, READ_NAME, *requests) == abort(0x0504_0001, "08 10 00")


class TestRawDownload:
    def test_the_frames(self) -> None:
        dictionary = ObjectDictionary(NODE)
        server = SdoServer(dictionary)
        assert exchange(server, WRITE_OFFSET) == ["a4 7c 60 00 1f 00 00 00"]
        assert exchange(server, SEGMENT) == ["a2 01 1f 00 00 00 00 00"]
        assert exchange(server, END) == ["a1 00 00 00 00 00 00 00"]
        assert dictionary.get(od.HOME_OFFSET) == 123_456

    @pytest.mark.parametrize(
        ("requests", "code"),
        [
            pytest.param([WRITE_OFFSET, SEGMENT, "cd 00 00 00 00 00 00 00"], 0x0504_0004, id="CRC"),
            pytest.param([WRITE_OFFSET, END], 0x0504_0001, id="an end before the last segment"),
            pytest.param(["c2 7c 60 00 03 00 00 00", SEGMENT, END], 0x0607_0010, id="not the announced size"),
            pytest.param(["c0 7c 60 00 00 00 00 00", "81" + " 00" * 7, "d1" + " 00" * 7], 0x0607_0013, id="short"),
            pytest.param(["c0 7c 60 00 00 00 00 00", "81" + " 00" * 7, "c9" + " 00" * 7], 0x0607_0012, id="long"),
            pytest.param(["c0 7c 60 00 00 00 00 00", "01" + " 00" * 7, "02" + " 00" * 7], 0x0607_0012, id="endless"),
        ],
    )
    def test_refusals(self, requests: list[str], code: int) -> None:
        dictionary = ObjectDictionary(NODE)
        assert exchange(SdoServer(dictionary), *requests) == abort(code, "7c 60 00")
        assert dictionary.get(od.HOME_OFFSET) == 0

    def test_a_last_segment_out_of_order_is_asked_for_again(self) -> None:
        dictionary = BlobDictionary()
        server = SdoServer(dictionary)
        assert exchange(server, "c0 10 2f 00 00 00 00 00", "01 01 02 03 04 05 06 07") == []
        assert exchange(server, "83 11 12 13 14 15 16 17") == ["a2 01 1f 00 00 00 00 00"]
        assert exchange(server, "81 08 09 00 00 00 00 00") == ["a2 01 1f 00 00 00 00 00"]
        assert exchange(server, "d5 00 00 00 00 00 00 00") == ["a1 00 00 00 00 00 00 00"]
        assert dictionary.blob == bytes(range(1, 10))

    @pytest.mark.parametrize(
        ("request_", "answer"),
        [
            ("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 04 00"),
            ("2b 17 10 00 f4 01 00 00", "60 17 10 00 00 00 00 00"),
            (READ_NAME, "c6 08 10 00 21 00 00 00"),
            (WRITE_OFFSET, "a4 7c 60 00 1f 00 00 00"),
        ],
    )
    def test_a_new_initiation_drops_a_transfer_in_the_middle_of_its_block(self, request_: str, answer: str) -> None:
        server = SdoServer(BlobDictionary())
        exchange(server, "c0 10 2f 00 00 00 00 00", "01 01 02 03 04 05 06 07")
        assert exchange(server, request_) == [answer]

    def test_a_client_may_abort_in_the_middle_of_a_block(self) -> None:
        server = SdoServer(BlobDictionary())
        exchange(server, "c0 10 2f 00 00 00 00 00", "01 01 02 03 04 05 06 07")
        assert exchange(server, "80 10 2f 00 00 00 04 05") == []
        assert exchange(server, "81 01 02 03 04 05 06 07") == []
        assert exchange(server, "c1 00 00 00 00 00 00 00") == abort(0x0504_0001, "00 00 00")


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(list(range(256))), st.binary(min_size=7, max_size=7)), max_size=60))
def test_junk_never_raises(frames: list[tuple[int, bytes]]) -> None:
    server = SdoServer(BlobDictionary())
    for first, rest in frames:
        assert all(len(answer) == 8 for answer in server.handle(bytes((first,)) + rest))


def test_some_junk_does_not_raise() -> None:
    one_example(test_junk_never_raises, [(first, bytes((0, 16, 47, 0, 1, 2, 3))) for first in range(256)])
