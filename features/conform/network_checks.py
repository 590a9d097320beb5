"""Checks of SYNC, TIME, EMCY, error control, NMT and storage (CiA 301)."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from steptwin.features.conform.check import DiffersError, SkippedError, expect, group
from steptwin.features.conform.node import GUARD_S, HEARTBEAT_MS, HEARTBEAT_TIME, NodeUnderTest, said, u32
from steptwin.protocol import od
from steptwin.protocol.frame import COB_HEARTBEAT, COB_ID_INVALID, COB_NMT
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.sdo_frames import AbortCode

sync_check = group("SYNC")
time_check = group("TIME")
emergency_check = group("EMCY")
error_control = group("error control")
nmt_check = group("NMT")
store_check = group("store and restore")

_SYNC_ID: Final = od.address_of(0x1005)
_OVERFLOW: Final = od.address_of(0x1019)
_ERRORS: Final = od.address_of(0x1003)
_EMCY_ID: Final = od.address_of(0x1014)
_CONSUMER: Final = od.address_of(0x1016, 1)
_SECOND_CONSUMER: Final = od.address_of(0x1016, 2)
_STORE, _RESTORE = od.address_of(0x1010, 1), od.address_of(0x1011, 1)
_GUARD_TIME, _LIFE_FACTOR = od.address_of(0x100C), od.address_of(0x100D)
_LIFE_S: Final = 0.15
"""Node life time of the check H6."""
_OTHER_SYNC_ID: Final = 0x085
_TIME_ID: Final = 0x100
_JITTER: Final = 0.25
"""Part of a heartbeat's period by which the mean of ten may differ: a host's clock is coarse."""
_WRONG_SIGNATURE: Final = b"oops"
_STATES: Final = (
    (NmtCommand.START, NmtState.OPERATIONAL),
    (NmtCommand.STOP, NmtState.STOPPED),
    (NmtCommand.START, NmtState.OPERATIONAL),
    (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
    (NmtCommand.STOP, NmtState.STOPPED),
    (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
)


@sync_check("Y1", "7.5.2.5", "1005h is 80h, and takes another identifier")
def sync_identifier(node: NodeUnderTest) -> None:
    word = int.from_bytes(node.needed(_SYNC_ID), "little")
    expect(word & 0x7FF == 0x080, f"0x1005 is {word & 0x7FF:03X}h")
    with node.kept(_SYNC_ID):
        code = node.write_code(_SYNC_ID, u32(_OTHER_SYNC_ID))
        if code == AbortCode.READ_ONLY:
            raise SkippedError("0x1005 is read-only")
        if code:
            raise DiffersError(f"0x1005 keeps its identifier: {said(code)}")
        expect(node.number(_SYNC_ID) & 0x7FF == _OTHER_SYNC_ID, "0x1005 does not read as written")


@sync_check("Y2", "7.5.2.22", "1019h refuses 1 and 241")
def sync_overflow(node: NodeUnderTest) -> None:
    node.needed(_OVERFLOW)
    for value in (1, 241):
        with node.kept(_OVERFLOW):
            code = node.write_code(_OVERFLOW, bytes((value,)))
        right = code in (AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH, AbortCode.VALUE_TOO_LOW, AbortCode.READ_ONLY)
        expect(right, f"{value}: {said(code)}")


@time_check("T1", "7.2.6", "a TIME message is no error")
def time_message(node: NodeUnderTest) -> None:
    mark = node.mark()
    node.send(_TIME_ID, (123_456).to_bytes(4, "little") + (15_673).to_bytes(2, "little"))
    node.wait(0.1)
    expect(not node.emergencies(mark), "an EMCY follows")
    boots = [each for each in node.since(mark, COB_HEARTBEAT + node.node_id) if each.frame.data == b"\0"]
    expect(not boots, "the node boots")


@emergency_check("M1", "7.5.2.4", "1003h:00 takes 0 and refuses 1")
def clear_errors(node: NodeUnderTest) -> None:
    node.needed(_ERRORS)
    code = node.write_code(_ERRORS, b"\1")
    right = code in (AbortCode.VALUE_RANGE, AbortCode.VALUE_TOO_HIGH)
    expect(right, f"1: {said(code)}")
    code = node.write_code(_ERRORS, b"\0")
    expect(not code, f"0: {said(code)}")
    expect(node.number(_ERRORS) == 0, "0x1003:00 is not 0 afterwards")


@emergency_check("M2", "7.5.2.4", "an error that is not there aborts with 08000024h")
def no_error(node: NodeUnderTest) -> None:
    node.needed(_ERRORS)
    node.download(_ERRORS, b"\0")
    code = node.read_code(od.address_of(0x1003, 1))
    if not code:
        raise DiffersError("0x1003:01 can be read")
    expect(code in (AbortCode.NO_DATA, AbortCode.NO_SUBINDEX), said(code))


@emergency_check("M3", "7.5.2.17", "1014h takes another identifier once it is invalid")
def emergency_identifier(node: NodeUnderTest) -> None:
    word = int.from_bytes(node.needed(_EMCY_ID), "little")
    with node.kept(_EMCY_ID):
        code = node.write_code(_EMCY_ID, u32(word | COB_ID_INVALID))
        if code == AbortCode.READ_ONLY:
            raise SkippedError("0x1014 is read-only")
        if not code:
            code = node.write_code(_EMCY_ID, u32(COB_ID_INVALID | 0x0F0))
        if code:
            raise DiffersError(f"0x1014: {said(code)}")


@error_control("H1", "7.2.8.3.3", "after each reset one boot-up message comes, within 5 s")
def boot_up(node: NodeUnderTest) -> None:
    for command in (NmtCommand.RESET_COMMUNICATION, NmtCommand.RESET_NODE):
        boots = [each for each in node.reset(command) if each.frame.data[:1] == b"\0"]
        expect(len(boots) == 1, f"{len(boots)} boot-up messages after {command.name}")
        expect(len(boots[0].frame.data) == 1, "the boot-up message has more than one byte")


@error_control("H2", "7.2.8.2.2", "the heartbeat has the period of 1017h, and the state")
def heartbeat(node: NodeUnderTest) -> None:
    for state in (NmtState.OPERATIONAL, NmtState.STOPPED, NmtState.PRE_OPERATIONAL):
        node.enter(state)
        mark = node.mark()
        node.wait(11 * HEARTBEAT_MS / 1000)
        beats = node.since(mark, COB_HEARTBEAT + node.node_id)
        expect(len(beats) >= 2, f"no heartbeat in {state.name}")
        wrong = [each for each in beats if each.frame.data != bytes((state,))]
        expect(not wrong, f"in {state.name} a heartbeat says {wrong[0].frame.data.hex() if wrong else ''}")
        period_ms = 1000 * (beats[-1].t_s - beats[0].t_s) / (len(beats) - 1)
        near = abs(period_ms - HEARTBEAT_MS) <= _JITTER * HEARTBEAT_MS
        expect(near, f"the period in {state.name} is {period_ms:.1f} ms, not {HEARTBEAT_MS}")


@error_control("H4", "7.5.2.18", "two consumer entries for one node are refused with 06040043h")
def twice(node: NodeUnderTest) -> None:
    node.needed(_SECOND_CONSUMER)
    with node.kept(_CONSUMER), node.kept(_SECOND_CONSUMER):
        node.download(_CONSUMER, u32(0x007D_1388))
        code = node.write_code(_SECOND_CONSUMER, u32(0x007D_1388))
    expect(code == AbortCode.INCOMPATIBLE, said(code))


@contextmanager
def _guarded(node: NodeUnderTest, guard_time_ms: int, factor: int) -> Iterator[None]:
    """Switch the heartbeat off for node guarding, then on again; raise SkippedError for a node without 100Ch."""
    for address in (_GUARD_TIME, _LIFE_FACTOR):
        node.needed(address)
    with node.kept(_GUARD_TIME), node.kept(_LIFE_FACTOR):
        try:
            node.download(HEARTBEAT_TIME, bytes(2))
            node.download(_GUARD_TIME, guard_time_ms.to_bytes(2, "little"))
            node.download(_LIFE_FACTOR, bytes((factor,)))
            yield
        finally:
            node.produce_heartbeat()


@error_control("H5", "7.2.8.3.2", "node guarding is answered with the state and a toggle bit that begins with 0")
def guarding(node: NodeUnderTest) -> None:
    node.needed(_GUARD_TIME)
    node.reset(NmtCommand.RESET_COMMUNICATION)
    with _guarded(node, 0, 0):
        for toggle in (0x00, 0x80, 0x00):
            found = node.request_state()
            wanted = toggle | NmtState.PRE_OPERATIONAL
            expect(found is not None, f"no answer within {GUARD_S:g} s")
            expect(found == wanted, f"the answer is {found or 0:02X}h, not {wanted:02X}h")
    node.wait(HEARTBEAT_MS / 1000)
    answers = [node.request_state() for _ in range(2)]
    toggled = any(each is not None and each & 0x80 for each in answers)
    expect(not toggled, "a node with a heartbeat answers node guarding")


@error_control("H6", "7.2.8.3.2", "after the node life time without a request an EMCY 8130h comes")
def life_guarding(node: NodeUnderTest) -> None:
    with _guarded(node, 50, 3):
        node.wait(_LIFE_S * 2)
        mark = node.mark()
        expect(node.request_state() is not None, f"no answer within {GUARD_S:g} s")
        node.wait(_LIFE_S * 2)
        codes = [int.from_bytes(data[:2], "little") for data in node.emergencies(mark)]
        node.request_state()
    if not codes:
        raise DiffersError("the node does not watch the master: no EMCY follows")
    expect(0x8130 in codes, f"EMCY {codes[0]:04X}h, not 8130h")


@nmt_check("N1", "7.3.2.2", "each NMT command leads to its state")
def commands(node: NodeUnderTest) -> None:
    for command, state in _STATES:
        node.command(command)
        node.wait(2 * HEARTBEAT_MS / 1000)
        found = node.state()
        expect(found == state, f"after {command.name} the heartbeat says {found:02X}h, not {state.value:02X}h")


@nmt_check("N2", "7.3.2.2", "a command to node 0 is obeyed, one to another node is not")
def addressed(node: NodeUnderTest) -> None:
    other = node.node_id % 126 + 1
    for node_id, state in ((other, NmtState.PRE_OPERATIONAL), (0, NmtState.OPERATIONAL)):
        node.command(NmtCommand.START, node_id)
        node.wait(2 * HEARTBEAT_MS / 1000)
        found = node.state()
        expect(found == state, f"START to node {node_id}: the heartbeat says {found:02X}h, not {state.value:02X}h")


@nmt_check("N3", "7.3.2.2", "an unknown command, and one of a wrong length, are ignored")
def unknown_commands(node: NodeUnderTest) -> None:
    for data in (bytes((0x33, node.node_id)), bytes((NmtCommand.START,))):
        node.send(COB_NMT, data)
        node.wait(2 * HEARTBEAT_MS / 1000)
        found = node.state()
        expect(found == NmtState.PRE_OPERATIONAL, f"{data.hex(' ')}: the heartbeat says {found:02X}h")


@store_check("R1", "7.5.2.13", "1010h and 1011h say what they can, and refuse a wrong signature with 08000020h")
def signatures(node: NodeUnderTest) -> None:
    for address in (_STORE, _RESTORE):
        node.needed(address)
        code = node.write_code(address, _WRONG_SIGNATURE)
        right = code in (AbortCode.NOT_STORED, 0x0800_0000, 0x0800_0021)
        expect(right, f"{od.place_text(address)}: {said(code, 'takes any text')}")
        if code != AbortCode.NOT_STORED:
            raise DiffersError(f"{od.place_text(address)} refuses with {said(code)}")
