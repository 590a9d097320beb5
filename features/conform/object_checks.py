"""Checks of the EDS against the device: identity, access, lengths, limits, defaults."""

from collections.abc import Iterator
from typing import Final

from steptwin.features.conform.check import DiffersError, Need, SkippedError, expect, group
from steptwin.features.conform.node import AbortError, NodeUnderTest, said
from steptwin.features.nodes.node_objects import NodeEntry, ValueForm
from steptwin.protocol import od
from steptwin.protocol.entry import Access
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.sdo_frames import AbortCode

check = group("object dictionary", Need.EDS)

_COMMANDS: Final = {
    *(0x1010, 0x1011, 0x1F50, 0x1F51, 0x1F56, 0x1F57, 0x1F80),  # store, restore, program download, NMT start-up
    *(0x6040, 0x6042, 0x6060, 0x607A, 0x60C1, 0x60FE, 0x60FF, 0x6071),  # what moves a drive, and its outputs
    *(0x1005, 0x1006, 0x1012, 0x1014, 0x1016, 0x1017),  # checked with their services
    0x1013,  # a clock
}
"""Objects whose writing does more than to store a value."""
_PDO_OBJECTS: Final = range(0x1400, 0x1C00)
_PROFILES: Final = (range(0x1000, 0x2000), range(0x6000, 0xA000))
"""Areas of CiA's profiles: what a manufacturer's own objects do when they are written is unknown."""
_SAMPLE: Final = 200
_ABSENT_STEP: Final = 37
"""Every so many indexes one that the EDS does not have is asked for."""
_LIMITS: Final = (AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH, AbortCode.VALUE_TOO_LOW)


def _entries(node: NodeUnderTest, *access: Access) -> Iterator[tuple[int, NodeEntry]]:
    for address, entry in node.described.entries.items():
        if entry.access in access:
            yield address, entry


def _may_be_written(address: int) -> bool:
    index = address >> 8
    return any(index in area for area in _PROFILES) and index not in _COMMANDS and index not in _PDO_OBJECTS


@check("D1", "301 7.5.2.19", "1018h is the identity of [DeviceInfo]")
def identity(node: NodeUnderTest) -> None:
    info = node.described.sections["deviceinfo"]
    compared = 0
    for sub, key in ((1, "VendorNumber"), (2, "ProductNumber"), (3, "RevisionNumber")):
        said = info.number(key)
        if said is not None:
            found = node.number(od.address_of(0x1018, sub))
            expect(found == said, f"0x1018:{sub:02X} is {found:08X}h, {key} is {said:08X}h")
            compared += 1
    if not compared:
        raise SkippedError("[DeviceInfo] names neither vendor nor product")


@check("D2", "301 7.5.2.1", "1000h is the EDS's default")
def device_type(node: NodeUnderTest) -> None:
    said, found = node.described.entries[od.address_of(0x1000)].default, node.number(od.address_of(0x1000))
    expect(found == said, f"0x1000 is {found:08X}h, the EDS says {said!r}")


@check("D3", "301 7.4.5", "each readable entry can be read, with the length of its type")
def readable(node: NodeUnderTest) -> None:
    for address, entry in _entries(node, Access.READ_ONLY, Access.READ_WRITE, Access.CONST):
        try:
            data = node.upload(address)
        except AbortError as error:
            expect(error.code == AbortCode.NO_DATA, f"{od.place_text(address)} {entry.name}: {error}")
            continue
        length = entry.size in (0, len(data))
        expect(length, f"{od.place_text(address)} {entry.name}: {len(data)} bytes, its type has {entry.size}")


@check("D4", "301 7.2.4.3.17", "reading a write-only entry aborts with 06010001h")
def write_only(node: NodeUnderTest) -> None:
    asked = 0
    for address, entry in _entries(node, Access.WRITE_ONLY):
        code = node.read_code(address)
        expect(code == AbortCode.WRITE_ONLY, f"{od.place_text(address)} {entry.name}: {said(code, 'can be read')}")
        asked += 1
    if not asked:
        raise SkippedError("no entry is write-only")


@check("D5", "301 7.2.4.3.17", "writing a read-only entry aborts with 06010002h")
def read_only(node: NodeUnderTest) -> None:
    for address, entry in _entries(node, Access.READ_ONLY, Access.CONST):
        if entry.size and address >> 8 not in _PDO_OBJECTS:
            data = bytes(entry.size)
            code = node.write_code(address, data)
            expect(code == AbortCode.READ_ONLY, f"{od.place_text(address)} {entry.name}: {said(code)}")


@check("D6", "301 7.4.5", "each entry of a profile takes the value that it has")
def writable(node: NodeUnderTest) -> None:
    refused = []
    for address, entry in _entries(node, Access.READ_WRITE):
        if not entry.size or not _may_be_written(address):
            continue
        data = node.upload(address)
        code = node.write_code(address, data)
        if code == AbortCode.DEVICE_STATE:
            refused.append(od.place_text(address))
        else:
            expect(not code, f"{od.place_text(address)} {entry.name}: {said(code)}")
    if refused:
        raise DiffersError(f"not in this state: {', '.join(refused[:5])}{' ...' if len(refused) > 5 else ''}")


@check("D7", "301 7.2.4.3.17", "a value beyond the limits of the EDS aborts with 06090030h to 32h")
def limits(node: NodeUnderTest) -> None:
    asked, taken = 0, []
    for address, entry in _entries(node, Access.READ_WRITE):
        if entry.form is not ValueForm.WHOLE or not _may_be_written(address):
            continue
        least, most = entry.range
        beyond = [entry.low - 1] if entry.low is not None and entry.low > least else []
        beyond += [entry.high + 1] if entry.high is not None and entry.high < most else []
        for value in beyond:
            with node.kept(address):
                code = node.write_code(address, entry.to_bytes(value))
            asked += 1
            if not code:
                taken.append(f"{od.place_text(address)} takes {value}")
            else:
                right = code in (*_LIMITS, AbortCode.DEVICE_STATE)
                expect(right, f"{od.place_text(address)} {entry.name} = {value}: {said(code)}")
    if taken:
        raise DiffersError(
            f"{', '.join(taken[:3])}{' ...' if len(taken) > 3 else ''}: the EDS's limits are not checked"
        )
    if not asked:
        raise SkippedError("no entry has limits")


@check("D8", "301 7.5.2.14", "after a reset each entry has the EDS's default")
def defaults(node: NodeUnderTest) -> None:
    node.switched_off()
    node.reset(NmtCommand.RESET_NODE)
    different = []
    for address, entry in _entries(node, Access.READ_WRITE):
        if not entry.size or not _may_be_written(address):
            continue
        value = entry.to_value(node.upload(address))
        if value != entry.default:
            different.append(f"{od.place_text(address)} is {value!r}, not {entry.default!r}")
    if different:
        raise DiffersError(
            f"{'; '.join(different[:3])}{' ...' if len(different) > 3 else ''}: stored, or of this device"
        )


@check("D9", "301 7.2.4.3.17", "sub-index 0 is the highest; the next one aborts with 06090011h")
def sub_indexes(node: NodeUnderTest) -> None:
    entries = node.described.entries
    highest = {address >> 8: address & 0xFF for address in entries if address & 0xFF}
    for index, last in highest.items():
        if index in _PDO_OBJECTS and (index >> 9) & 1:  # of a mapping sub-index 0 is the number in use
            continue
        found = node.number(od.address_of(index))
        if index in (0x1003, 0x1016) or index in _PDO_OBJECTS:
            expect(found <= max(last, 8), f"0x{index:04X}:00 is {found}, the EDS's last is {last}")
            continue
        expect(found == last, f"0x{index:04X}:00 is {found}, the EDS's last is {last}")
        if last < 0xFE:
            code = node.read_code(od.address_of(index, last + 1))
            expect(
                code in (AbortCode.NO_SUBINDEX, AbortCode.NO_OBJECT),
                f"0x{index:04X}:{last + 1:02X}: {said(code, 'can be read')}",
            )


@check("D10", "301 7.2.4.3.17", "indexes that the EDS does not have abort with 06020000h")
def absent(node: NodeUnderTest) -> None:
    described = {address >> 8 for address in node.described.entries}
    candidates = [index for area in (range(0x1000, 0x2000), range(0x6000, 0x6800)) for index in area]
    absent = [index for index in candidates[::_ABSENT_STEP] if index not in described][:_SAMPLE]
    for index in absent:
        code = node.read_code(od.address_of(index))
        expect(code, f"0x{index:04X} can be read, and the EDS does not have it")
        expect(code == AbortCode.NO_OBJECT, f"0x{index:04X}: {said(code)}")


def _code(code: int) -> str:
    return said(code) if code else "is accepted"
