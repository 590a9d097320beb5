"""The object dictionary of one axis node, as data: every entry's address, type, access, unit, default and range.

Everything else is made from this table: the board's storage, the SDO server's checks, the PDO mappings, the EDS and the
DBC. Positions are in wire units of 1/16 384 full motor step, velocities in units per second, accelerations in units per
second squared; the PVT record has its own, finer velocity.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.cia402 import LINEAR_RAMP, PVT_SUBMODE, RAMPS, AbortConnection, DigitalOutput, Mode
from steptwin.protocol.entry import Access, DataType, DictionaryObject, Entry, EntryUnit, Mapping, ObjectCode
from steptwin.protocol.frame import COB_EMCY, COB_ID_INVALID, COB_ID_NO_RTR, COB_RPDO, COB_SYNC, COB_TPDO
from steptwin.protocol.homing_methods import HOME_HERE, HOMING_METHODS
from steptwin.protocol.nmt import ErrorBehaviour

SYNCHRONOUS: Final = 1
"""Transmission type: with every SYNC."""
ANY_CHANGE: Final = 254
"""Transmission type: when any mapped value changes, and by the event timer."""
ASYNCHRONOUS: Final = 255
"""Transmission type: when the drive announces the change of a mapped value, and by the event timer."""


@dataclass(frozen=True, slots=True)
class PdoDefault:
    """One PDO after power-up.

    Attributes:
        transmission_type: of CiA 301, section 7.5.2.37.
        mapping: addresses of the entries that it carries, in their order on the wire.
        inhibit_100us: least time between two transmissions in 100 us.
        event_timer_ms: a transmit PDO is sent at least this often; 0 for no timer.
        enabled: False if its COB-ID is marked invalid.
    """

    transmission_type: int
    mapping: tuple[int, ...]
    inhibit_100us: int = 0
    event_timer_ms: int = 0
    enabled: bool = True


RPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.CONTROLWORD, od.MODE_OF_OPERATION)),
    PdoDefault(SYNCHRONOUS, (od.CONTROLWORD,)),
    PdoDefault(SYNCHRONOUS, (od.TARGET_POSITION,)),
    PdoDefault(ASYNCHRONOUS, (od.PVT_DISPLACEMENT, od.PVT_END_VELOCITY, od.PVT_DURATION_MS, od.PVT_SEQUENCE)),
)
TPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.STATUSWORD, od.MODE_OF_OPERATION_DISPLAY, od.POSITION_ACTUAL), 50, 100),
    PdoDefault(SYNCHRONOUS, (od.POSITION_ACTUAL, od.VELOCITY_ACTUAL), enabled=False),
    PdoDefault(
        ASYNCHRONOUS,
        (od.PVT_NEXT_SEQUENCE, od.PVT_FREE_RECORDS, od.PVT_FLAGS, od.PVT_EXECUTING_SEQUENCE, od.BOARD_CLOCK_US),
        100,
        100,
    ),
    PdoDefault(ASYNCHRONOUS, (od.DIGITAL_INPUTS, od.ERROR_CODE)),
)


I8, I16, I24, I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER24, DataType.INTEGER32
U8, U16, U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
STRING: Final = DataType.VISIBLE_STRING
CONST, RO, RW, WO = Access.CONST, Access.READ_ONLY, Access.READ_WRITE, Access.WRITE_ONLY
RX, TX, RXTX = Mapping.RECEIVE, Mapping.TRANSMIT, Mapping.BOTH
POSITION, VELOCITY, ACCELERATION = EntryUnit.POSITION, EntryUnit.VELOCITY, EntryUnit.ACCELERATION
NS, US, HUNDRED_US, MS = EntryUnit.NS, EntryUnit.US, EntryUnit.HUNDRED_US, EntryUnit.MS
TEN_MV, TENTH_DEGC, PERCENT = EntryUnit.TEN_MV, EntryUnit.TENTH_DEGC, EntryUnit.PERCENT
STEPS, REVOLUTIONS, RECORDS = EntryUnit.STEPS, EntryUnit.REVOLUTIONS, EntryUnit.RECORDS

UNITS_PER_FULL_STEP: Final = 16_384
"""Wire units in a full step, whatever the microstep setting."""
FULL_STEPS_PER_REVOLUTION: Final = 200
"""Full steps of a 1.8 degree motor. The board's positions are the motor's; the host converts by gears and spindles."""
_UNITS_PER_REVOLUTION: Final = UNITS_PER_FULL_STEP * FULL_STEPS_PER_REVOLUTION

IDENTITY_DEVICE_TYPE: Final = 0x0004_0192
"""CiA 402 (0x192 = 402), bit 18: stepper motor."""
PDO_COUNT = len(RPDO_DEFAULTS)
PDO_ENTRIES_MAX: Final = 8
HISTORY_DEPTH = len(od.ERROR_HISTORY)
PARAMETER_GROUPS: Final = ((0x1000, 0xFFFF), (0x1000, 0x1FFF), (0x6000, 0x9FFF), (0x2000, 0x5FFF))
"""First and last index of each group of parameters that can be stored and restored."""
STORES: Final = (od.STORE_ALL, od.STORE_COMMUNICATION, od.STORE_APPLICATION, od.STORE_BOARD)
RESTORES: Final = (od.RESTORE_ALL, od.RESTORE_COMMUNICATION, od.RESTORE_APPLICATION, od.RESTORE_BOARD)
_GROUPS: Final = ("all parameters", "communication parameters", "application parameters", "board parameters")

STEP_ENTRIES: Final = (
    od.MICROSTEPS,
    od.STEPLEN_NS,
    od.STEPSPACE_NS,
    od.DIRSETUP_NS,
    od.DIRHOLD_NS,
    od.MAX_PROFILE_VELOCITY,
    od.POLARITY,
    od.INVERT_MASK,
)
"""The entries that say how steps are made, in the order of `StepConfig`'s fields."""

PULSE_NS_MIN: Final = 4_000
TIMING_NS_MAX: Final = 1_000_000
"""Bounds of the step timing (2001h): no CLK phase below 4 us, which is 125 kHz, and no timing above 1 ms."""

CHARGE_FREE: Final = 0
"""The token (2017h) that is read while no program is in charge.

Programs that do not know the object drive the axis as ever: it only lets programs that ask for it take turns.
"""
CHARGE_UNWATCHED_MS: Final = 1000
"""Time until a node that monitors no heartbeat forgets the program in charge."""

CYCLE_MS_MAX: Final = 10
"""The longest period of cyclic synchronous position."""
MILLI: Final = -3

WINDOW_OFF: Final = U32.high
"""The value that switches the following error window (6065h) and the position window (6067h) off."""


def _rate(title: str, full_steps: int, unit: EntryUnit, mapping: Mapping = Mapping.NONE) -> Entry:
    """Return an entry for a speed, an acceleration or a jerk, whose default is given in full steps and seconds."""
    return Entry(title, U32, RW, full_steps * UNITS_PER_FULL_STEP, low=1, mapping=mapping, unit=unit)


def _timing(title: str, default_ns: int, low_ns: int) -> Entry:
    return Entry(f"{title} in {{unit}}", U32, RW, default_ns, low_ns, TIMING_NS_MAX, unit=NS)


def _percent(title: str, default: int, values: tuple[int, ...]) -> Entry:
    """Return an entry for a setting of the TB6560 in percent; `values` are those that its pins can select."""
    return Entry(title, U8, RW, default, values[0], values[-1], unit=PERCENT, values=values)


_ENTRIES = {
    # --- communication (CiA 301)
    od.DEVICE_TYPE: Entry("Device type", U32, CONST, IDENTITY_DEVICE_TYPE),
    od.ERROR_REGISTER: Entry("Error register", U8, RO, mapping=TX),
    # Writing 0 clears the history (CiA 301, section 7.5.2.4).
    od.ERROR_HISTORY_COUNT: Entry("Number of errors", U8, RW, 0, 0, 0),
    **{address: Entry(f"Standard error field {i}", U32, RO) for i, address in enumerate(od.ERROR_HISTORY, start=1)},
    od.SYNC_COB_ID: Entry("COB-ID SYNC", U32, CONST, COB_SYNC),
    od.COMMUNICATION_CYCLE_PERIOD: Entry("Communication cycle period in {unit}", U32, RW, unit=US),
    od.DEVICE_NAME: Entry("Manufacturer device name", STRING, CONST, "StepTwin TB6560 axis (SIMULATED)"),
    od.HARDWARE_VERSION: Entry("Manufacturer hardware version", STRING, CONST, "STM32F103 + TB6560"),
    od.SOFTWARE_VERSION: Entry("Manufacturer software version", STRING, CONST, "0.1.0"),
    **{address: Entry(f"Save {group}", U32, RW, 1) for address, group in zip(STORES, _GROUPS, strict=True)},
    **{address: Entry(f"Restore {group}", U32, RW, 1) for address, group in zip(RESTORES, _GROUPS, strict=True)},
    od.TIME_STAMP: Entry("High resolution time stamp in {unit}", U32, RW, mapping=RXTX, unit=US),
    od.EMCY_COB_ID: Entry("COB-ID EMCY", U32, RW, COB_EMCY, plus_node_id=True),
    od.EMCY_INHIBIT_TIME: Entry("Inhibit time EMCY in {unit}", U16, RW, unit=HUNDRED_US),
    **{
        address: Entry(
            f"Producer {i}: node id in bits 16 to 23, time in ms in bits 0 to 15", U32, RW, 0, 0, 0x00FF_FFFF
        )
        for i, address in enumerate(od.CONSUMER_HEARTBEATS, start=1)
    },
    od.PRODUCER_HEARTBEAT_TIME: Entry("Producer heartbeat time in {unit}", U16, RW, unit=MS),
    od.VENDOR_ID: Entry("Vendor-ID", U32, CONST, 0),
    od.PRODUCT_CODE: Entry("Product code", U32, CONST, 0x6560),
    od.REVISION_NUMBER: Entry("Revision number", U32, CONST, 0x0001_0000),
    od.SERIAL_NUMBER: Entry("Serial number", U32, CONST, 0, plus_node_id=True),
    od.SYNC_COUNTER_OVERFLOW: Entry("Synchronous counter overflow value", U8, RW, low=0, high=240),
    od.COMMUNICATION_ERROR_BEHAVIOUR: Entry("Communication error", U8, RW, ErrorBehaviour.PRE_OPERATIONAL, 0, 2),
    # --- this board
    od.MICROSTEPS: Entry("Microsteps per full step", U8, RW, 16, 1, 16),
    od.TORQUE_PERCENT: _percent("Torque in {unit} of the full current", 100, (20, 50, 75, 100)),
    od.FAST_DECAY_PERCENT: _percent("Fast decay in {unit} of a chopping period", 0, (0, 25, 50, 100)),
    od.REST_TORQUE_PERCENT: _percent("Torque at rest in {unit} of the full current", 100, (20, 50, 75, 100)),
    od.STEPLEN_NS: _timing("steplen: CLK high", 33_000, PULSE_NS_MIN),
    od.STEPSPACE_NS: _timing("stepspace: CLK low", 33_666, PULSE_NS_MIN),
    od.DIRSETUP_NS: _timing("dirsetup: DIR stable before a CLK rise", 15_000, 0),
    od.DIRHOLD_NS: _timing("dirhold: DIR stable after a CLK rise", 15_000, 0),
    od.INVERT_MASK: Entry("Invert mask: 2 inverts DIR", U8, RW, 0, 0, 2),
    od.BOARD_TEMPERATURE: Entry("Board temperature in {unit}", I16, RO, mapping=TX, unit=TENTH_DEGC),
    od.SUPPLY_VOLTAGE: Entry("Motor supply in {unit}", U16, RO, mapping=TX, unit=TEN_MV),
    od.SUPPLY_VOLTAGE_MIN: Entry("Least motor supply in {unit}", U16, RW, 1000, unit=TEN_MV),
    od.SUPPLY_VOLTAGE_MAX: Entry(
        "Highest motor supply in {unit}: 34 V, TB6560AHQ datasheet page 8", U16, RW, 3400, unit=TEN_MV
    ),
    od.BOARD_TEMPERATURE_MAX: Entry("Highest board temperature in {unit}", I16, RW, 850, unit=TENTH_DEGC),
    od.GROUP_STOP: Entry("Group stop: a fault stops all interpolating axes", U8, RW, 1, 0, 1),
    od.QUEUE_LOW_WATER: Entry("Low-water mark of the queue in {unit}", U8, RW, 16, 0, 64, unit=RECORDS),
    od.PVT_NEXT_SEQUENCE: Entry("Next sequence number", U8, RO, mapping=TX),
    od.PVT_FREE_RECORDS: Entry("Free records", U8, RO, mapping=TX, unit=RECORDS),
    od.PVT_FLAGS: Entry("Flags", U8, RO, mapping=TX),
    od.PVT_EXECUTING_SEQUENCE: Entry("Executing sequence number", U8, RO, mapping=TX),
    od.BOARD_CLOCK_US: Entry("Board clock in {unit}", U32, RO, mapping=TX, unit=US),
    od.PVT_ACCEPTED: Entry("Records accepted", U32, RO, unit=RECORDS),
    od.PVT_GAPS: Entry("Gaps", U16, RO),
    od.PVT_OVERFLOWS: Entry("Overflows", U16, RO),
    od.PVT_UNDERRUNS: Entry("Underruns", U16, RO),
    od.PVT_LEAST_FILL: Entry("Least fill while running", U8, RO, unit=RECORDS),
    od.DELAYED_STEPS: Entry("Delayed steps", U32, RO, unit=STEPS),
    od.FRAMES_LOST: Entry("Frames lost because the bus was too busy", U32, RO),
    od.EMCYS_LOST: Entry("Emergencies lost because of the inhibit time EMCY", U32, RO),
    od.RPDO_VALUES_REFUSED: Entry("Values of RPDOs refused", U32, RO),
    od.RPDO_LAST_REFUSED: Entry("Entry of the last of them, as a mapping names it", U32, RO),
    od.CHARGE_TOKEN: Entry("Token: claims the axis for a program; 0: none is in charge", U32, RW),
    od.CHARGE_RELEASE: Entry("Release: takes the token of the program in charge", U32, WO),
    od.EMERGENCY_STOP: Entry("Emergency stop: 1 stops the axis until the fault reset", U8, RW, 0, 0, 1),
    od.FAULT_NUMBER: Entry("Number of the last fault or emergency stop since power-up; 0: none", U32, RO),
    od.FAULT_AGE_MS: Entry("Age of the last fault or emergency stop in {unit}", U32, RO, unit=MS),
    od.FAULT_RESET: Entry("Fault reset: the number of the fault or emergency stop that it answers", U32, WO),
    od.ROBOT_NAME: Entry("Name of the robot that this axis belongs to", STRING, RW, ""),
    od.ROBOT_NAME_CRC: Entry("CRC-32 of the name", U32, RO),
    od.HOMING_TIMEOUT_MS: Entry("Timeout in {unit}; 0: none", U32, RW, 120_000, unit=MS),
    od.HOMING_ERROR: Entry("Why the last homing has failed", U8, RO),
    # --- the emulator, which no real board has
    od.ROTOR_POSITION_STEPS: Entry("Driver's count in {unit}", I32, RO, mapping=TX, unit=STEPS),
    od.LOST_STEPS: Entry("Lost steps", I32, RO, mapping=TX, unit=STEPS),
    od.DRIVER_VIOLATIONS: Entry("Driver violations", U32, RO, mapping=TX),
    od.DRIVER_MICROSTEPS: Entry("Microsteps per full step that the driver makes", U8, RO, mapping=TX),
    od.SHAFT_POSITION: Entry("True position of the rotor in {unit}", I32, RO, mapping=TX, unit=POSITION),
    od.SLIPPED_FULL_STEPS: Entry("Full steps by which the rotor has slipped", I32, RO, mapping=TX),
    # --- the drive (CiA 402-2)
    od.ABORT_CONNECTION_OPTION: Entry("Abort connection option code", I16, RW, AbortConnection.FAULT_SIGNAL, 0, 3),
    od.ERROR_CODE: Entry("Error code", U16, RO, mapping=TX),
    od.CONTROLWORD: Entry("Controlword", U16, RW, mapping=RX),
    od.STATUSWORD: Entry("Statusword", U16, RO, mapping=TX),
    od.QUICK_STOP_OPTION: Entry("Quick stop option code", I16, RW, 2, 0, 6, values=(0, 1, 2, 5, 6)),
    # CiA 402's own default is 0, which cuts the current: a vertical axis would fall.
    od.SHUTDOWN_OPTION: Entry("Shutdown option code", I16, RW, 1, 0, 1),
    od.DISABLE_OPERATION_OPTION: Entry("Disable operation option code", I16, RW, 1, 0, 1),
    od.HALT_OPTION: Entry("Halt option code", I16, RW, 1, 1, 2),
    od.FAULT_REACTION_OPTION: Entry("Fault reaction option code", I16, RW, 2, 0, 2),
    od.MODE_OF_OPERATION: Entry("Modes of operation", I8, RW, Mode.NONE, mapping=RX, values=tuple(Mode)),
    od.MODE_OF_OPERATION_DISPLAY: Entry("Modes of operation display", I8, RO, mapping=TX),
    od.POSITION_DEMAND: Entry("Position demand value", I32, RO, mapping=TX, unit=POSITION),
    od.POSITION_ACTUAL: Entry("Position actual value", I32, RO, mapping=TX, unit=POSITION),
    od.FOLLOWING_ERROR_WINDOW: Entry(
        "Following error window in {unit}; all ones: off", U32, RW, WINDOW_OFF, unit=POSITION
    ),
    od.FOLLOWING_ERROR_TIMEOUT_MS: Entry("Following error time out in {unit}", U16, RW, 0, unit=MS),
    od.POSITION_WINDOW: Entry("Position window in {unit}; all ones: off", U32, RW, WINDOW_OFF, unit=POSITION),
    od.POSITION_WINDOW_TIME_MS: Entry("Position window time in {unit}", U16, RW, 0, unit=MS),
    od.VELOCITY_ACTUAL: Entry("Velocity actual value", I32, RO, mapping=TX, unit=VELOCITY),
    od.TARGET_POSITION: Entry("Target position", I32, RW, mapping=RXTX, unit=POSITION),
    od.HOME_OFFSET: Entry("Home offset", I32, RW, unit=POSITION),
    od.POSITION_LIMIT_MIN: Entry("Min position limit in {unit}", I32, RW, I32.low, unit=POSITION),
    od.POSITION_LIMIT_MAX: Entry("Max position limit in {unit}", I32, RW, I32.high, unit=POSITION),
    od.POLARITY: Entry("Polarity: 0xC0 reverses the axis", U8, RW, 0, 0, 0xC0),
    od.MAX_PROFILE_VELOCITY: _rate("Max profile velocity", 8_000, VELOCITY),
    od.PROFILE_VELOCITY: _rate("Profile velocity", 1_000, VELOCITY, RX),
    od.PROFILE_ACCELERATION: _rate("Profile acceleration", 5_000, ACCELERATION, RX),
    od.PROFILE_DECELERATION: _rate("Profile deceleration", 5_000, ACCELERATION, RX),
    od.QUICK_STOP_DECELERATION: _rate("Quick stop deceleration", 20_000, ACCELERATION),
    od.MOTION_PROFILE_TYPE: Entry(
        "Motion profile type: 0 linear ramp, 3 jerk-limited ramp", I16, RW, LINEAR_RAMP, 0, 3, values=RAMPS
    ),
    od.ENCODER_UNITS: Entry("Units", U32, CONST, _UNITS_PER_REVOLUTION, unit=POSITION),
    od.ENCODER_MOTOR_REVOLUTIONS: Entry("Motor revolutions", U32, CONST, 1, unit=REVOLUTIONS),
    od.GEAR_MOTOR_REVOLUTIONS: Entry("Motor revolutions", U32, CONST, 1, unit=REVOLUTIONS),
    od.GEAR_SHAFT_REVOLUTIONS: Entry("Shaft revolutions", U32, CONST, 1, unit=REVOLUTIONS),
    od.FEED_UNITS: Entry("Feed in {unit}", U32, CONST, _UNITS_PER_REVOLUTION, unit=POSITION),
    od.FEED_SHAFT_REVOLUTIONS: Entry("Shaft revolutions", U32, CONST, 1, unit=REVOLUTIONS),
    od.HOMING_METHOD: Entry(
        "Homing method", I8, RW, HOME_HERE, min(HOMING_METHODS), max(HOMING_METHODS), values=HOMING_METHODS
    ),
    od.HOMING_SEARCH_SPEED: _rate("Speed during search for switch", 500, VELOCITY),
    od.HOMING_ZERO_SPEED: _rate("Speed during search for zero", 50, VELOCITY),
    od.HOMING_ACCELERATION: _rate("Homing acceleration", 2_000, ACCELERATION),
    od.PROFILE_JERK: _rate("Profile jerk 1 in {unit}", 100_000, EntryUnit.JERK),
    od.INTERPOLATION_SUBMODE: Entry("Interpolation sub mode select", I16, RW, PVT_SUBMODE, PVT_SUBMODE, PVT_SUBMODE),
    od.PVT_DISPLACEMENT: Entry("Displacement in {unit}", I24, RW, mapping=RX, unit=POSITION),
    od.PVT_END_VELOCITY: Entry("End velocity in {unit}", I24, RW, mapping=RX, unit=EntryUnit.PVT_VELOCITY),
    od.PVT_DURATION_MS: Entry("Duration in {unit}", U8, RW, mapping=RX, unit=MS),
    od.PVT_SEQUENCE: Entry("Sequence number: writing it queues the record", U8, RW, mapping=RX),
    # A period of value 10^index seconds. At 1 ms, CiA 402's default, eight axes would fill a bus of 1 Mbit/s.
    od.INTERPOLATION_PERIOD: Entry("Interpolation time period value", U8, RW, CYCLE_MS_MAX, 1, CYCLE_MS_MAX, unit=MS),
    od.INTERPOLATION_PERIOD_EXPONENT: Entry("Interpolation time index: -3 is ms", I8, RW, MILLI, MILLI, MILLI),
    od.BUFFER_SIZE_MAX: Entry("Maximum buffer size in {unit}", U32, RO, 64, unit=RECORDS),
    od.BUFFER_SIZE: Entry("Actual buffer size in {unit}", U32, RO, 64, unit=RECORDS),
    od.BUFFER_ORGANIZATION: Entry("Buffer organization: 0 is FIFO", U8, RO, 0),
    od.BUFFER_POSITION: Entry("Buffer position in {unit}", U16, RO, 0, unit=RECORDS),
    od.BUFFER_RECORD_BYTES: Entry("Size of data record in {unit}", U8, RO, 8, unit=EntryUnit.BYTES),
    od.BUFFER_CLEAR: Entry("Buffer clear: 0 clears", U8, WO, 0, 0, 1),
    od.MAX_ACCELERATION: Entry("Max acceleration", U32, RW, U32.high, 1, unit=ACCELERATION),
    od.MAX_DECELERATION: Entry("Max deceleration", U32, RW, U32.high, 1, unit=ACCELERATION),
    **{
        address: Entry(f"Supported homing method {i}", I8, CONST, method)
        for i, (address, method) in enumerate(zip(od.SUPPORTED_HOMING_METHODS, HOMING_METHODS, strict=True), start=1)
    },
    od.FOLLOWING_ERROR_ACTUAL: Entry("Following error actual value", I32, RO, mapping=TX, unit=POSITION),
    od.POSITION_DEMAND_STEPS: Entry("Position demand internal value in {unit}", I32, RO, mapping=TX, unit=STEPS),
    od.DIGITAL_INPUTS: Entry("Digital inputs", U32, RO, mapping=TX),
    # Bits without an output are stored and do nothing, as in CiA 402 drives: one word may serve unlike drives, and a
    # PDO that carries such a bit is not lost. The mask lets both outputs through from the start, where many drives
    # begin with 0, so that a plain write of sub-index 1 switches them.
    od.DIGITAL_OUTPUTS: Entry("Physical outputs", U32, RW, mapping=RX),
    od.DIGITAL_OUTPUTS_MASK: Entry(
        "Bit mask: an output whose bit is 0 is off", U32, RW, DigitalOutput.OUT1 | DigitalOutput.OUT2
    ),
    od.TARGET_VELOCITY: Entry("Target velocity", I32, RW, mapping=RX, unit=VELOCITY),
    od.SUPPORTED_DRIVE_MODES: Entry("Supported drive modes", U32, CONST, sum(mode.supported_bit for mode in Mode)),
}

_NAMES = {
    ObjectCode.ARRAY: {
        od.ERROR_HISTORY_COUNT: "Pre-defined error field",
        od.STORE_ALL: "Store parameters",
        od.RESTORE_ALL: "Restore default parameters",
        od.CONSUMER_HEARTBEATS[0]: "Consumer heartbeat time",
        od.COMMUNICATION_ERROR_BEHAVIOUR: "Error behaviour",
        od.POSITION_LIMIT_MIN: "Software position limit",
        od.ENCODER_UNITS: "Position encoder resolution",
        od.GEAR_MOTOR_REVOLUTIONS: "Gear ratio",
        od.FEED_UNITS: "Feed constant",
        od.HOMING_SEARCH_SPEED: "Homing speeds",
        od.PROFILE_JERK: "Profile jerk",
        od.SUPPORTED_HOMING_METHODS[0]: "Supported homing methods",
        od.DIGITAL_OUTPUTS: "Digital outputs",
    },
    ObjectCode.RECORD: {
        od.VENDOR_ID: "Identity object",
        od.MICROSTEPS: "TB6560 settings",
        od.STEPLEN_NS: "Step timing",
        od.BOARD_TEMPERATURE: "Board measurements and their limits",
        od.GROUP_STOP: "Interpolation group",
        od.PVT_NEXT_SEQUENCE: "PVT status",
        od.PVT_ACCEPTED: "PVT counters",
        od.FRAMES_LOST: "Transmission counters",
        od.CHARGE_TOKEN: "Program in charge",
        od.FAULT_NUMBER: "Faults and emergency stops",
        od.ROBOT_NAME: "Robot",
        od.HOMING_TIMEOUT_MS: "Homing",
        od.ROTOR_POSITION_STEPS: "Emulator only: what the driver has made of the pulses since power-up",
        od.PVT_DISPLACEMENT: "Interpolation data record (PVT)",
        od.INTERPOLATION_PERIOD: "Interpolation time period",
        od.BUFFER_SIZE_MAX: "Interpolation data configuration",
    },
}
"""Names of the objects that have several entries, by the address of the first one."""


def _rpdo(number: int, pdo: PdoDefault) -> dict[int, Entry]:
    place = od.RPDO_COMMUNICATION[number]
    return {
        od.address_of(place, od.PDO_COB_ID): Entry("COB-ID", U32, RW, COB_RPDO[number], plus_node_id=True),
        od.address_of(place, od.PDO_TRANSMISSION_TYPE): Entry("Transmission type", U8, RW, pdo.transmission_type),
        **_mapping(od.RPDO_MAPPING[number], pdo.mapping),
    }


def _tpdo(number: int, pdo: PdoDefault) -> dict[int, Entry]:
    cob_id = COB_TPDO[number] | COB_ID_NO_RTR | (0 if pdo.enabled else COB_ID_INVALID)
    communication = {
        od.PDO_COB_ID: Entry("COB-ID", U32, RW, cob_id, plus_node_id=True),
        od.PDO_TRANSMISSION_TYPE: Entry("Transmission type", U8, RW, pdo.transmission_type),
        od.PDO_INHIBIT_TIME: Entry("Inhibit time in {unit}", U16, RW, pdo.inhibit_100us, unit=HUNDRED_US),
        od.PDO_EVENT_TIMER: Entry("Event timer in {unit}", U16, RW, pdo.event_timer_ms, unit=MS),
        od.PDO_SYNC_START: Entry("SYNC start value", U8, RW, 0, 0, 240),
    }
    own = {od.address_of(od.TPDO_COMMUNICATION[number], subindex): entry for subindex, entry in communication.items()}
    return own | _mapping(od.TPDO_MAPPING[number], pdo.mapping)


def _mapping(index: int, mapping: tuple[int, ...]) -> dict[int, Entry]:
    """Return a mapping parameter: a word of address and bits for each mapped entry (CiA 301, section 7.5.2.38)."""
    words = [address << 8 | 8 * _ENTRIES[address].data_type.size for address in mapping]
    words += [0] * (PDO_ENTRIES_MAX - len(words))
    entries = {od.address_of(index): Entry("Number of mapped objects", U8, RW, len(mapping), 0, PDO_ENTRIES_MAX)}
    for i, word in enumerate(words, start=1):
        entries[od.address_of(index, i)] = Entry(f"Mapped object {i}", U32, RW, word)
    return entries


def _objects() -> Iterator[DictionaryObject]:
    """Yield every object, in index order; sub-index 0, unless the table has it, holds the highest sub-index."""
    table = dict(_ENTRIES)
    names = {address >> 8: (name, code) for code, named in _NAMES.items() for address, name in named.items()}
    for i in range(PDO_COUNT):
        table |= _rpdo(i, RPDO_DEFAULTS[i]) | _tpdo(i, TPDO_DEFAULTS[i])
        for kind, communication, mapping in (
            ("RPDO", od.RPDO_COMMUNICATION[i], od.RPDO_MAPPING[i]),
            ("TPDO", od.TPDO_COMMUNICATION[i], od.TPDO_MAPPING[i]),
        ):
            names[communication] = f"{kind}{i + 1} communication parameter", ObjectCode.RECORD
            names[mapping] = f"{kind}{i + 1} mapping parameter", ObjectCode.RECORD
    for index, addresses in groupby(sorted(table), key=lambda address: address >> 8):
        entries = {address & 0xFF: table[address] for address in addresses}
        if index in names:
            count = Entry("Highest sub-index supported", U8, CONST, max(entries))
            name, code = names[index]
            yield DictionaryObject(index, name, code, {0: count} | entries)
        else:
            yield DictionaryObject(index, entries[0].name, ObjectCode.VARIABLE, entries)


OBJECTS: Final = tuple(_objects())
"""The whole dictionary, in index order."""
ENTRIES: Final = {od.address_of(item.index, i): entry for item in OBJECTS for i, entry in item.entries.items()}
"""All entries by address, in order."""
