"""The SDO server by scripted exchanges in raw bytes, and every entry of the dictionary in and out of its range."""

import pytest

from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.entry import Access, DataType, DictionaryObject, Entry, encode
from steptwin.protocol.objects import OBJECTS
from steptwin.protocol.sdo_frames import AbortCode
from steptwin.protocol.sdo_server import SdoServer

NODE = 0x12
ENTRIES = [(item, subindex, entry) for item in OBJECTS for subindex, entry in item.entries.items()]
PDO_PARAMETERS = range(0x1400, 0x1C00)
"""Objects whose rules of writing the PDO tests check."""


def server() -> SdoServer:
    return SdoServer(ObjectDictionary(NODE))


def abort(code: int, head: str) -> str:
    return f"80 {head} " + code.to_bytes(4, "little").hex(" ")


@pytest.mark.parametrize(
    "script",
    [
        pytest.param([("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 04 00")], id="expedited upload of 4 bytes"),
        pytest.param([("40 60 60 00 00 00 00 00", "4f 60 60 00 00 00 00 00")], id="expedited upload of 1 byte"),
        pytest.param(
            [
                ("2b 17 10 00 f4 01 00 00", "60 17 10 00 00 00 00 00"),
                ("40 17 10 00 00 00 00 00", "4b 17 10 00 f4 01 00 00"),
            ],
            id="expedited download and read back",
        ),
        pytest.param(
            [("22 17 10 00 f4 01 00 00", "60 17 10 00 00 00 00 00")], id="download without a size takes the entry's"
        ),
        pytest.param(
            [
                ("40 09 10 00 00 00 00 00", "41 09 10 00 14 00 00 00"),
                ("60 00 00 00 00 00 00 00", "00 53 54 4d 33 32 46 31"),
                ("70 00 00 00 00 00 00 00", "10 30 33 20 2b 20 53 54"),
                ("60 00 00 00 00 00 00 00", "03 45 50 2f 44 49 52 00"),
            ],
            id="segmented upload of 'STM32F103 + STEP/DIR'",
        ),
        pytest.param(
            [
                ("40 09 10 00 00 00 00 00", "41 09 10 00 14 00 00 00"),
                ("70 00 00 00 00 00 00 00", abort(0x0503_0000, "09 10 00")),
                ("60 00 00 00 00 00 00 00", abort(0x0504_0001, "00 00 00")),
            ],
            id="wrong toggle ends the transfer",
        ),
        pytest.param(
            [
                ("21 7c 60 00 04 00 00 00", "60 7c 60 00 00 00 00 00"),
                ("00 40 e2 01 00 00 00 00", abort(0x0607_0012, "7c 60 00")),
            ],
            id="segmented download of too much",
        ),
        pytest.param(
            [
                ("21 7c 60 00 04 00 00 00", "60 7c 60 00 00 00 00 00"),
                ("07 40 e2 01 00 00 00 00", "20 00 00 00 00 00 00 00"),
                ("40 7c 60 00 00 00 00 00", "43 7c 60 00 40 e2 01 00"),
            ],
            id="segmented download of 4 bytes",
        ),
        pytest.param(
            [
                ("21 7c 60 00 04 00 00 00", "60 7c 60 00 00 00 00 00"),
                ("0c 40 00 00 00 00 00 00", "20 00 00 00 00 00 00 00"),
                ("19 e2 01 00 00 00 00 00", "30 00 00 00 00 00 00 00"),
                ("40 7c 60 00 00 00 00 00", "43 7c 60 00 40 e2 01 00"),
            ],
            id="segmented download in two segments",
        ),
        pytest.param([("21 7c 60 00 05 00 00 00", abort(0x0607_0012, "7c 60 00"))], id="announced size too large"),
        *(
            pytest.param(
                [
                    (f"21 16 20 01 {announced:02x} 00 00 00", "60 16 20 01 00 00 00 00"),
                    ("00 61 62 63 64 65 66 67", "20 00 00 00 00 00 00 00"),
                    ("1b 68 69 00 00 00 00 00", answer),
                ],
                id=f"segmented download of 9 bytes, announced as {announced}",
            )
            for announced, answer in (
                (8, abort(0x0607_0010, "16 20 01")),
                (9, "30 00 00 00 00 00 00 00"),
                (12, abort(0x0607_0010, "16 20 01")),
            )
        ),
        pytest.param([("60 00 00 00 00 00 00 00", abort(0x0504_0001, "00 00 00"))], id="segment without a transfer"),
        pytest.param([("e0 00 10 00 00 00 00 00", abort(0x0504_0001, "00 00 00"))], id="no such command"),
        pytest.param([("21 00 10 00 04 00 00 00", abort(0x0601_0002, "00 10 00"))], id="segments into a constant"),
        pytest.param([("21 99 99 00 04 00 00 00", abort(0x0602_0000, "99 99 00"))], id="segments into nothing"),
        pytest.param([("40 99 99 00 00 00 00 00", abort(0x0602_0000, "99 99 00"))], id="no such object"),
        pytest.param([("40 18 10 09 00 00 00 00", abort(0x0609_0011, "18 10 09"))], id="no such sub-index"),
        pytest.param([("2b 99 99 00 01 00 00 00", abort(0x0602_0000, "99 99 00"))], id="writing no such object"),
        pytest.param([("40 c4 60 06 00 00 00 00", abort(0x0601_0001, "c4 60 06"))], id="reading what is write-only"),
        pytest.param([("2f 01 10 00 01 00 00 00", abort(0x0601_0002, "01 10 00"))], id="writing what is read-only"),
        pytest.param([("2f 17 10 00 01 00 00 00", abort(0x0607_0013, "17 10 00"))], id="too short"),
        pytest.param([("23 17 10 00 01 00 00 00", abort(0x0607_0012, "17 10 00"))], id="too long"),
    ],
)
def test_scripted_exchange(script: list[tuple[str, str]]) -> None:
    sdo = server()
    for request, response in script:
        assert [answer.hex(" ") for answer in sdo.handle(bytes.fromhex(request))] == [response]


def test_an_abort_from_the_client_is_obeyed_in_silence() -> None:
    sdo = server()
    sdo.handle(bytes.fromhex("4008100000000000"))
    assert sdo.handle(bytes.fromhex("8008100000000405")) == []
    [answer] = sdo.handle(bytes.fromhex("6000000000000000"))
    assert answer[0] == 0x80


@pytest.mark.parametrize("length", range(8))
def test_requests_without_eight_bytes_are_dropped_and_counted(length: int) -> None:
    sdo = server()
    assert sdo.handle(bytes(length)) == []
    assert sdo.dropped == 1


def request_for(command: int, item: DictionaryObject, subindex: int, data: bytes = b"") -> bytes:
    return bytes((command, item.index & 0xFF, item.index >> 8, subindex)) + data.ljust(4, b"\0")


def write(sdo: SdoServer, item: DictionaryObject, subindex: int, entry: Entry, value: int) -> bytes:
    data = encode(entry.data_type, value)
    [answer] = sdo.handle(request_for(0x23 | (4 - len(data)) << 2, item, subindex, data))
    return answer


def abort_code(answer: bytes) -> int:
    assert answer[0] == 0x80
    return int.from_bytes(answer[4:], "little")


@pytest.mark.parametrize(
    ("item", "subindex", "entry"), ENTRIES, ids=lambda x: f"{x.index:04X}" if isinstance(x, DictionaryObject) else None
)
def test_every_entry_reads_as_its_default(item: DictionaryObject, subindex: int, entry: Entry) -> None:
    [answer] = server().handle(request_for(0x40, item, subindex))
    if entry.access is Access.WRITE_ONLY:
        assert abort_code(answer) == AbortCode.WRITE_ONLY
    elif entry.data_type is DataType.VISIBLE_STRING:
        assert answer[0] == 0x41
        assert answer[4] == len(str(entry.default))
    else:
        size = entry.data_type.size
        assert answer[0] == 0x43 | (4 - size) << 2
        default = int(entry.default) + (NODE if entry.plus_node_id else 0)
        assert int.from_bytes(answer[4 : 4 + size], "little", signed=entry.data_type.signed) == default


@pytest.mark.parametrize(
    ("item", "subindex", "entry"),
    [row for row in ENTRIES if row[2].data_type is not DataType.VISIBLE_STRING and row[0].index not in PDO_PARAMETERS],
    ids=lambda x: f"{x.index:04X}" if isinstance(x, DictionaryObject) else None,
)
def test_every_entry_is_written_within_its_range_only(item: DictionaryObject, subindex: int, entry: Entry) -> None:
    sdo = server()
    kind = entry.data_type
    low = kind.low if entry.low is None else entry.low
    high = kind.high if entry.high is None else entry.high
    writable = entry.access in (Access.READ_WRITE, Access.WRITE_ONLY)
    for value in {low, high}:
        answer = write(sdo, item, subindex, entry, value)
        if writable and entry.values is not None and value not in entry.values:
            assert abort_code(answer) == AbortCode.VALUE_RANGE
        elif writable:
            assert answer == bytes((0x60, item.index & 0xFF, item.index >> 8, subindex, 0, 0, 0, 0))
        else:
            assert abort_code(answer) == AbortCode.READ_ONLY
    if writable and low > kind.low:
        assert abort_code(write(sdo, item, subindex, entry, low - 1)) == AbortCode.VALUE_TOO_LOW
    if writable and high < kind.high:
        assert abort_code(write(sdo, item, subindex, entry, high + 1)) == AbortCode.VALUE_TOO_HIGH
