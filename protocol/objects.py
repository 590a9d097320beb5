"""The object dictionary of one axis node, as data: every entry's index, type, access, default and range.

Everything else is made from this table: the board's storage, the SDO server's checks, the PDO mappings and the EDS.
Positions are in wire units of 1/16 384 full motor step, velocities in units per second, accelerations in units per
second squared; the PVT record has its own, finer velocity.
"""

from dataclasses import dataclass, field
from enum import Enum

from steptwin.protocol.cia402 import (
    LINEAR_RAMP,
    PVT_SUBMODE,
    AbortConnection,
    DigitalOutput,
    Mode,
)
from steptwin.protocol.datatypes import DataType
from steptwin.protocol.frame import COB_EMCY, COB_ID_INVALID, COB_ID_NO_RTR, COB_RPDO, COB_SYNC, COB_TPDO
from steptwin.protocol.homing_methods import HOME_HERE, HOMING_METHODS
from steptwin.protocol.nmt import ErrorBehaviour

I8, I16, I24, I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER24, DataType.INTEGER32
U8, U16, U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
STRING = DataType.VISIBLE_STRING


UNITS_PER_FULL_STEP = 16_384
"""Wire units, whatever the microstep setting."""
FULL_STEPS_PER_REVOLUTION = 200
"""A 1.8 degree motor. Gears and spindles are the host's matter: positions are the motor's."""


class Access(Enum):
    """Who may do what by SDO; the value is the EDS keyword (CiA 306)."""

    CONST = "const"
    READ_ONLY = "ro"
    READ_WRITE = "rw"
    WRITE_ONLY = "wo"


class Mapping(Enum):
    """Into which PDOs an entry may be mapped."""

    NONE = 0
    RECEIVE = 1
    TRANSMIT = 2
    BOTH = 3


CONST, RO, RW, WO = Access.CONST, Access.READ_ONLY, Access.READ_WRITE, Access.WRITE_ONLY
RX, TX, RXTX = Mapping.RECEIVE, Mapping.TRANSMIT, Mapping.BOTH


@dataclass(frozen=True, slots=True)
class Entry:
    """One readable or writable value.

    `default` counts from the node id if `plus_node_id`. `low` and `high` bound what may be written; None means the
    type's own range.
    """

    name: str
    data_type: DataType
    access: Access
    default: int | str = 0
    low: int | None = None
    high: int | None = None
    mapping: Mapping = Mapping.NONE
    plus_node_id: bool = False

    def default_for(self, node_id: int) -> int | str:
        """The value after power-up of the node with this id."""
        if self.plus_node_id and isinstance(self.default, int):
            return self.default + node_id
        return self.default


class Kind(Enum):
    """CiA 301 object codes."""

    VARIABLE = 7
    ARRAY = 8
    RECORD = 9


@dataclass(frozen=True, slots=True)
class Object:
    """An index with its entries by sub-index; a variable has the one entry 0."""

    index: int
    name: str
    kind: Kind
    entries: dict[int, Entry] = field(default_factory=dict)


def _variable(
    index: int,
    name: str,
    data_type: DataType,
    access: Access,
    default: int | str = 0,
    *,
    low: int | None = None,
    high: int | None = None,
    mapping: Mapping = Mapping.NONE,
    plus_node_id: bool = False,
) -> Object:
    entry = Entry(name, data_type, access, default, low, high, mapping, plus_node_id)
    return Object(index, name, Kind.VARIABLE, {0: entry})


def _record(index: int, name: str, *entries: Entry, kind: Kind = Kind.RECORD) -> Object:
    count = Entry("Highest sub-index supported", U8, CONST, len(entries))
    return Object(index, name, kind, {0: count} | dict(enumerate(entries, start=1)))


def _array(index: int, name: str, *entries: Entry) -> Object:
    return _record(index, name, *entries, kind=Kind.ARRAY)


def _list(index: int, name: str, count: Entry, *entries: Entry, kind: Kind) -> Object:
    return Object(index, name, kind, {0: count} | dict(enumerate(entries, start=1)))


IDENTITY_DEVICE_TYPE = 0x0004_0192
"""CiA 402 (0x192 = 402), bit 18: stepper motor."""
PDO_COUNT = 4
PDO_ENTRIES_MAX = 8
HISTORY_DEPTH = 8
PARAMETER_GROUPS = ((0x1000, 0xFFFF), (0x1000, 0x1FFF), (0x6000, 0x9FFF), (0x2000, 0x5FFF))
"""First and last index of what each entry of 0x1010 and 0x1011 stores and restores."""
_PARAMETER_GROUP_NAMES = ("all parameters", "communication parameters", "application parameters", "board parameters")
HEARTBEAT_PRODUCERS_MAX = 4

PULSE_NS_MIN = 4_000
TIMING_NS_MAX = 1_000_000
"""Bounds of the step timing 0x2001: no CLK phase below 4 us, which is 125 kHz, no timing above 1 ms."""

CYCLE_MS_MAX = 10
"""The longest period of cyclic synchronous position."""
MILLI = -3

WINDOW_OFF = U32.high
"""What switches the windows 0x6065 and 0x6067 off."""

ASYNCHRONOUS = 255
MANUFACTURER_EVENT = 254
SYNCHRONOUS = 1

RPDO_DEFAULTS: tuple[tuple[int, tuple[tuple[int, int, int], ...]], ...] = (
    (ASYNCHRONOUS, ((0x6040, 0, 16), (0x6060, 0, 8))),
    (SYNCHRONOUS, ((0x6040, 0, 16),)),
    (SYNCHRONOUS, ((0x607A, 0, 32),)),
    (ASYNCHRONOUS, ((0x60C1, 1, 24), (0x60C1, 2, 24), (0x60C1, 3, 8), (0x60C1, 4, 8))),
)
"""Transmission type and mapping (index, sub-index, bits) of the four receive PDOs."""

TPDO_DEFAULTS: tuple[tuple[int, int, int, bool, tuple[tuple[int, int, int], ...]], ...] = (
    (ASYNCHRONOUS, 50, 100, True, ((0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32))),
    (SYNCHRONOUS, 0, 0, False, ((0x6064, 0, 32), (0x606C, 0, 32))),
    (
        MANUFACTURER_EVENT,
        100,
        100,
        True,
        ((0x2012, 1, 8), (0x2012, 2, 8), (0x2012, 3, 8), (0x2012, 4, 8), (0x2012, 5, 32)),
    ),
    (ASYNCHRONOUS, 0, 0, True, ((0x60FD, 0, 32), (0x603F, 0, 16))),
)
"""Type, inhibit time in 100 us, event timer in ms, enabled, and mapping of the four transmit PDOs."""


def _mapping_entries(mapping: tuple[tuple[int, int, int], ...]) -> list[Entry]:
    words = [index << 16 | subindex << 8 | bits for index, subindex, bits in mapping]
    words += [0] * (PDO_ENTRIES_MAX - len(words))
    return [Entry(f"Mapped object {i}", U32, RW, word) for i, word in enumerate(words, start=1)]


def _mapping_count(mapping: tuple[tuple[int, int, int], ...]) -> Entry:
    return Entry("Number of mapped objects", U8, RW, len(mapping), 0, PDO_ENTRIES_MAX)


def _rpdo_objects() -> list[Object]:
    objects = []
    for i, (transmission, mapping) in enumerate(RPDO_DEFAULTS):
        name = f"RPDO{i + 1}"
        objects += [
            _record(
                0x1400 + i,
                f"{name} communication parameter",
                Entry("COB-ID", U32, RW, COB_RPDO[i], plus_node_id=True),
                Entry("Transmission type", U8, RW, transmission),
            ),
            _list(
                0x1600 + i,
                f"{name} mapping parameter",
                _mapping_count(mapping),
                *_mapping_entries(mapping),
                kind=Kind.RECORD,
            ),
        ]
    return objects


def _tpdo_objects() -> list[Object]:
    objects = []
    for i, (transmission, inhibit, event_timer, enabled, mapping) in enumerate(TPDO_DEFAULTS):
        name = f"TPDO{i + 1}"
        cob_id = COB_TPDO[i] | COB_ID_NO_RTR | (0 if enabled else COB_ID_INVALID)
        communication = {
            0: Entry("Highest sub-index supported", U8, CONST, 6),
            1: Entry("COB-ID", U32, RW, cob_id, plus_node_id=True),
            2: Entry("Transmission type", U8, RW, transmission),
            3: Entry("Inhibit time in 100 us", U16, RW, inhibit),
            5: Entry("Event timer in ms", U16, RW, event_timer),
            6: Entry("SYNC start value", U8, RW, 0, 0, 240),
        }
        objects += [
            Object(0x1800 + i, f"{name} communication parameter", Kind.RECORD, communication),
            _list(
                0x1A00 + i,
                f"{name} mapping parameter",
                _mapping_count(mapping),
                *_mapping_entries(mapping),
                kind=Kind.RECORD,
            ),
        ]
    return objects


_COMMUNICATION = [
    _variable(0x1000, "Device type", U32, CONST, IDENTITY_DEVICE_TYPE),
    _variable(0x1001, "Error register", U8, RO, mapping=TX),
    _list(
        0x1003,
        "Pre-defined error field",
        Entry("Number of errors", U8, RW, 0, 0, 0),  # writing 0 clears the history, CiA 301 section 7.5.2.4
        *[Entry(f"Standard error field {i}", U32, RO) for i in range(1, HISTORY_DEPTH + 1)],
        kind=Kind.ARRAY,
    ),
    _variable(0x1005, "COB-ID SYNC", U32, CONST, COB_SYNC),
    _variable(0x1006, "Communication cycle period in us", U32, RW),
    _variable(0x1008, "Manufacturer device name", STRING, CONST, "StepTwin TB6560 axis (SIMULATED)"),
    _variable(0x1009, "Manufacturer hardware version", STRING, CONST, "STM32F103 + TB6560"),
    _variable(0x100A, "Manufacturer software version", STRING, CONST, "0.1.0"),
    _array(0x1010, "Store parameters", *[Entry(f"Save {name}", U32, RW, 1) for name in _PARAMETER_GROUP_NAMES]),
    _array(
        0x1011,
        "Restore default parameters",
        *[Entry(f"Restore {name}", U32, RW, 1) for name in _PARAMETER_GROUP_NAMES],
    ),
    _variable(0x1013, "High resolution time stamp in us", U32, RW, mapping=RXTX),
    _variable(0x1014, "COB-ID EMCY", U32, RW, COB_EMCY, plus_node_id=True),
    _variable(0x1015, "Inhibit time EMCY in 100 us", U16, RW),
    _array(
        0x1016,
        "Consumer heartbeat time",
        *[
            Entry(f"Producer {i}: node id in bits 16 to 23, time in ms in bits 0 to 15", U32, RW, 0, 0, 0x00FF_FFFF)
            for i in range(1, HEARTBEAT_PRODUCERS_MAX + 1)
        ],
    ),
    _variable(0x1017, "Producer heartbeat time in ms", U16, RW),
    _record(
        0x1018,
        "Identity object",
        Entry("Vendor-ID", U32, CONST, 0),
        Entry("Product code", U32, CONST, 0x6560),
        Entry("Revision number", U32, CONST, 0x0001_0000),
        Entry("Serial number", U32, CONST, 0),
    ),
    _variable(0x1019, "Synchronous counter overflow value", U8, RW, low=0, high=240),
    _array(0x1029, "Error behaviour", Entry("Communication error", U8, RW, ErrorBehaviour.PRE_OPERATIONAL, 0, 2)),
]

_DRIVER = [
    _record(
        0x2000,
        "TB6560 settings",
        Entry("Microsteps per full step", U8, RW, 16, 1, 16),
        Entry("Torque in percent of the full current", U8, RW, 100, 20, 100),
        Entry("Fast decay in percent of a chopping period", U8, RW, 0, 0, 100),
        Entry("Torque at rest in percent of the full current", U8, RW, 100, 20, 100),
    ),
    _record(
        0x2001,
        "Step timing",
        Entry("steplen: CLK high in ns", U32, RW, 33_000, PULSE_NS_MIN, TIMING_NS_MAX),
        Entry("stepspace: CLK low in ns", U32, RW, 33_666, PULSE_NS_MIN, TIMING_NS_MAX),
        Entry("dirsetup: DIR stable before a CLK rise in ns", U32, RW, 15_000, 0, TIMING_NS_MAX),
        Entry("dirhold: DIR stable after a CLK rise in ns", U32, RW, 15_000, 0, TIMING_NS_MAX),
        Entry("Invert mask: 2 inverts DIR", U8, RW, 0, 0, 2),
    ),
    _record(
        0x2002,
        "Board measurements and their limits",
        Entry("Board temperature in 0.1 degC", I16, RO, mapping=TX),
        Entry("Motor supply in 10 mV", U16, RO, mapping=TX),
        Entry("Least motor supply in 10 mV", U16, RW, 1000),
        Entry("Highest motor supply in 10 mV: 34 V, TB6560AHQ datasheet page 8", U16, RW, 3400),
        Entry("Highest board temperature in 0.1 degC", I16, RW, 850),
    ),
    _record(
        0x2010,
        "Interpolation group",
        Entry("Group stop: a fault stops all interpolating axes", U8, RW, 1, 0, 1),
        Entry("Low-water mark of the queue in records", U8, RW, 16, 0, 64),
    ),
    _record(
        0x2012,
        "PVT status",
        Entry("Next sequence number", U8, RO, mapping=TX),
        Entry("Free records", U8, RO, mapping=TX),
        Entry("Flags", U8, RO, mapping=TX),
        Entry("Executing sequence number", U8, RO, mapping=TX),
        Entry("Board clock in us", U32, RO, mapping=TX),
    ),
    _record(
        0x2013,
        "PVT counters",
        Entry("Records accepted", U32, RO),
        Entry("Gaps", U16, RO),
        Entry("Overflows", U16, RO),
        Entry("Underruns", U16, RO),
        Entry("Least fill while running", U8, RO),
        Entry("Delayed steps", U32, RO),
    ),
    _record(
        0x2020,
        "Homing",
        Entry("Timeout in ms; 0: none", U32, RW, 120_000),
        Entry("Why the last homing has failed", U8, RO),
    ),
]

_EMULATOR = [
    _record(
        0x2F00,
        "Emulator only: what the driver has made of the pulses since power-up",
        Entry("Rotor position in steps", I32, RO, mapping=TX),
        Entry("Lost steps", I32, RO, mapping=TX),
        Entry("Driver violations", U32, RO, mapping=TX),
    ),
]

_DRIVE = [
    _variable(0x6007, "Abort connection option code", I16, RW, AbortConnection.FAULT_SIGNAL, low=0, high=3),
    _variable(0x603F, "Error code", U16, RO, mapping=TX),
    _variable(0x6040, "Controlword", U16, RW, mapping=RX),
    _variable(0x6041, "Statusword", U16, RO, mapping=TX),
    _variable(0x605A, "Quick stop option code", I16, RW, 2, low=0, high=6),
    # CiA 402's own default is 0: cut. A vertical axis would fall.
    _variable(0x605B, "Shutdown option code", I16, RW, 1, low=0, high=1),
    _variable(0x605C, "Disable operation option code", I16, RW, 1, low=0, high=1),
    _variable(0x605D, "Halt option code", I16, RW, 1, low=1, high=2),
    _variable(0x605E, "Fault reaction option code", I16, RW, 2, low=0, high=2),
    _variable(0x6060, "Modes of operation", I8, RW, Mode.NONE, mapping=RX),
    _variable(0x6061, "Modes of operation display", I8, RO, mapping=TX),
    _variable(0x6062, "Position demand value", I32, RO, mapping=TX),
    _variable(0x6064, "Position actual value", I32, RO, mapping=TX),
    _variable(0x6065, "Following error window in units; all ones: off", U32, RW, WINDOW_OFF),
    _variable(0x6066, "Following error time out in ms", U16, RW, 0),
    _variable(0x6067, "Position window in units; all ones: off", U32, RW, WINDOW_OFF),
    _variable(0x6068, "Position window time in ms", U16, RW, 0),
    _variable(0x606C, "Velocity actual value", I32, RO, mapping=TX),
    _variable(0x607A, "Target position", I32, RW, mapping=RXTX),
    _variable(0x607C, "Home offset", I32, RW),
    _array(
        0x607D,
        "Software position limit",
        Entry("Min position limit in units", I32, RW, I32.low),
        Entry("Max position limit in units", I32, RW, I32.high),
    ),
    _variable(0x607E, "Polarity: 0xC0 reverses the axis", U8, RW, 0, low=0, high=0xC0),
    _variable(0x607F, "Max profile velocity", U32, RW, 8_000 * UNITS_PER_FULL_STEP, low=1),
    _variable(0x6081, "Profile velocity", U32, RW, 1_000 * UNITS_PER_FULL_STEP, low=1, mapping=RX),
    _variable(0x6083, "Profile acceleration", U32, RW, 5_000 * UNITS_PER_FULL_STEP, low=1, mapping=RX),
    _variable(0x6084, "Profile deceleration", U32, RW, 5_000 * UNITS_PER_FULL_STEP, low=1, mapping=RX),
    _variable(0x6085, "Quick stop deceleration", U32, RW, 20_000 * UNITS_PER_FULL_STEP, low=1),
    _variable(0x6086, "Motion profile type: 0 linear ramp, 3 jerk-limited ramp", I16, RW, LINEAR_RAMP, low=0, high=3),
    _array(
        0x608F,
        "Position encoder resolution",
        Entry("Units", U32, CONST, UNITS_PER_FULL_STEP * FULL_STEPS_PER_REVOLUTION),
        Entry("Motor revolutions", U32, CONST, 1),
    ),
    _array(0x6091, "Gear ratio", Entry("Motor revolutions", U32, CONST, 1), Entry("Shaft revolutions", U32, CONST, 1)),
    _array(
        0x6092,
        "Feed constant",
        Entry("Feed in units", U32, CONST, UNITS_PER_FULL_STEP * FULL_STEPS_PER_REVOLUTION),
        Entry("Shaft revolutions", U32, CONST, 1),
    ),
    _variable(0x6098, "Homing method", I8, RW, HOME_HERE, low=min(HOMING_METHODS), high=max(HOMING_METHODS)),
    _array(
        0x6099,
        "Homing speeds",
        Entry("Speed during search for switch", U32, RW, 500 * UNITS_PER_FULL_STEP, low=1),
        Entry("Speed during search for zero", U32, RW, 50 * UNITS_PER_FULL_STEP, low=1),
    ),
    _variable(0x609A, "Homing acceleration", U32, RW, 2_000 * UNITS_PER_FULL_STEP, low=1),
    _array(
        0x60A4,
        "Profile jerk",
        Entry("Profile jerk 1 in units per second cubed", U32, RW, 100_000 * UNITS_PER_FULL_STEP, low=1),
    ),
    _variable(0x60C0, "Interpolation sub mode select", I16, RW, PVT_SUBMODE, low=PVT_SUBMODE, high=PVT_SUBMODE),
    _record(
        0x60C1,
        "Interpolation data record (PVT)",
        Entry("Displacement in units", I24, RW, mapping=RX),
        Entry("End velocity in 1/64 unit per ms", I24, RW, mapping=RX),
        Entry("Duration in ms", U8, RW, mapping=RX),
        Entry("Sequence number: writing it queues the record", U8, RW, mapping=RX),
    ),
    # A period of value 10^index seconds. At 1 ms, CiA 402's default, eight axes would fill a bus of 1 Mbit/s.
    _record(
        0x60C2,
        "Interpolation time period",
        Entry("Interpolation time period value", U8, RW, CYCLE_MS_MAX, 1, CYCLE_MS_MAX),
        Entry("Interpolation time index: -3 is ms", I8, RW, MILLI, MILLI, MILLI),
    ),
    _record(
        0x60C4,
        "Interpolation data configuration",
        Entry("Maximum buffer size in records", U32, RO, 64),
        Entry("Actual buffer size in records", U32, RO, 64),
        Entry("Buffer organization: 0 is FIFO", U8, RO, 0),
        Entry("Buffer position in records", U16, RO, 0),
        Entry("Size of data record in bytes", U8, RO, 8),
        Entry("Buffer clear: 0 clears", U8, WO, 0, 0, 1),
    ),
    _variable(0x60C5, "Max acceleration", U32, RW, U32.high, low=1),
    _variable(0x60C6, "Max deceleration", U32, RW, U32.high, low=1),
    _array(
        0x60E3,
        "Supported homing methods",
        *[Entry(f"Supported homing method {i}", I8, CONST, method) for i, method in enumerate(HOMING_METHODS, start=1)],
    ),
    _variable(0x60F4, "Following error actual value", I32, RO, mapping=TX),
    _variable(0x60FC, "Position demand internal value in steps", I32, RO, mapping=TX),
    _variable(0x60FD, "Digital inputs", U32, RO, mapping=TX),
    # Bits without an output are stored and do nothing, as CiA 402 drives do: one word may serve unlike drives, and a
    # PDO that carries it is not lost. The mask lets both outputs through from the start, where many drives begin with
    # 0, so that a plain write of :01 switches them.
    _array(
        0x60FE,
        "Digital outputs",
        Entry("Physical outputs", U32, RW, mapping=RX),
        Entry("Bit mask: an output whose bit is 0 is off", U32, RW, DigitalOutput.OUT1 | DigitalOutput.OUT2),
    ),
    _variable(0x60FF, "Target velocity", I32, RW, mapping=RX),
    _variable(0x6502, "Supported drive modes", U32, CONST, sum(mode.supported_bit for mode in Mode)),
]

OBJECTS: tuple[Object, ...] = tuple(
    sorted([*_COMMUNICATION, *_rpdo_objects(), *_tpdo_objects(), *_DRIVER, *_EMULATOR, *_DRIVE], key=lambda o: o.index)
)
"""The whole dictionary, in index order."""
