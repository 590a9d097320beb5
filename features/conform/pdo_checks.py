"""Checks of PDO parameters, mappings and transmission (CiA 301, sections 7.2.2 and 7.5.2.35 to 38)."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from steptwin.features.conform.check import DiffersError, SkippedError, expect, group
from steptwin.features.conform.node import NodeUnderTest, said, u32
from steptwin.features.nodes.node_objects import RPDOS, TPDOS
from steptwin.protocol import od
from steptwin.protocol.frame import COB_ID_INVALID
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.sdo_frames import AbortCode

check = group("PDO")

_FREE_ID: Final = 0x191
"""An identifier for a PDO: the first TPDO of a node 11h."""
_RESERVED: Final = (0x000, 0x001, 0x101, 0x581, 0x601, 0x701)
_REFUSALS: Final = (AbortCode.VALUE_RANGE, AbortCode.DEVICE_STATE, AbortCode.INCOMPATIBLE)
_MAPPING_REFUSALS: Final = (
    AbortCode.NO_OBJECT,
    AbortCode.NO_SUBINDEX,
    AbortCode.CANNOT_BE_MAPPED,
    AbortCode.PDO_TOO_LONG,
    AbortCode.INCOMPATIBLE,
)
_ERROR_REGISTER: Final = od.address_of(0x1001)
"""Error register: eight bits, which each node can map."""
_DUMMY: Final = 0x0005_0008
_WRONG_MAPPINGS: Final = {"an absent object": 0x6FFF_0008, "0x1018:01": 0x1018_0120, "0x1001 with 16 bits": 0x1001_0010}


def _first(node: NodeUnderTest, indexes: range) -> int:
    """Return the first PDO with parameters; raise SkippedError without one."""
    for index in range(indexes.start, indexes.start + 8):
        if node.has(od.address_of(index, 1)):
            return index
    raise SkippedError("no such PDO")


@contextmanager
def _switched_off(node: NodeUnderTest, index: int) -> Iterator[int]:
    """Switch a PDO off for the block, to which its identifier is given; restore its parameters and its mapping."""
    mapping = index + 0x200
    cob = od.address_of(index, 1)
    word = node.number(cob)
    type_before = node.upload(od.address_of(index, 2))
    mapped = _mapped(node, mapping)
    node.download(cob, u32(word | COB_ID_INVALID))
    try:
        yield word & ~COB_ID_INVALID
    finally:
        if node.number(cob) != word | COB_ID_INVALID:
            node.download(cob, u32(node.number(cob) | COB_ID_INVALID))
        node.download(od.address_of(index, 2), type_before)
        _map(node, mapping, mapped)
        node.download(cob, u32(word | COB_ID_INVALID))
        if not word & COB_ID_INVALID:
            node.download(cob, u32(word))


def _mapped(node: NodeUnderTest, mapping: int) -> list[int]:
    """Return the entries of a mapping that are in use."""
    return [node.number(od.address_of(mapping, sub)) for sub in range(1, node.number(od.address_of(mapping)) + 1)]


def _map(node: NodeUnderTest, mapping: int, words: list[int]) -> int:
    """Write a mapping; return the code of the abort that ends it, 0 if it is taken or static."""
    code = node.write_code(od.address_of(mapping), b"\0")
    if code:
        return 0 if code == AbortCode.READ_ONLY else code
    for sub, word in enumerate(words, 1):
        if code := node.write_code(od.address_of(mapping, sub), u32(word)):
            return code
    return node.write_code(od.address_of(mapping), bytes((len(words),)))


def _is_static(node: NodeUnderTest, mapping: int) -> bool:
    count = node.upload(od.address_of(mapping))
    return node.write_code(od.address_of(mapping), count) == AbortCode.READ_ONLY


@check("P1", "7.5.2.35", "a PDO is switched off, gets another identifier and is switched on")
def identifiers(node: NodeUnderTest) -> None:
    for indexes in (RPDOS, TPDOS):
        index = _first(node, indexes)
        cob = od.address_of(index, 1)
        with _switched_off(node, index) as word:
            code = node.write_code(cob, u32(word & ~0x7FF | _FREE_ID))
            if code in (AbortCode.READ_ONLY, AbortCode.VALUE_RANGE):
                raise DiffersError(f"0x{index:04X}:01 keeps its identifier: {said(code)}")
            expect(not code, f"0x{index:04X}:01 = {_FREE_ID:03X}h: {said(code)}")
            expect(node.number(cob) & 0x7FF == _FREE_ID, f"0x{index:04X}:01 does not read as written")


@check("P2", "7.3.5", "a restricted identifier is refused with 06090030h")
def restricted(node: NodeUnderTest) -> None:
    index = _first(node, TPDOS)
    taken = []
    with _switched_off(node, index) as word:
        for cob_id in _RESERVED:
            code = node.write_code(od.address_of(index, 1), u32(word & ~0x7FF | cob_id))
            if not code:
                taken.append(f"{cob_id:03X}h")
                node.download(od.address_of(index, 1), u32(word | COB_ID_INVALID))
            else:
                right = code in (AbortCode.VALUE_RANGE, AbortCode.READ_ONLY)
                expect(right, f"identifier {cob_id:03X}h: {said(code)}")
    if taken:
        raise DiffersError(f"takes {', '.join(taken)}")


@check("P4", "7.5.2.37", "transmission types 1, 240, 254, 255 are taken, 241 and 251 refused")
def types(node: NodeUnderTest) -> None:
    index = _first(node, TPDOS)
    at, refused = od.address_of(index, 2), []
    with _switched_off(node, index):
        for kind in (1, 240, 254, 255):
            if code := node.write_code(at, bytes((kind,))):
                expect(code == AbortCode.VALUE_RANGE, f"type {kind}: {said(code)}")
                refused.append(str(kind))
        for kind in (241, 251):
            code = node.write_code(at, bytes((kind,)))
            expect(code == AbortCode.VALUE_RANGE, f"type {kind}: {said(code)}")
    if refused:
        raise DiffersError(f"refuses the types {', '.join(refused)}")


@check("P5", "7.5.2.37", "the inhibit time cannot be written while the PDO is in use")
def inhibit_while_valid(node: NodeUnderTest) -> None:
    for index in node.valid_pdos(TPDOS.start):
        at = od.address_of(index, 3)
        if node.has(at):
            with node.kept(at) as before:
                changed = (int.from_bytes(before, "little") + 10).to_bytes(2, "little")
                code = node.write_code(at, changed)
            if not code:
                raise DiffersError(f"{od.place_text(at)} is taken")
            expect(code in _REFUSALS, f"{od.place_text(at)}: {said(code)}")
            return
    raise SkippedError("no TPDO in use has an inhibit time")


@check("P6", "7.5.2.36", "an entry cannot be mapped while the mapping is in use")
def entry_while_mapped(node: NodeUnderTest) -> None:
    index = _first(node, TPDOS)
    mapping = index + 0x200
    if not node.number(od.address_of(mapping)) or _is_static(node, mapping):
        raise SkippedError("nothing is mapped, or the mapping is static")
    at = od.address_of(mapping, 1)
    with _switched_off(node, index):
        code = node.write_code(at, u32(_ERROR_REGISTER << 8 | 8))
    if not code:
        raise DiffersError(f"{od.place_text(at)} is taken")
    right = code in (AbortCode.INCOMPATIBLE, AbortCode.DEVICE_STATE, AbortCode.VALUE_RANGE, 0x0601_0000)
    expect(right, f"{od.place_text(at)}: {said(code)}")


@check("P7", "7.5.2.36", "an object that is absent or not mappable, or a wrong length, is refused")
def wrong_mappings(node: NodeUnderTest) -> None:
    index = _first(node, TPDOS)
    mapping = index + 0x200
    if _is_static(node, mapping):
        raise SkippedError("the mapping is static")
    for what, word in (
        ("an absent object", 0x6FFF_0008),
        ("0x1018:01", 0x1018_0120),
        ("0x1001 with 16 bits", 0x1001_0010),
    ):
        with _switched_off(node, index):
            code = _map(node, mapping, [word])
        if what == "0x1018:01" and not code:
            raise DiffersError("0x1018:01 can be mapped")
        expect(code in _MAPPING_REFUSALS, f"{what}: {said(code)}")


@check("P8", "7.5.2.36", "more than 64 bits are refused with 06040042h")
def too_long(node: NodeUnderTest) -> None:
    index = _first(node, TPDOS)
    mapping = index + 0x200
    if _is_static(node, mapping):
        raise SkippedError("the mapping is static")
    words = _mapped(node, mapping)
    longest = max(words, key=lambda word: word & 0xFF, default=0)
    if not longest:
        raise SkippedError("nothing is mapped")
    fit = 64 // (longest & 0xFF) + 1
    with _switched_off(node, index):
        code = _map(node, mapping, [longest] * fit)
    if code == AbortCode.NO_SUBINDEX:
        raise SkippedError(f"the mapping has fewer than {fit} entries")
    right = code in (AbortCode.PDO_TOO_LONG, AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH)
    expect(right, f"{fit} entries of {longest & 0xFF} bits: {said(code)}")
    if code != AbortCode.PDO_TOO_LONG:
        raise DiffersError(f"refused with {said(code)}")


@check("P10", "7.4.8.2", "a gap of an RPDO is a dummy entry")
def dummy(node: NodeUnderTest) -> None:
    index = _first(node, RPDOS)
    mapping = index + 0x200
    if _is_static(node, mapping):
        raise SkippedError("the mapping is static")
    with _switched_off(node, index):
        code = _map(node, mapping, [_DUMMY])
    if code:
        raise DiffersError(f"refused: {said(code)}")


@contextmanager
def _transmitting(node: NodeUnderTest, kind: int, timer_ms: int = 0) -> Iterator[tuple[int, list[int]]]:
    """Let the first TPDO of a type carry what it carries; give its identifier and mapping to the block."""
    valid = node.valid_pdos(TPDOS.start)
    if not valid:
        raise SkippedError("no TPDO is in use")
    index, cob_id = next(iter(valid.items()))
    mapping = index + 0x200
    words = _mapped(node, mapping)
    timer = od.address_of(index, 5)
    if timer_ms and not node.has(timer):
        raise SkippedError("no event timer")
    with _switched_off(node, index):
        timer_before = node.upload(timer) if timer_ms else b""
        node.download(od.address_of(index, 2), bytes((kind,)))
        if timer_ms:
            node.download(timer, timer_ms.to_bytes(2, "little"))
        node.download(od.address_of(index, 1), u32(cob_id))
        node.enter(NmtState.OPERATIONAL)
        try:
            yield cob_id, words
        finally:
            node.enter(NmtState.PRE_OPERATIONAL)
            node.download(od.address_of(index, 1), u32(cob_id | COB_ID_INVALID))
            if timer_ms:
                node.download(timer, timer_before)


@check("P11", "7.2.2.2", "a TPDO of type 1 comes at each SYNC, with the values of its entries")
def synchronous(node: NodeUnderTest) -> None:
    with _transmitting(node, 1) as (cob_id, words):
        node.wait(0.1)
        mark = node.mark()
        node.sync()
        node.wait(0.05)
        frames = node.since(mark, cob_id)
        expect(len(frames) == 1, f"{len(frames)} frames {cob_id:03X}h at a SYNC")
        bits = sum(word & 0xFF for word in words)
        data = frames[0].frame.data
        expect(len(data) == -(-bits // 8), f"{len(data)} bytes, and {bits} bits are mapped")
        carried = int.from_bytes(data, "little")
        for word in words:
            mask = (1 << (word & 0xFF)) - 1
            value = node.number(word >> 8) & mask
            place = od.place_text(word >> 8)
            expect(carried & mask == value, f"carries {carried & mask:X}h of {place}, and SDO reads {value:X}h")
            carried >>= word & 0xFF


@check("P12", "7.2.2.2", "a TPDO of type 3 comes at each third SYNC")
def each_third(node: NodeUnderTest) -> None:
    with _transmitting(node, 3) as (cob_id, _):
        node.wait(0.1)
        mark = node.mark()
        for _ in range(9):
            node.sync()
            node.wait(0.02)
        frames = len(node.since(mark, cob_id))
        expect(frames == 3, f"{frames} frames {cob_id:03X}h at nine SYNCs")


@check("P14", "7.5.2.37", "a TPDO with an event timer of 100 ms comes ten times a second")
def event_timer(node: NodeUnderTest) -> None:
    with _transmitting(node, 255, 100) as (cob_id, _):
        node.wait(0.2)
        mark = node.mark()
        node.wait(1.0)
        frames = len(node.since(mark, cob_id))
        expect(9 <= frames <= 11, f"{frames} frames {cob_id:03X}h in a second")


@check("P16", "7.3.2.3", "PDOs only in OPERATIONAL")
def only_operational(node: NodeUnderTest) -> None:
    with _transmitting(node, 1) as (cob_id, _):
        for state in (NmtState.PRE_OPERATIONAL, NmtState.STOPPED):
            node.enter(state)
            node.wait(0.1)
            mark = node.mark()
            node.sync()
            node.wait(0.1)
            expect(not node.since(mark, cob_id), f"a frame {cob_id:03X}h in {state.name}")


@check("P17", "7.2.2.4", "an RPDO that is too short is not taken, and sends EMCY 8210h")
def short_rpdo(node: NodeUnderTest) -> None:
    for index, cob_id in node.valid_pdos(RPDOS.start).items():
        mapping = index + 0x200
        words = _mapped(node, mapping)
        length = -(-sum(word & 0xFF for word in words) // 8)
        if length < 2:
            continue
        before = {word >> 8: node.upload(word >> 8) for word in words if node.has(word >> 8)}
        node.enter(NmtState.OPERATIONAL)
        try:
            mark = node.mark()
            node.send(cob_id, bytes(length - 1))
            node.sync()
            node.wait(0.1)
        finally:
            node.enter(NmtState.PRE_OPERATIONAL)
        for address, value in before.items():
            expect(node.upload(address) == value, f"{od.place_text(address)} has changed")
        codes = [int.from_bytes(data[:2], "little") for data in node.emergencies(mark)]
        if 0x8210 not in codes:
            raise DiffersError("no EMCY 8210h")
        return
    raise SkippedError("no RPDO of two bytes or more is in use")
