"""Render docs/protocol.md from the object table, the drive's state table and a short session on the bus."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import Final

from docs.generate.commands import GeneratedPage
from docs.generate.markdown import code, table
from steptwin.controller.motion.backend import fastest_kernel
from steptwin.controller.node.power_states import next_state
from steptwin.host.client import AxisSettings, Machine, StreamedMotion
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    Control,
    ErrorCode,
    State,
)
from steptwin.protocol.entry import DictionaryObject, Entry, Mapping
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
    Frame,
)
from steptwin.protocol.objects import ENTRIES, OBJECTS, RPDO_DEFAULTS, TPDO_DEFAULTS
from steptwin.protocol.od import index_and_subindex
from steptwin.protocol.pvt import PvtStatus
from steptwin.protocol.timer import COUNTS_PER_SECOND

_SETTINGS: Final = AxisSettings(16, 33_000, 33_666, 15_000, 15_000, 15_360_000, 32_768_000)
_RECORDS: Final = AxisRecords([4_096, 8_192, 4_096], [26_214, 26_214, 0], [20, 20, 20])
"""One full step, 16 384 units: accelerating to 409.6 units/ms, at constant speed, decelerating."""

_SERVICES: Final = (
    (COB_EMCY, "<", "EMCY"),
    *((cob_id, "<", f"TPDO{i}") for i, cob_id in enumerate(COB_TPDO, start=1)),
    *((cob_id, ">", f"RPDO{i}") for i, cob_id in enumerate(COB_RPDO, start=1)),
    (COB_SDO_RESPONSE, "<", "SDO"),
    (COB_SDO_REQUEST, ">", "SDO"),
    (COB_HEARTBEAT, "<", "heartbeat"),
)
_SDO_COMMANDS: Final = {0x40: "read", 0x23: "write", 0x27: "write", 0x2B: "write", 0x2F: "write", 0x60: "written"}


_WRITTEN: Final = 0x60
_STATUSWORD: Final = bytes((0x41, 0x60, 0x00))
"""Index and sub-index, as an SDO carries them."""
_HIGHEST: Final = "Highest sub-index supported"
_NUMBER: Final = re.compile(r" ?\b\d\b|(?<=PDO)\d")


def session() -> str:
    """Play the session; return it as one block."""
    board = _played()
    lines = [_line(counts, frame) for counts, frame in board.bus_log if not _follows(frame)]
    return code("\n".join(lines))


def _follows(frame: Frame) -> bool:
    """Return True for what only follows from the rest: answers to writes, and reading the statusword."""
    written = frame.cob_id == COB_SDO_RESPONSE + FIRST_NODE_ID and frame.data[0] == _WRITTEN
    return written or frame.data[1:4] == _STATUSWORD


def _played() -> EmbeddedBoard:
    whole = load_robot("teaching-scara")
    robot = replace(whole, joints=whole.joints[:1], home=whole.home[:1], outputs={}, boxes={}, sections={})
    board = EmbeddedBoard(robot, fastest_kernel(), MachineOptions(stand_at=[0.0]))
    machine = Machine(board, robot.joint_names)
    machine.connect()
    machine.configure((_SETTINGS,))
    machine.enable()
    machine.preset([0])
    machine.run(StreamedMotion((_RECORDS,), [0]), lambda _: None)
    machine.disable()
    machine.disconnect()
    return board


def _line(counts: int, frame: Frame) -> str:
    way, meaning = _meaning(frame)
    data = frame.data.hex(" ").upper()
    return f"{counts / COUNTS_PER_SECOND:9.6f} {way} {frame.cob_id:03X}  {data:<23}  {meaning}".rstrip()


def _meaning(frame: Frame) -> tuple[str, str]:
    if frame.cob_id == COB_NMT:
        return ">", f"NMT command {frame.data[0]} to {'all nodes' if frame.data[1] == 0 else hex(frame.data[1])}"
    if frame.cob_id == COB_SYNC:
        return ">", "SYNC"
    if frame.cob_id == COB_HEARTBEAT + HOST_NODE_ID:
        return ">", "heartbeat of the host"
    way, name = next((way, name) for base, way, name in _SERVICES if base + FIRST_NODE_ID == frame.cob_id)
    if name == "SDO":
        return way, _sdo(frame.data)
    details = {"RPDO2": _controlword, "RPDO4": _record, "TPDO1": _drive_status, "TPDO3": _pvt_status}
    return way, f"{name} {details[name](frame.data) if name in details else ''}"


def _sdo(data: bytes) -> str:
    index, subindex = int.from_bytes(data[1:3], "little"), data[3]
    command = _SDO_COMMANDS.get(data[0], "answer")
    value = int.from_bytes(data[4:8], "little", signed=True)
    entry = f"{index:04X}:{subindex:02X} {ENTRIES[od.address_of(index, subindex)].short_name}"
    return f"SDO {command} {entry} = {value}" if command in ("write", "answer") else f"SDO {command} {entry}"


def _controlword(data: bytes) -> str:
    return f"controlword 0x{int.from_bytes(data, 'little'):02X}, at the next SYNC"


def _record(data: bytes) -> str:
    displacement = int.from_bytes(data[0:3], "little", signed=True)
    velocity = int.from_bytes(data[3:6], "little", signed=True)
    return f"record {data[7]}: {displacement} units in {data[6]} ms, then {velocity}/64 units/ms"


def _drive_status(data: bytes) -> str:
    position = int.from_bytes(data[3:7], "little", signed=True)
    return f"statusword 0x{int.from_bytes(data[0:2], 'little'):04X}, mode {data[2]}, position {position}"


def _pvt_status(data: bytes) -> str:
    status = PvtStatus.decode(data)
    return f"next {status.next_sequence}, free {status.free}, flags {status.flags}"


_CONTROLWORDS: Final = (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, DISABLE_VOLTAGE, QUICK_STOP, Control.FAULT_RESET)
_MAPPED: Final = {Mapping.NONE: "", Mapping.RECEIVE: "RPDO", Mapping.TRANSMIT: "TPDO", Mapping.BOTH: "RPDO or TPDO"}


def _identifiers() -> str:
    rows = [
        ["NMT", _hex(COB_NMT), "command and node id, 0 for all"],
        ["SYNC", _hex(COB_SYNC), "starts and latches"],
        ["EMCY", f"{_hex(COB_EMCY)} + n", "error code, register, detail"],
        *([f"TPDO{i + 1}", f"{_hex(cob_id)} + n", "from the node"] for i, cob_id in enumerate(COB_TPDO)),
        *([f"RPDO{i + 1}", f"{_hex(cob_id)} + n", "to the node"] for i, cob_id in enumerate(COB_RPDO)),
        ["SDO", f"{_hex(COB_SDO_RESPONSE)} + n, {_hex(COB_SDO_REQUEST)} + n", "answers, requests"],
        ["heartbeat", f"{_hex(COB_HEARTBEAT)} + n", "state; 0 at boot-up"],
    ]
    return table(["service", "COB-ID", "contents"], rows, text_columns=3)


def _pdos() -> str:
    rows = [
        [f"RPDO{i}", str(pdo.transmission_type), "-", "-", _mapped(pdo.mapping)]
        for i, pdo in enumerate(RPDO_DEFAULTS, start=1)
    ]
    for i, pdo in enumerate(TPDO_DEFAULTS, start=1):
        name = f"TPDO{i}" if pdo.enabled else f"TPDO{i} (off)"
        inhibit, event_timer = _ms(pdo.inhibit_100us / 10), _ms(pdo.event_timer_ms)
        rows.append([name, str(pdo.transmission_type), inhibit, event_timer, _mapped(pdo.mapping)])
    return table(["PDO", "type", "inhibit", "event timer", "contents"], rows, text_columns=5)


def _mapped(mapping: tuple[int, ...]) -> str:
    entries = [(_key(*index_and_subindex(address)), ENTRIES[address]) for address in mapping]
    return ", ".join(f"{key} {entry.name} ({8 * entry.data_type.size} bit)" for key, entry in entries)


def _states() -> str:
    columns = ["state (statusword & mask)", *(f"0x{word:02X}" for word in _CONTROLWORDS)]
    return table(columns, [_state_row(state) for state in State], text_columns=len(columns))


def _state_row(state: State) -> list[str]:
    mask, bits = state.value
    targets = [next_state(state, word, 0) for word in _CONTROLWORDS]
    cells = ["-" if target is state else _spoken(target) for target in targets]
    if state is State.QUICK_STOP_ACTIVE:
        cells[_CONTROLWORDS.index(ENABLE_OPERATION)] += ", if 0x605A is 5 or 6 and the axis rests"
    return [f"{_spoken(state)} (0x{mask:02X}: 0x{bits:02X})", *cells]


def _errors() -> str:
    rows = [[f"0x{code:04X}", code.name.replace("_", " ").lower(), f"0x{code.register:02X}"] for code in ErrorCode]
    return table(["code", "meaning", "error register"], rows, text_columns=3)


def _objects() -> str:
    """Return the table; objects that differ only in their number and defaults, as those of PDOs, share their rows."""
    rows = []
    for _, alike in groupby(OBJECTS, key=lambda item: (_NUMBER.sub("", item.name), *item.entries)):
        rows += _object_rows([*alike])
    return table(["object", "name", "type", "access", "default (range)"], rows, text_columns=5)


def _object_rows(items: Sequence[DictionaryObject]) -> list[list[str]]:
    item, last = items[0], items[-1]
    rows = []
    for subindex, entry in item.entries.items():
        unit = entry.unit.value
        name = entry.name if unit in entry.name else f"{entry.name} in {unit}"
        kind = f"{'i' if entry.data_type.signed else 'u'}{8 * entry.data_type.size}" if entry.data_type.size else "text"
        access = ", ".join(filter(None, (entry.access.value, _MAPPED[entry.mapping])))
        defaults = {_default(each.entries[subindex]) for each in items}
        value = " ".join(filter(None, (_default(entry) if len(defaults) == 1 else "", _range(entry))))
        rows.append([_key(item.index, subindex), name, kind, access, value])
    if len(rows) == 1:
        return rows
    several = last is not item
    index = f"{item.index:04X}" + (f" to {last.index:04X}" if several else "")
    head = [index, f"**{_NUMBER.sub('', item.name) if several else item.name}**", *[""] * 3]
    return [head, *_runs(rows[1:] if rows[0][1] == _HIGHEST else rows)]


def _runs(rows: Sequence[list[str]]) -> list[list[str]]:
    """Return one row for entries that follow each other and differ only in their number."""
    kept = []
    for _, same in groupby(rows, key=lambda row: (_NUMBER.sub("", row[1]), *row[2:])):
        first, *rest = same
        if rest:
            key = f"{first[0]} to {rest[-1][0].partition(':')[2]}"
            first = [key, _NUMBER.sub("", first[1], count=1), *first[2:]]
        kept.append(first)
    return kept


def _default(entry: Entry) -> str:
    if isinstance(entry.default, str):
        return entry.default
    text = f"0x{entry.default:X}" if entry.default >= 1 << 16 else str(entry.default)
    return f"{text} + n" if entry.plus_node_id else text


def _range(entry: Entry) -> str:
    if entry.low is None and entry.high is None:
        return ""
    low = entry.data_type.low if entry.low is None else entry.low
    high = entry.data_type.high if entry.high is None else entry.high
    return f"({low}..{high})"


def _key(index: int, subindex: int) -> str:
    return f"{index:04X}:{subindex:02X}"


def _hex(cob_id: int) -> str:
    return f"0x{cob_id:03X}"


def _ms(value: float) -> str:
    return f"{value:g} ms" if value else "-"


def _spoken(state: State) -> str:
    return state.name.replace("_", " ")


PROTOCOL_PAGE: Final = GeneratedPage(
    "protocol",
    "the object table",
    {
        "identifiers": lambda _: _identifiers(),
        "pdos": lambda _: _pdos(),
        "states": lambda _: _states(),
        "errors": lambda _: _errors(),
        "session": lambda _: session(),
        "objects": lambda _: _objects(),
    },
)
