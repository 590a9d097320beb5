"""Render docs/protocol.md from the object table, the drive's state table and a short session on the bus."""

from typing import Final

from docs.generate.pieces import DOCS, filled
from docs.generate.wire_session import session
from steptwin.controller.power_states import next_state
from steptwin.host.papers.markdown import table
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
)
from steptwin.protocol.objects import ENTRIES, OBJECTS
from steptwin.protocol.od import index_and_subindex
from steptwin.protocol.pdo_defaults import RPDO_DEFAULTS, TPDO_DEFAULTS

PROTOCOL_PAGE: Final = DOCS / "protocol.md"

_NOTICE: Final = "<!-- Made by `make docs` from docs/protocol/protocol.md and the object table: change those. -->"
_CONTROLWORDS: Final = (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, DISABLE_VOLTAGE, QUICK_STOP, Control.FAULT_RESET)
_MAPPED: Final = {Mapping.NONE: "", Mapping.RECEIVE: "RPDO", Mapping.TRANSMIT: "TPDO", Mapping.BOTH: "both"}


def render_protocol() -> str:
    """Return the whole page; it ends with a newline."""
    page = filled(
        DOCS / "protocol" / "protocol.md",
        {
            "identifiers": lambda _: _identifiers(),
            "pdos": lambda _: _pdos(),
            "states": lambda _: _states(),
            "errors": lambda _: _errors(),
            "session": lambda _: session(),
            "objects": lambda _: _objects(),
        },
    )
    return f"{_NOTICE}\n\n{page}\n"


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
    return [f"{_spoken(state)} (0x{mask:02X}: 0x{bits:02X})", *cells]


def _errors() -> str:
    rows = [[f"0x{code:04X}", code.name.replace("_", " ").lower(), f"0x{code.register:02X}"] for code in ErrorCode]
    return table(["code", "meaning", "error register"], rows, text_columns=3)


def _objects() -> str:
    rows = [row for item in OBJECTS for row in _object_rows(item)]
    columns = ["object", "name", "type", "unit", "access", "default", "range", "PDO"]
    return table(columns, rows, text_columns=len(columns))


def _object_rows(item: DictionaryObject) -> list[list[str]]:
    rows = [[_key(item.index, subindex), entry.name, *_facts(entry)] for subindex, entry in item.entries.items()]
    if len(item.entries) == 1:
        return rows
    return [[f"{item.index:04X}", f"**{item.name}**", *[""] * 6], *rows]


def _facts(entry: Entry) -> list[str]:
    data_type, unit, access = entry.data_type.name.lower(), entry.unit.value, entry.access.value
    return [data_type, unit, access, _default(entry), _range(entry), _MAPPED[entry.mapping]]


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
    return f"{low}..{high}"


def _key(index: int, subindex: int) -> str:
    return f"{index:04X}:{subindex:02X}"


def _hex(cob_id: int) -> str:
    return f"0x{cob_id:03X}"


def _ms(value: float) -> str:
    return f"{value:g} ms" if value else "-"


def _spoken(state: State) -> str:
    return state.name.replace("_", " ")
