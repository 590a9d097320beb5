"""The whole object table of a node, by SDO: every entry is read and written, or refused with the right abort code."""

from collections.abc import Iterator

import pytest

from steptwin.controller.node.pins import DECAY_LEVELS, TORQUE_LEVELS
from steptwin.controller.node.stops import DISABLES, FAULT_REACTIONS, HALTS, QUICK_STOPS, SHUTDOWNS
from steptwin.protocol import od
from steptwin.protocol.dictionary import TEXT_BYTES_MAX, ObjectDictionary
from steptwin.protocol.entry import Access, DataType, DictionaryObject, Entry, encode
from steptwin.protocol.objects import ENTRIES, OBJECTS
from steptwin.protocol.sdo_frames import AbortCode
from steptwin.protocol.sdo_server import SdoServer
from tests.controller.bench_board import BenchBoard

TABLE = [(item.index, subindex, entry) for item in OBJECTS for subindex, entry in item.entries.items()]
WRITABLE = (Access.READ_WRITE, Access.WRITE_ONLY)
DONE = 0
RANGE, STATE = AbortCode.VALUE_RANGE, AbortCode.DEVICE_STATE

Outcome = tuple[int, int]
"""The results of writing the least and the greatest value of the range."""


def pdo_rules() -> Iterator[tuple[tuple[int, int], Outcome]]:
    """Identifiers are never 0 or 2^32-1; all PDOs but TPDO2 exist, and so their mapping is fixed."""
    for number in range(4):
        off = number == 1
        for communication, mapping in ((0x1400 + number, 0x1600 + number), (0x1800 + number, 0x1A00 + number)):
            yield (communication, 1), (RANGE, RANGE)
            yield (mapping, 0), (STATE, STATE)
            yield from (((mapping, subindex), (STATE, STATE)) for subindex in range(1, 9))
        for subindex in (3, 6):
            yield (0x1800 + number, subindex), (DONE, DONE) if off else (STATE, STATE)
    yield (0x1A01, 0), (DONE, AbortCode.CANNOT_BE_MAPPED)


RULES: dict[tuple[int, int], Outcome] = {
    **{(index, i): (AbortCode.NOT_STORED,) * 2 for index in (0x1010, 0x1011) for i in range(1, 5)},  # no signature
    (0x1012, 0): (RANGE, RANGE),  # neither value is TIME's COB-ID
    (0x1014, 0): (RANGE, RANGE),  # neither value is a COB-ID
    (0x2010, 3): (STATE, STATE),  # no axis interpolates: there is no motion to make slower or faster
    (0x6060, 0): (RANGE, RANGE),  # neither value is a mode
    (0x6091, 1): (DONE, AbortCode.INCOMPATIBLE),  # in so large units 0x6099:02 would be 0
    (0x6091, 2): (DONE, RANGE),  # a unit that is smaller than the board's own
    (0x6092, 1): (AbortCode.INCOMPATIBLE, RANGE),
    (0x6092, 2): (DONE, AbortCode.INCOMPATIBLE),
    (0x60A8, 0): (DONE, RANGE),  # all ones name no unit
    (0x60B8, 0): (DONE, RANGE),  # all ones name a zero pulse as source
    (0x60C1, 4): (RANGE, DONE),  # 0 is the number expected, but the record's duration is 0; 255 is an old record
    (0x2015, 0): (AbortCode.VALUE_TOO_LOW, DONE),  # only 1 stops, as only the fault reset ends it
    (0x2017, 1): (AbortCode.VALUE_TOO_LOW, DONE),  # 0 reads as "free" and claims nothing
    (0x2017, 2): (DONE, STATE),  # no program is in charge: 0
    (0x2018, 3): (DONE, STATE),  # no fault yet: 0
    (0x2020, 3): (DONE, RANGE),  # 255 is no node of the board
    (0x605A, 0): (DONE, DONE),
    (0x607B, 1): (DONE, AbortCode.MAX_BELOW_MIN),  # a turn ends above its beginning
    (0x607B, 2): (AbortCode.MAX_BELOW_MIN, DONE),
    (0x60F2, 0): (DONE, RANGE),  # all ones set bits that are not offered
    **dict(pdo_rules()),
}
"""Entries with rules beyond their range."""


def named(value: object) -> str | None:
    return f"{value:04X}" if isinstance(value, int) else None


walk = pytest.mark.parametrize(("index", "subindex", "entry"), TABLE, ids=named)
each_object = pytest.mark.parametrize("item", OBJECTS, ids=lambda item: f"{item.index:04X}")


def request(board: BenchBoard, data: bytes) -> bytes:
    board.send(0x610, data)
    return board.last(0x590)


def head(index: int, subindex: int) -> bytes:
    return index.to_bytes(2, "little") + bytes((subindex,))


def abort_of(answer: bytes) -> int:
    """Return the abort code of an answer; 0 if it is not an abort."""
    return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0


def download(board: BenchBoard, index: int, subindex: int, data: bytes) -> int:
    """Write up to 14 bytes in two segments; return the abort code, 0 for success."""
    answer = request(board, b"\x20" + head(index, subindex) + bytes(4))
    code = abort_of(answer)
    if code:
        return code
    first, second = data[: len(data) // 2], data[len(data) // 2 :]
    for toggle, part, last in ((0, first, 0), (0x10, second, 1)):
        answer = request(board, bytes((toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0"))
        code = abort_of(answer)
        if code:
            return code
    return DONE


def upload(board: BenchBoard, index: int, subindex: int) -> bytes | int:
    """Read an entry; return its bytes or the abort code."""
    answer = request(board, b"\x40" + head(index, subindex) + bytes(4))
    if answer[0] == 0x80:
        return abort_of(answer)
    if answer[0] & 2:
        return answer[4 : 8 - (answer[0] >> 2 & 3)]
    data, toggle = b"", 0
    while True:
        answer = request(board, bytes((0x60 | toggle,)) + bytes(7))
        data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        if answer[0] & 1:
            return data
        toggle ^= 0x10


@each_object
def test_read(board: BenchBoard, item: DictionaryObject) -> None:
    for subindex, entry in item.entries.items():
        answer = upload(board, item.index, subindex)
        if entry.access is Access.WRITE_ONLY:
            assert answer == AbortCode.WRITE_ONLY, subindex
        elif od.address_of(item.index, subindex) in od.ERROR_HISTORY:
            assert answer == AbortCode.NO_DATA, subindex
        elif entry.data_type is DataType.VISIBLE_STRING:
            assert answer == str(entry.default).encode(), subindex
        else:
            assert answer == encode(entry.data_type, board.value(od.address_of(item.index, subindex))), subindex


def limits(entry: Entry) -> tuple[int, int]:
    kind = entry.data_type
    return kind.low if entry.low is None else entry.low, kind.high if entry.high is None else entry.high


@walk
def test_write(board: BenchBoard, index: int, subindex: int, entry: Entry) -> None:
    kind = entry.data_type
    if entry.access not in WRITABLE:
        assert download(board, index, subindex, bytes(max(1, kind.size))) == AbortCode.READ_ONLY
        assert download(board, index, subindex, bytes(14)) == AbortCode.READ_ONLY
        return
    values = limits(entry)
    for value, outcome in zip(values, RULES.get((index, subindex), (DONE, DONE)), strict=True):
        assert download(board, index, subindex, encode(kind, value)) == outcome
    low, high = values
    if low > kind.low:
        assert download(board, index, subindex, encode(kind, low - 1)) == AbortCode.VALUE_TOO_LOW
    if high < kind.high:
        assert download(board, index, subindex, encode(kind, high + 1)) == AbortCode.VALUE_TOO_HIGH


@each_object
def test_length(board: BenchBoard, item: DictionaryObject) -> None:
    """It is refused, and changes nothing."""
    for subindex, entry in item.entries.items():
        refuses_other_lengths(board, item.index, subindex, entry)


def refuses_other_lengths(board: BenchBoard, index: int, subindex: int, entry: Entry) -> None:
    size = entry.data_type.size
    if entry.data_type is DataType.VISIBLE_STRING:
        announced = request(board, b"\x21" + head(index, subindex) + (TEXT_BYTES_MAX + 1).to_bytes(4, "little"))
        assert abort_of(announced) == (AbortCode.LENGTH_TOO_HIGH if entry.access in WRITABLE else AbortCode.READ_ONLY)
    elif entry.access in WRITABLE:
        before = board.value(od.address_of(index, subindex))
        assert download(board, index, subindex, bytes(size - 1)) == AbortCode.LENGTH_TOO_LOW
        assert download(board, index, subindex, bytes(size + 1)) == AbortCode.LENGTH_TOO_HIGH
        assert download(board, index, subindex, bytes(14)) == AbortCode.LENGTH_TOO_HIGH
        announced = request(board, b"\x21" + head(index, subindex) + (size + 1).to_bytes(4, "little"))
        assert abort_of(announced) == AbortCode.LENGTH_TOO_HIGH
        assert board.value(od.address_of(index, subindex)) == before


@each_object
def test_sub_indices_beside_those_that_exist_do_not(board: BenchBoard, item: DictionaryObject) -> None:
    beside = {0, 255} | {subindex + step for subindex in item.entries for step in (-1, 1)}
    have_no_subindices(board, item, beside & set(range(256)))


@pytest.mark.slow
def test_no_other_sub_indices_exist(board: BenchBoard) -> None:
    for item in OBJECTS:
        have_no_subindices(board, item, set(range(256)))


def have_no_subindices(board: BenchBoard, item: DictionaryObject, among: set[int]) -> None:
    for subindex in among - set(item.entries):
        assert upload(board, item.index, subindex) == AbortCode.NO_SUBINDEX
        assert download(board, item.index, subindex, bytes(4)) == AbortCode.NO_SUBINDEX


KNOWN = {item.index for item in OBJECTS}
BESIDE = {index + step for index in KNOWN for step in (-1, 1)} - KNOWN | {0, 0xFFFF}


@pytest.mark.parametrize(
    "indices",
    [
        pytest.param(BESIDE, id="beside"),
        pytest.param(set(range(0x10000)) - KNOWN - BESIDE, id="others", marks=pytest.mark.slow),
    ],
)
def test_all_other_indices_do_not_exist(indices: set[int]) -> None:
    sdo = SdoServer(ObjectDictionary(0x10))
    for index in indices:
        for command in (0x40, 0x2F, 0x21, 0xA0, 0xC0):
            [answer] = sdo.handle(bytes((command,)) + head(index, 0) + b"\1\0\0\0")
            assert abort_of(answer) == AbortCode.NO_OBJECT


def test_every_handler_is_a_part_of_the_firmware(board: BenchBoard) -> None:
    """All but the emulator's: each entry that the tables name is bound, and no other."""
    dictionary = board.firmware.nodes[0].dictionary
    numbers = [address for address, entry in ENTRIES.items() if entry.data_type is not DataType.VISIBLE_STRING]
    emulated = {address for address, entry in ENTRIES.items() if entry.read.startswith("EmulatedAxis.")}
    assert {a for a in numbers if dictionary.cell(a).supply} == {
        a for a, entry in ENTRIES.items() if entry.read
    } - emulated
    assert {a for a in numbers if dictionary.cell(a).obey} == {a for a, entry in ENTRIES.items() if entry.write}


@pytest.mark.parametrize(
    ("address", "values"),
    [
        (od.TORQUE_PERCENT, TORQUE_LEVELS),
        (od.REST_TORQUE_PERCENT, TORQUE_LEVELS),
        (od.FAST_DECAY_PERCENT, DECAY_LEVELS),
        (od.QUICK_STOP_OPTION, QUICK_STOPS),
        (od.SHUTDOWN_OPTION, SHUTDOWNS),
        (od.DISABLE_OPERATION_OPTION, DISABLES),
        (od.HALT_OPTION, HALTS),
        (od.FAULT_REACTION_OPTION, FAULT_REACTIONS),
    ],
)
def test_the_table_allows_what_the_firmware_can_do(address: int, values: dict[int, object]) -> None:
    entry = ENTRIES[address]
    low, high = limits(entry)
    assert {value for value in range(low, high + 1) if value in (entry.values or range(low, high + 1))} == set(values)
