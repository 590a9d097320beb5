"""Checks of an EDS by itself (CiA 306)."""

from collections.abc import Iterator, Mapping

from steptwin.features.conform.check import DiffersError, Need, expect, group
from steptwin.features.conform.node import NodeUnderTest
from steptwin.features.nodes.node_objects import PDO_BITS_MAX, RPDO_MAPS, RPDOS, TPDO_MAPS, TPDOS, NodeEntry
from steptwin.host.common.numbers import digits_in
from steptwin.protocol import od
from steptwin.protocol.objects import DUMMY_BITS

check = group("EDS", Need.EDS)

_LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
_MANDATORY = (od.address_of(0x1000), od.address_of(0x1001), od.address_of(0x1018, 1))


@check("E1", "306 4.6.3", "the lists of objects agree with their counts and with the sections")
def lists(node: NodeUnderTest) -> None:
    sections = node.described.sections
    listed = set[int]()
    for name in _LISTS:
        section = sections.get(name.lower())
        expect(section is not None or name != _LISTS[0], f"no section [{name}]")
        if section is None:
            continue
        keys = [key for key in section.values if key != "supportedobjects"]
        indexes = [section.number(key) for key in keys]
        count = section.number("SupportedObjects") or 0
        expect(count == len(indexes), f"[{section.name}] says {count} objects and lists {len(indexes)}")
        listed |= {index for index in indexes if index is not None}
    described = {address >> 8 for address in node.described.entries}
    expect(not listed - described, f"listed without a section: {_indexes(listed - described)}")
    expect(not described - listed, f"in no list: {_indexes(described - listed)}")


@check("E2", "306 4.6.3", "defaults are in their limits; a count is the number of the entries")
def defaults(node: NodeUnderTest) -> None:
    for address, entry in node.described.entries.items():
        if not isinstance(entry.default, int):
            continue
        for limit, text, beyond in ((entry.low, "LowLimit", -1), (entry.high, "HighLimit", 1)):
            wrong = limit is not None and beyond * (entry.default - limit) > 0
            expect(not wrong, f"{od.place_text(address)}: default {entry.default} is beyond {text} {limit}")
    for index, section in node.described.sections.items():
        subs = digits_in(section.text("SubNumber")) if len(index) == 4 else None
        if subs is not None:
            found = sum(1 for name in node.described.sections if name.startswith(f"{index}sub"))
            expect(found == subs, f"[{section.name}] SubNumber={subs}, and there are {found} sections of sub-indexes")


@check("E3", "301 7.5.1", "1000h, 1001h and 1018h are there; PDO parameters have their mappings")
def mandatory(node: NodeUnderTest) -> None:
    entries = node.described.entries
    for address in _MANDATORY:
        expect(address in entries, f"{od.place_text(address)} is missing")
    indexes = {address >> 8 for address in entries}
    for parameters, mappings in ((RPDOS, RPDO_MAPS), (TPDOS, TPDO_MAPS)):
        for index in indexes & set(parameters):
            mapping = index + mappings.start - parameters.start
            expect(mapping in indexes, f"0x{index:04X} has no mapping 0x{mapping:04X}")


@check("E4", "301 7.5.2.36", "default mappings name mappable objects of their length, 64 bits at most")
def mappings(node: NodeUnderTest) -> None:
    entries = node.described.entries
    for index, words in _default_mappings(entries):
        bits = 0
        for word in words:
            bits += word & 0xFF
            mapped = entries.get(word >> 8)
            if mapped is None and word >> 16 in DUMMY_BITS and word >> 8 & 0xFF == 0:
                continue
            what = f"0x{index:04X} maps {od.place_text(word >> 8)} with {word & 0xFF} bits"
            expect(mapped is not None, f"{what}, which the EDS does not have")
            assert mapped is not None
            expect(mapped.mappable, f"{what}, which has PDOMapping=0")
            expect(mapped.bits in (word & 0xFF, 0), f"{what}, and it has {mapped.bits}")
        expect(bits <= PDO_BITS_MAX, f"0x{index:04X} maps {bits} bits, more than {PDO_BITS_MAX}")


@check("E5", "306 4.5.3", "the numbers of PDOs in [DeviceInfo] are those of the objects")
def numbers_of_pdos(node: NodeUnderTest) -> None:
    info = node.described.sections["deviceinfo"]
    indexes = {address >> 8 for address in node.described.entries}
    for key, parameters in (("NrOfRXPDO", RPDOS), ("NrOfTXPDO", TPDOS)):
        said, found = info.number(key), len(indexes & set(parameters))
        if said is not None and said != found:
            raise DiffersError(f"{key}={said}, and there are {found} parameters of such PDOs")


def _default_mappings(entries: Mapping[int, NodeEntry]) -> Iterator[tuple[int, list[int]]]:
    for index in sorted({address >> 8 for address in entries} & {*RPDO_MAPS, *TPDO_MAPS}):
        count = entries.get(od.address_of(index))
        if count is None or not isinstance(count.default, int):
            continue
        words = [entries.get(od.address_of(index, sub)) for sub in range(1, count.default + 1)]
        yield index, [each.default for each in words if each is not None and isinstance(each.default, int)]


def _indexes(indexes: set[int]) -> str:
    shown = [f"{index:04X}h" for index in sorted(indexes)]
    return ", ".join(shown[:5]) + (f" and {len(shown) - 5} more" if len(shown) > 5 else "")
