"""A CAN database (DBC) of a board's traffic, written from the object table: loggers and analysers name every signal.

Each axis has its PDOs as they are mapped by default, its emergency and its heartbeat; NMT, SYNC and SDO are shared or
plain bytes. An axis may say how many wire units make one mm or degree: positions are then decoded in these.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
)
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.objects import OBJECTS, RPDO_DEFAULTS, TPDO_DEFAULTS, Entry
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

MASTER = "Master"
_WIRE_UNIT = "1/16384 full step"
_ENTRIES = {(item.index, subindex): entry for item in OBJECTS for subindex, entry in item.entries.items()}
_RPDO_PURPOSES = ("Control", "SyncControl", "SyncTarget", "Pvt")
_TPDO_PURPOSES = ("Status", "SyncActual", "PvtStatus", "Inputs")

_POSITIONS = frozenset({(0x6062, 0), (0x6064, 0), (0x607A, 0), (0x60C1, 1), (0x60F4, 0)})
_SPEEDS = {(0x606C, 0): 1.0, (0x60C1, 2): 1000.0 / VELOCITY_PER_UNIT_PER_MS}
"""Entries that are speeds, with what turns them into wire units per second."""


@dataclass(frozen=True, slots=True)
class AxisNames:
    """How an axis appears.

    Attributes:
        name: begins the names of its messages.
        unit: "mm" or "deg"; empty for wire units.
        units_per_unit: wire units in one of them, 1 for wire units.
    """

    name: str
    unit: str = ""
    units_per_unit: float = 1.0


@dataclass(frozen=True, slots=True)
class _Signal:
    name: str
    first_bit: int
    bits: int
    signed: bool
    factor: float = 1.0
    unit: str = ""

    def __str__(self) -> str:
        sign = "-" if self.signed else "+"
        place = f"{self.first_bit}|{self.bits}@1{sign}"
        return f' SG_ {self.name} : {place} ({self.factor!r},0) [0|0] "{self.unit}" {MASTER}'


@dataclass(frozen=True, slots=True)
class _Message:
    cob_id: int
    name: str
    size: int
    sender: str
    signals: tuple[_Signal, ...]

    def __str__(self) -> str:
        head = f"BO_ {self.cob_id} {self.name}: {self.size} {self.sender}"
        return "\n".join([head, *map(str, self.signals)])


def render_dbc(axes: tuple[AxisNames, ...]) -> str:
    """Return the DBC text of a board with these axes, from the first node id on."""
    messages = [*_shared(), *(m for i, axis in enumerate(axes) for m in _axis_messages(axis, FIRST_NODE_ID + i))]
    parts = [
        'VERSION ""',
        "NS_ :",
        "BS_:",
        " ".join(["BU_:", MASTER, *(axis.name for axis in axes)]),
        *map(str, messages),
        "\n".join(_value_tables(messages)),
    ]
    return "\n\n".join(parts) + "\n"


def _shared() -> list[_Message]:
    command = (_Signal("Command", 0, 8, signed=False), _Signal("NodeId", 8, 8, signed=False))
    return [
        _Message(COB_NMT, "NMT", 2, MASTER, command),
        _Message(COB_SYNC, "SYNC", 0, MASTER, ()),
        _heartbeat(HOST_NODE_ID, MASTER),
    ]


def _heartbeat(node_id: int, name: str) -> _Message:
    state = _Signal("NmtState", 0, 7, signed=False)
    return _Message(COB_HEARTBEAT + node_id, f"{name}_Heartbeat", 1, name, (state,))


def _axis_messages(axis: AxisNames, node_id: int) -> Iterator[_Message]:
    for i, (_, mapping) in enumerate(RPDO_DEFAULTS):
        yield _pdo(axis, COB_RPDO[i] + node_id, f"RPDO{i + 1}_{_RPDO_PURPOSES[i]}", MASTER, mapping)
    for i, (*_, mapping) in enumerate(TPDO_DEFAULTS):
        yield _pdo(axis, COB_TPDO[i] + node_id, f"TPDO{i + 1}_{_TPDO_PURPOSES[i]}", axis.name, mapping)
    emergency = (
        _Signal("ErrorCode", 0, 16, signed=False),
        _Signal("ErrorRegister", 16, 8, signed=False),
        _Signal("Manufacturer", 24, 40, signed=False),
    )
    yield _Message(COB_EMCY + node_id, f"{axis.name}_EMCY", 8, axis.name, emergency)
    yield _heartbeat(node_id, axis.name)
    sdo = (
        _Signal("Command", 0, 8, signed=False),
        _Signal("Index", 8, 16, signed=False),
        _Signal("SubIndex", 24, 8, signed=False),
        _Signal("Data", 32, 32, signed=False),
    )
    yield _Message(COB_SDO_REQUEST + node_id, f"{axis.name}_SDO_Request", 8, MASTER, sdo)
    yield _Message(COB_SDO_RESPONSE + node_id, f"{axis.name}_SDO_Response", 8, axis.name, sdo)


def _pdo(axis: AxisNames, cob_id: int, name: str, sender: str, mapping: tuple[tuple[int, int, int], ...]) -> _Message:
    signals = []
    first_bit = 0
    for index, subindex, bits in mapping:
        signals.append(_signal(axis, (index, subindex), first_bit, bits))
        first_bit += bits
    return _Message(cob_id & ~COB_ID_INVALID, f"{axis.name}_{name}", first_bit // 8, sender, tuple(signals))


def _signal(axis: AxisNames, key: tuple[int, int], first_bit: int, bits: int) -> _Signal:
    entry: Entry = _ENTRIES[key]
    time = re.search(r" in (ms|us)$", entry.name)
    factor, unit = 1.0, time[1] if time else ""
    if key in _POSITIONS:
        factor, unit = 1.0 / axis.units_per_unit, axis.unit or _WIRE_UNIT
    elif key in _SPEEDS:
        factor, unit = _SPEEDS[key] / axis.units_per_unit, f"{axis.unit or _WIRE_UNIT}/s"
    return _Signal(_identifier(entry.name), first_bit, bits, entry.data_type.signed, factor, unit)


def _identifier(name: str) -> str:
    """A DBC name from an object's: its words, up to a colon, without what they are counted in."""
    plain = re.sub(r" in (units|ms|us|1/64 unit per ms)\b.*", "", name.split(":", maxsplit=1)[0])
    return "".join(word[0].upper() + word[1:] for word in re.findall(r"[A-Za-z0-9]+", plain))


def _value_tables(messages: list[_Message]) -> Iterator[str]:
    """Names for values: NMT commands and states. The statusword's states need a mask, which a DBC does not know."""
    commands = " ".join(f'{command.value} "{command.name}"' for command in NmtCommand)
    yield f"VAL_ {COB_NMT} Command {commands} ;"
    states = " ".join(f'{state.value} "{state.name}"' for state in NmtState)
    for message in messages:
        if message.name.endswith("_Heartbeat"):
            yield f"VAL_ {message.cob_id} NmtState {states} ;"
