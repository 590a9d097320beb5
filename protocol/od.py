"""The object dictionary of one axis node as a table: one row describes one entry.

All code names an entry by its address, index << 8 | sub-index. Only frames, the EDS and messages split it into index
and sub-index. A name ends with a unit where the unit is easily mistaken. The board's storage, the SDO server's checks,
the PDO mappings, the EDS and the DBC are made from the rows.

The board counts positions in wire units of 1/16 384 full motor step, velocities in wire units per second and
accelerations in wire units per second squared. The PVT record has a finer unit of velocity. Defaults are in these
units. A master reads and writes POSITION, VELOCITY, ACCELERATION and JERK entries in user units, which equal wire
units until it writes the factors (6091h, 6092h).

`read` names the attribute, property or method of the firmware that supplies an entry's present value. `write` names the
method that acts on a written value or refuses it; it is called after the row's checks and before the value is stored.
Both have the form "Class.name"; `ObjectDictionary.bind` connects them. A method whose name ends with "_at" also
receives the entry's address. An entry without handlers only stores its value.
"""

from collections.abc import Collection
from typing import Final

from steptwin.protocol.cia402 import (
    INCREMENTS,
    LINEAR_RAMP,
    LINEAR_SUBMODE,
    PVT_SUBMODE,
    RAMPS,
    SI_PREFIXES,
    SI_UNITS,
    AbortConnection,
    DigitalOutput,
    Mode,
)
from steptwin.protocol.entry import Access, DataType, Entry, EntryUnit, Mapping, ObjectCode
from steptwin.protocol.frame import COB_EMCY, COB_SYNC, COB_TIME
from steptwin.protocol.homing_methods import HOME_HERE, HOMING_METHODS, NO_HOMING
from steptwin.protocol.nmt import ErrorBehaviour


def address_of(index: int, subindex: int = 0) -> int:
    """Return an entry's address from its index and sub-index."""
    return index << 8 | subindex


def index_and_subindex(address: int) -> tuple[int, int]:
    """Return the index and the sub-index of an address."""
    return address >> 8, address & 0xFF


def place_text(address: int) -> str:
    """Format an address for messages and logs, such as 0x607D:01."""
    return f"0x{address >> 8:04X}:{address & 0xFF:02X}"


ROWS: Final[dict[int, Entry]] = {}
"""Entries by address. `objects` adds those of the PDOs and the sub-index counts."""
NAMES: Final[dict[int, tuple[str, ObjectCode]]] = {}
"""Name and object code of each array and record, by index."""

I8, I16, I24, I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER24, DataType.INTEGER32
U8, U16, U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
STRING: Final = DataType.VISIBLE_STRING
RX, TX, RXTX = Mapping.RECEIVE, Mapping.TRANSMIT, Mapping.BOTH
POSITION, VELOCITY, ACCELERATION = EntryUnit.POSITION, EntryUnit.VELOCITY, EntryUnit.ACCELERATION
NS, US, HUNDRED_US, MS = EntryUnit.NS, EntryUnit.US, EntryUnit.HUNDRED_US, EntryUnit.MS
MV, TEN_MV, TENTH_DEGC, PERCENT = EntryUnit.MV, EntryUnit.TEN_MV, EntryUnit.TENTH_DEGC, EntryUnit.PERCENT
STEPS, REVOLUTIONS, RECORDS = EntryUnit.STEPS, EntryUnit.REVOLUTIONS, EntryUnit.RECORDS

UNITS_PER_FULL_STEP: Final = 16_384
"""Wire units in a full step, whatever the microstep setting."""
MICROSTEPS_CHOICES: Final = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128, 256)
"""Microsteps per full step of the known drivers; a board supports all of them."""
FULL_STEPS_PER_REVOLUTION: Final = 200
"""Full steps of a 1.8 degree motor. The board counts motor positions; the host converts by gears and spindles."""
UNITS_PER_REVOLUTION: Final = UNITS_PER_FULL_STEP * FULL_STEPS_PER_REVOLUTION
"""Wire units in a revolution of the motor."""

IDENTITY_DEVICE_TYPE: Final = 0x0004_0192
"""CiA 402 (0x192 = 402), bit 18: stepper motor."""
MICRO_STEP_MOTOR: Final = 9
"""Motor type (6402h): micro-step stepper motor."""
PROFILE_VERSION: Final = 0x0003_0000
"""Profile version (67FEh): CiA 402-2, version 3.0."""
PULSE_NS_MIN: Final = 4_000
TIMING_NS_MAX: Final = 1_000_000
"""Bounds of the step timing (2001h): each CLK phase lasts at least 4 us (125 kHz), and no time exceeds 1 ms."""
SETTLING_US_MAX: Final = 10_000_000
"""Longest settling time from ENABLE until a driver accepts steps: ten seconds."""
CYCLE_MS_MAX: Final = 10
"""Longest period of cyclic synchronous position."""
MILLI: Final = -3
WINDOW_OFF: Final = U32.high
"""The value that switches the following error window (6065h) and the position window (6067h) off."""


def array(index: int, name: str) -> None:
    """Begin an array object: the rows that follow are its entries, all of one type."""
    NAMES[index] = name, ObjectCode.ARRAY


def record(index: int, name: str) -> None:
    """Begin a record object: the rows that follow are its entries, of several types."""
    NAMES[index] = name, ObjectCode.RECORD


def const(
    address: int,
    data_type: DataType,
    title: str,
    value: int | str,
    unit: EntryUnit = EntryUnit.NONE,
    *,
    plus_node_id: bool = False,
) -> int:
    """Add a constant; return its address."""
    ROWS[address] = Entry(title, data_type, Access.CONST, value, plus_node_id=plus_node_id, unit=unit)
    return address


def ro(
    address: int,
    data_type: DataType,
    title: str,
    unit: EntryUnit = EntryUnit.NONE,
    mapping: Mapping = Mapping.NONE,
    *,
    default: int = 0,
    read: str = "",
) -> int:
    """Add a read-only entry; return its address."""
    ROWS[address] = Entry(title, data_type, Access.READ_ONLY, default, mapping=mapping, unit=unit, read=read)
    return address


def wo(
    address: int, data_type: DataType, title: str, low: int | None = None, high: int | None = None, *, write: str
) -> int:
    """Add a write-only entry; return its address."""
    ROWS[address] = Entry(title, data_type, Access.WRITE_ONLY, low=low, high=high, write=write)
    return address


def rw(
    address: int,
    data_type: DataType,
    title: str,
    default: int | str = 0,
    low: int | None = None,
    high: int | None = None,
    *,
    unit: EntryUnit = EntryUnit.NONE,
    mapping: Mapping = Mapping.NONE,
    values: Collection[int] | None = None,
    plus_node_id: bool = False,
    read: str = "",
    write: str = "",
) -> int:
    """Add a readable and writable entry; return its address."""
    ROWS[address] = Entry(
        title, data_type, Access.READ_WRITE, default, low, high, mapping, plus_node_id, unit, values, read, write
    )
    return address


def rate_q16(percent: int) -> int:
    """Convert a time rate in percent to Q16 (65 536 is full rate), rounded up as in the firmware."""
    return -(-percent * 65_536 // 100)


def _rate(address: int, title: str, full_steps: int, unit: EntryUnit, mapping: Mapping = Mapping.NONE) -> int:
    """Add a speed, an acceleration or a jerk, whose default is given in full steps and seconds."""
    return rw(address, U32, title, full_steps * UNITS_PER_FULL_STEP, 1, unit=unit, mapping=mapping)


def _factor(address: int, title: str, default: int = 1, unit: EntryUnit = REVOLUTIONS) -> int:
    """Add one of the factors between wire units and user units."""
    return rw(address, U32, title, default, 1, unit=unit, write="AxisDrive.change_units_at")


def _timing(address: int, title: str, default_ns: int, low_ns: int) -> int:
    """Add a time of the step timing."""
    title = f"{title} in {{unit}}"
    return rw(address, U32, title, default_ns, low_ns, TIMING_NS_MAX, unit=NS, write="DriverSettings.change_at")


def _percent(address: int, title: str, default: int, values: tuple[int, ...]) -> int:
    """Add a setting of the TB6560 in percent; `values` are the ones that its pins can select."""
    return rw(address, U8, title, default, values[0], values[-1], unit=PERCENT, values=values)


# --- communication (CiA 301)

DEVICE_TYPE = const(0x1000_00, U32, "Device type", IDENTITY_DEVICE_TYPE)
ERROR_REGISTER = ro(0x1001_00, U8, "Error register", mapping=TX, read="AxisErrors.register")
array(0x1003, "Pre-defined error field")
# Writing 0 clears the history (CiA 301, section 7.5.2.4).
ERROR_HISTORY_COUNT = rw(
    0x1003_00, U8, "Number of errors", 0, 0, 0, read="AxisErrors.history_length", write="AxisErrors.clear_history"
)
HISTORY_DEPTH: Final = 8
ERROR_HISTORY: Final = tuple(
    ro(0x1003_00 + i, U32, f"Standard error field {i}", read="AxisErrors.history_at")
    for i in range(1, HISTORY_DEPTH + 1)
)
"""The newest error first."""
SYNC_COB_ID = const(0x1005_00, U32, "COB-ID SYNC", COB_SYNC)
COMMUNICATION_CYCLE_PERIOD = rw(0x1006_00, U32, "Communication cycle period in {unit}", unit=US)
DEVICE_NAME = const(0x1008_00, STRING, "Manufacturer device name", "StepTwin stepper axis (SIMULATED)")
HARDWARE_VERSION = const(0x1009_00, STRING, "Manufacturer hardware version", "STM32F103 + STEP/DIR")
# The firmware's own version: RELEASING.md says when it rises. 0x1018:03 has its first two parts.
SOFTWARE_VERSION = const(0x100A_00, STRING, "Manufacturer software version", "1.0.0")
GUARD_TIME = rw(0x100C_00, U16, "Guard time in {unit}", unit=MS, write="AxisNode.restart_guarding")
LIFE_TIME_FACTOR = rw(
    0x100D_00, U8, "Life time factor: the master is lost after so many guard times", write="AxisNode.restart_guarding"
)
_GROUPS: Final = ("all parameters", "communication parameters", "application parameters", "board parameters")
array(0x1010, "Store parameters")
STORES: Final = tuple(
    rw(0x1010_01 + i, U32, f"Save {group}", 1, read="ParameterStorage.ability", write="ParameterStorage.save_at")
    for i, group in enumerate(_GROUPS)
)
STORE_ALL, STORE_COMMUNICATION, STORE_APPLICATION, STORE_BOARD = STORES
array(0x1011, "Restore default parameters")
RESTORES: Final = tuple(
    rw(0x1011_01 + i, U32, f"Restore {group}", 1, read="ParameterStorage.ability", write="ParameterStorage.load_at")
    for i, group in enumerate(_GROUPS)
)
RESTORE_ALL, RESTORE_COMMUNICATION, RESTORE_APPLICATION, RESTORE_BOARD = RESTORES
CONSUMES_TIME: Final = 1 << 31
"""Bit of the COB-ID TIME: the node uses TIME."""
TIME_COB_ID = rw(
    0x1012_00,
    U32,
    "COB-ID TIME: bit 31 is 1 if the node uses it",
    CONSUMES_TIME | COB_TIME,
    values=(COB_TIME, CONSUMES_TIME | COB_TIME),
)
TIME_STAMP = rw(
    0x1013_00,
    U32,
    "High resolution time stamp in {unit}",
    unit=US,
    mapping=RXTX,
    read="AxisNode.time_stamp_us",
    write="AxisNode.set_clock",
)
EMCY_COB_ID = rw(0x1014_00, U32, "COB-ID EMCY", COB_EMCY, plus_node_id=True, write="AxisErrors.check_new_cob_id")
EMCY_INHIBIT_TIME = rw(0x1015_00, U16, "Inhibit time EMCY in {unit}", unit=HUNDRED_US)
array(0x1016, "Consumer heartbeat time")
_CONSUMER: Final = "node id in bits 16 to 23, time in ms in bits 0 to 15"
CONSUMER_HEARTBEATS: Final = tuple(
    rw(0x1016_00 + i, U32, f"Producer {i}: {_CONSUMER}", 0, 0, 0x00FF_FFFF, write="HeartbeatConsumer.watch_at")
    for i in range(1, 5)
)
PRODUCER_HEARTBEAT_TIME = rw(
    0x1017_00, U16, "Producer heartbeat time in {unit}", unit=MS, write="AxisNode.set_heartbeat_period"
)
record(0x1018, "Identity object")
VENDOR_ID = const(0x1018_01, U32, "Vendor-ID", 0)
PRODUCT_CODE = const(0x1018_02, U32, "Product code", 0x6560)
REVISION_NUMBER = const(0x1018_03, U32, "Revision number", 0x0001_0000)
SERIAL_NUMBER = ro(0x1018_04, U32, "Serial number", read="AxisNode.serial_number")
SYNC_COUNTER_OVERFLOW = rw(
    0x1019_00, U8, "Synchronous counter overflow value", low=0, high=240, write="ProcessData.check_sync_overflow"
)
array(0x1020, "Verify configuration")
# A change of any parameter sets both to 0 (CiA 301, section 7.5.2.23).
CONFIGURATION_DATE = rw(0x1020_01, U32, "Configuration date in days since 1984-01-01")
CONFIGURATION_TIME = rw(0x1020_02, U32, "Configuration time in {unit} since midnight", unit=MS)
array(0x1029, "Error behaviour")
COMMUNICATION_ERROR_BEHAVIOUR = rw(0x1029_01, U8, "Communication error", ErrorBehaviour.PRE_OPERATIONAL, 0, 2)
RPDO_COMMUNICATION: Final = (0x1400, 0x1401, 0x1402, 0x1403)
RPDO_MAPPING: Final = (0x1600, 0x1601, 0x1602, 0x1603)
TPDO_COMMUNICATION: Final = (0x1800, 0x1801, 0x1802, 0x1803)
TPDO_MAPPING: Final = (0x1A00, 0x1A01, 0x1A02, 0x1A03)
"""The indexes of the PDO parameters, PDO1 to PDO4; the sub-indexes are the same for each."""
PDO_COB_ID: Final = 1
PDO_TRANSMISSION_TYPE: Final = 2
PDO_INHIBIT_TIME: Final = 3
PDO_EVENT_TIMER: Final = 5
PDO_SYNC_START: Final = 6

# --- this board

record(0x2000, "TB6560 settings")
MICROSTEPS = rw(0x2000_01, U8, "Microsteps per full step", 16, 1, 128, write="DriverSettings.change_at")
TORQUE_PERCENT = _percent(0x2000_02, "Torque in {unit} of the full current", 100, (20, 50, 75, 100))
FAST_DECAY_PERCENT = _percent(0x2000_03, "Fast decay in {unit} of a chopping period", 0, (0, 25, 50, 100))
REST_TORQUE_PERCENT = _percent(0x2000_04, "Torque at rest in {unit} of the full current", 100, (20, 50, 75, 100))
MICROSTEPS_WORD = rw(
    0x2000_05,
    U16,
    "Microsteps per full step in a word: 0x2000:01 shows 255 for 256",
    16,
    1,
    256,
    read="DriverSettings.microsteps",
    write="DriverSettings.change_at",
)
record(0x2001, "Step timing")
STEPLEN_NS = _timing(0x2001_01, "steplen: CLK high", 33_000, PULSE_NS_MIN)
STEPSPACE_NS = _timing(0x2001_02, "stepspace: CLK low", 33_666, PULSE_NS_MIN)
DIRSETUP_NS = _timing(0x2001_03, "dirsetup: DIR stable before a CLK rise", 15_000, 0)
DIRHOLD_NS = _timing(0x2001_04, "dirhold: DIR stable after a CLK rise", 15_000, 0)
INVERT_MASK = rw(0x2001_05, U8, "Invert mask: 2 inverts DIR", 0, 0, 2, write="DriverSettings.change_at")
SETTLING_US = rw(
    0x2001_06, U32, "settling: OPERATION ENABLED so long after ENABLE in {unit}", 0, 0, SETTLING_US_MAX, unit=US
)
record(0x2002, "Board measurements and their limits")
BOARD_TEMPERATURE = ro(
    0x2002_01, I16, "Board temperature in {unit}", TENTH_DEGC, TX, read="BoardReadings.temperature_decidegc"
)
SUPPLY_VOLTAGE = ro(0x2002_02, U16, "Motor supply in {unit}", TEN_MV, TX, read="BoardReadings.supply_10mv")
SUPPLY_VOLTAGE_MIN = rw(0x2002_03, U16, "Least motor supply in {unit}", 1000, unit=TEN_MV)
SUPPLY_VOLTAGE_MAX = rw(
    0x2002_04, U16, "Highest motor supply in {unit}: 34 V, TB6560AHQ datasheet page 8", 3400, unit=TEN_MV
)
BOARD_TEMPERATURE_MAX = rw(0x2002_05, I16, "Highest board temperature in {unit}", 850, unit=TENTH_DEGC)
record(0x2010, "Interpolation group")
GROUP_STOP = rw(0x2010_01, U8, "Group stop: a fault stops all interpolating axes", 1, 0, 1)
QUEUE_LOW_WATER = rw(0x2010_02, U8, "Low-water mark of the queue in {unit}", 16, 0, 64, unit=RECORDS)
FULL_RATE_Q16: Final = 1 << 16
"""Time rate at which an interpolation group runs in real time."""
RATE_PERCENT_MIN: Final = 10
RATE_PERCENT_MAX: Final = 150
"""Bounds of the time rate that a host may request, in percent of full rate."""
RATE_MIN_Q16: Final = rate_q16(RATE_PERCENT_MIN)
RATE_MAX_Q16: Final = rate_q16(RATE_PERCENT_MAX)
GROUP_RATE_Q16 = rw(
    0x2010_03,
    U32,
    "Rate wanted of the group's time: 65 536 is full rate",
    FULL_RATE_Q16,
    RATE_MIN_Q16,
    RATE_MAX_Q16,
    read="Interpolation.wanted_rate",
    write="Interpolation.want_rate",
)
GROUP_RATE_NOW_Q16 = ro(
    0x2010_04, U32, "Present rate of the group's time", default=FULL_RATE_Q16, read="Interpolation.present_rate"
)
GROUP_RATE_HIGHEST_Q16 = rw(
    0x2010_05,
    U32,
    "Highest rate that the axis' records allow; buffer clear sets full rate",
    FULL_RATE_Q16,
    FULL_RATE_Q16,
    RATE_MAX_Q16,
    read="Interpolation.highest_rate",
    write="Interpolation.allow_rate",
)
BOARD_AXES = ro(0x2010_06, U8, "Number of axes on the board", read="AxisMotion.board_axes")
# CiA 402's place of this set-point is 60C1h:01, where this board has the displacement of a PVT record.
INTERPOLATION_SET_POINT = rw(
    0x2011_00,
    I32,
    "Set-point of linear interpolation, if 0x60C0 is 0",
    unit=POSITION,
    mapping=RX,
    write="CyclicPosition.note_set_point_at",
)
record(0x2012, "PVT status")
PVT_NEXT_SEQUENCE = ro(0x2012_01, U8, "Next sequence number", mapping=TX, read="Interpolation.next_sequence")
PVT_FREE_RECORDS = ro(0x2012_02, U8, "Free records", RECORDS, TX, read="Interpolation.free_records")
PVT_FLAGS = ro(0x2012_03, U8, "Flags", mapping=TX, read="Interpolation.flags")
PVT_EXECUTING_SEQUENCE = ro(
    0x2012_04, U8, "Executing sequence number", mapping=TX, read="Interpolation.executing_sequence"
)
BOARD_CLOCK_US = ro(0x2012_05, U32, "Board clock in {unit}", US, TX, read="AxisNode.board_clock_us")
record(0x2013, "PVT counters")
PVT_ACCEPTED = ro(0x2013_01, U32, "Records accepted", RECORDS)
PVT_GAPS = ro(0x2013_02, U16, "Gaps")
PVT_OVERFLOWS = ro(0x2013_03, U16, "Overflows")
PVT_UNDERRUNS = ro(0x2013_04, U16, "Underruns")
PVT_LEAST_FILL = ro(0x2013_05, U8, "Least fill while running", RECORDS)
DELAYED_STEPS = ro(0x2013_06, U32, "Delayed steps", STEPS, read="AxisMotion.delayed_steps")
record(0x2014, "Transmission counters")
FRAMES_LOST = ro(0x2014_01, U32, "Frames lost because the bus was too busy")
EMCYS_LOST = ro(0x2014_02, U32, "Emergencies lost because too many waited", read="AxisErrors.lost")
RPDO_VALUES_REFUSED = ro(0x2014_03, U32, "Values of RPDOs refused")
RPDO_LAST_REFUSED = ro(0x2014_04, U32, "Entry of the last of them, as a mapping names it")
EMERGENCY_STOP = rw(
    0x2015_00,
    U8,
    "Emergency stop: 1 stops the axis until the fault reset",
    0,
    0,
    1,
    read="AxisDrive.emergency_stopped",
    write="AxisDrive.stop_at_once",
)
record(0x2016, "Robot")
ROBOT_NAME = rw(0x2016_01, STRING, "Name of the robot that this axis belongs to", "")
ROBOT_NAME_CRC = ro(0x2016_02, U32, "CRC-32 of the name", read="AxisNode.robot_name_crc")
record(0x2017, "Program in charge")
CHARGE_TOKEN = rw(
    0x2017_01,
    U32,
    "Token: claims the axis for a program; 0: none is in charge",
    read="Charge.token",
    write="Charge.claim",
)
CHARGE_RELEASE = wo(0x2017_02, U32, "Release: takes the token of the program in charge", write="Charge.release")
CHARGE_FREE: Final = 0
"""Token while no program is in charge.

A program that does not use the object can still drive the axis: the token only coordinates programs that use it.
"""
CHARGE_UNWATCHED_MS: Final = 1000
"""Time after which a node that monitors no heartbeat releases the program in charge."""
record(0x2018, "Faults and emergency stops")
FAULT_NUMBER = ro(
    0x2018_01, U32, "Number of the last fault or emergency stop since power-up; 0: none", read="AxisDrive.fault_number"
)
FAULT_AGE_MS = ro(
    0x2018_02, U32, "Age of the last fault or emergency stop in {unit}", MS, read="AxisDrive.fault_age_ms"
)
FAULT_RESET = wo(
    0x2018_03,
    U32,
    "Fault reset: the number of the fault or emergency stop that it answers",
    write="AxisDrive.reset_numbered_fault",
)
record(0x2019, "Time of day by TIME; 0: none has come")
TIME_DAYS = ro(0x2019_01, U16, "Days since 1984-01-01", read="TimeOfDay.days")
TIME_MS = ro(0x2019_02, U32, "Time in {unit} since midnight", MS, read="TimeOfDay.ms")
record(0x2020, "Homing")
HOMING_TIMEOUT_MS = rw(0x2020_01, U32, "Timeout in {unit}; 0: none", 120_000, unit=MS)
HOMING_ERROR = ro(0x2020_02, U8, "Why the last homing has failed")
HOMING_SWITCH_NODE = rw(
    0x2020_03,
    U8,
    "Next homing: node of the board at whose inputs its switches are; 0: the own",
    write="Homing.check_switch_node",
)
HOMING_REVERSED = rw(
    0x2020_04, U8, "Next homing: 1 if the axis moves down where the switches are passed upwards", 0, 0, 1
)
HOMING_PARTIAL = rw(0x2020_05, U8, "Next homing: 1 if the position stays unknown, since it needs another one", 0, 0, 1)

# --- the emulator, which no real board has

record(0x2F00, "Emulator only: what the driver has made of the pulses since power-up")
ROTOR_POSITION_STEPS = ro(0x2F00_01, I32, "Driver's count in {unit}", STEPS, TX, read="EmulatedAxis.count_at")
LOST_STEPS = ro(0x2F00_02, I32, "Lost steps", STEPS, TX, read="EmulatedAxis.count_at")
DRIVER_VIOLATIONS = ro(0x2F00_03, U32, "Driver violations", mapping=TX, read="EmulatedAxis.count_at")
DRIVER_MICROSTEPS = ro(
    0x2F00_04, U16, "Microsteps per full step that the driver makes", mapping=TX, read="EmulatedAxis.count_at"
)
SHAFT_POSITION = ro(0x2F00_05, I32, "True position of the rotor in {unit}", POSITION, TX, read="EmulatedAxis.rotor_at")
SLIPPED_FULL_STEPS = ro(
    0x2F00_06, I32, "Full steps by which the rotor has slipped", mapping=TX, read="EmulatedAxis.rotor_at"
)

# --- the drive (CiA 402-2)

ABORT_CONNECTION_OPTION = rw(0x6007_00, I16, "Abort connection option code", AbortConnection.FAULT_SIGNAL, 0, 3)
ERROR_CODE = ro(0x603F_00, U16, "Error code", mapping=TX)
CONTROLWORD = rw(0x6040_00, U16, "Controlword", mapping=RX, write="AxisDrive.obey_controlword")
STATUSWORD = ro(0x6041_00, U16, "Statusword", mapping=TX, read="AxisNode.statusword")
QUICK_STOP_OPTION = rw(0x605A_00, I16, "Quick stop option code", 2, 0, 6, values=(0, 1, 2, 5, 6))
# CiA 402's own default is 0, which cuts the current: a vertical axis would fall.
SHUTDOWN_OPTION = rw(0x605B_00, I16, "Shutdown option code", 1, 0, 1)
DISABLE_OPERATION_OPTION = rw(0x605C_00, I16, "Disable operation option code", 1, 0, 1)
HALT_OPTION = rw(0x605D_00, I16, "Halt option code", 1, 1, 2)
FAULT_REACTION_OPTION = rw(0x605E_00, I16, "Fault reaction option code", 2, 0, 2)
MODE_OF_OPERATION = rw(
    0x6060_00, I8, "Modes of operation", Mode.NONE, mapping=RX, values=tuple(Mode), write="AxisDrive.select_mode"
)
MODE_OF_OPERATION_DISPLAY = ro(0x6061_00, I8, "Modes of operation display", mapping=TX, read="AxisDrive.mode_number")
POSITION_DEMAND = ro(0x6062_00, I32, "Position demand value", POSITION, TX, read="AxisMotion.demand_units")
POSITION_ACTUAL = ro(0x6064_00, I32, "Position actual value", POSITION, TX, read="AxisMotion.counter_units")
FOLLOWING_ERROR_WINDOW = rw(
    0x6065_00, U32, "Following error window in {unit}; all ones: off", WINDOW_OFF, unit=POSITION
)
FOLLOWING_ERROR_TIMEOUT_MS = rw(0x6066_00, U16, "Following error time out in {unit}", 0, unit=MS)
POSITION_WINDOW = rw(0x6067_00, U32, "Position window in {unit}; all ones: off", WINDOW_OFF, unit=POSITION)
POSITION_WINDOW_TIME_MS = rw(0x6068_00, U16, "Position window time in {unit}", 0, unit=MS)
VELOCITY_ACTUAL = ro(0x606C_00, I32, "Velocity actual value", VELOCITY, TX, read="AxisMotion.velocity_units_per_s")
DC_LINK_VOLTAGE = ro(0x6079_00, U32, "DC link circuit voltage in {unit}", MV, TX, read="BoardReadings.supply_mv")
TARGET_POSITION = rw(
    0x607A_00, I32, "Target position", unit=POSITION, mapping=RXTX, write="CyclicPosition.note_set_point_at"
)
array(0x607B, "Position range limit")
POSITION_RANGE_MIN = rw(
    0x607B_01, I32, "Min position range limit in {unit}", I32.low, unit=POSITION, write="Positioning.check_low"
)
POSITION_RANGE_MAX = rw(
    0x607B_02, I32, "Max position range limit in {unit}", I32.high, unit=POSITION, write="Positioning.check_high"
)
HOME_OFFSET = rw(0x607C_00, I32, "Home offset", unit=POSITION)
array(0x607D, "Software position limit")
POSITION_LIMIT_MIN = rw(
    0x607D_01, I32, "Min position limit in {unit}", I32.low, unit=POSITION, write="SoftLimits.check_low"
)
POSITION_LIMIT_MAX = rw(
    0x607D_02, I32, "Max position limit in {unit}", I32.high, unit=POSITION, write="SoftLimits.check_high"
)
POLARITY = rw(0x607E_00, U8, "Polarity: 0xC0 reverses the axis", 0, 0, 0xC0, write="DriverSettings.change_at")
MAX_PROFILE_VELOCITY = rw(
    0x607F_00,
    U32,
    "Max profile velocity",
    8_000 * UNITS_PER_FULL_STEP,
    1,
    unit=VELOCITY,
    mapping=RX,
    write="DriverSettings.change_at",
)
PROFILE_VELOCITY = _rate(0x6081_00, "Profile velocity", 1_000, VELOCITY, RX)
END_VELOCITY = rw(0x6082_00, U32, "End velocity", unit=VELOCITY, mapping=RX)
PROFILE_ACCELERATION = _rate(0x6083_00, "Profile acceleration", 5_000, ACCELERATION, RX)
PROFILE_DECELERATION = _rate(0x6084_00, "Profile deceleration", 5_000, ACCELERATION, RX)
QUICK_STOP_DECELERATION = _rate(0x6085_00, "Quick stop deceleration", 20_000, ACCELERATION)
MOTION_PROFILE_TYPE = rw(
    0x6086_00, I16, "Motion profile type: 0 linear ramp, 3 jerk-limited ramp", LINEAR_RAMP, 0, 3, values=RAMPS
)
array(0x608F, "Position encoder resolution")
ENCODER_UNITS = const(0x608F_01, U32, "Units", UNITS_PER_REVOLUTION, POSITION)
ENCODER_MOTOR_REVOLUTIONS = const(0x608F_02, U32, "Motor revolutions", 1, REVOLUTIONS)
array(0x6091, "Gear ratio")
GEAR_MOTOR_REVOLUTIONS = _factor(0x6091_01, "Motor revolutions")
GEAR_SHAFT_REVOLUTIONS = _factor(0x6091_02, "Shaft revolutions")
array(0x6092, "Feed constant")
FEED_UNITS = _factor(0x6092_01, "Feed in {unit}", UNITS_PER_REVOLUTION, POSITION)
FEED_SHAFT_REVOLUTIONS = _factor(0x6092_02, "Shaft revolutions")
HOMING_METHOD = rw(
    0x6098_00,
    I8,
    "Homing method: 0 for none",
    HOME_HERE,
    NO_HOMING,
    max(HOMING_METHODS),
    values=(NO_HOMING, *HOMING_METHODS),
)
array(0x6099, "Homing speeds")
HOMING_SEARCH_SPEED = _rate(0x6099_01, "Speed during search for switch", 500, VELOCITY)
HOMING_ZERO_SPEED = _rate(0x6099_02, "Speed during search for zero", 50, VELOCITY)
HOMING_ACCELERATION = _rate(0x609A_00, "Homing acceleration", 2_000, ACCELERATION)
array(0x60A4, "Profile jerk")
PROFILE_JERK = _rate(0x60A4_01, "Profile jerk 1 in {unit}", 100_000, EntryUnit.JERK)
SI_UNIT_POSITION = rw(
    0x60A8_00,
    U32,
    "SI unit position: power of ten in bits 24 to 31, unit in bits 16 to 23",
    INCREMENTS << 16,
    values=frozenset((prefix & 0xFF) << 24 | unit << 16 for prefix in SI_PREFIXES for unit in SI_UNITS),
    write="AxisDrive.change_units_at",
)
TOUCH_PROBE_FUNCTION = rw(
    0x60B8_00,
    U16,
    "Touch probe function: probe 1, IN1, in the low byte, probe 2, IN2, in the high byte",
    mapping=RX,
    write="TouchProbes.obey_function",
)
TOUCH_PROBE_STATUS = ro(0x60B9_00, U16, "Touch probe status", mapping=TX)
TOUCH_PROBE_1_RISING = ro(0x60BA_00, I32, "Touch probe 1 positive edge", POSITION, TX)
TOUCH_PROBE_1_FALLING = ro(0x60BB_00, I32, "Touch probe 1 negative edge", POSITION, TX)
TOUCH_PROBE_2_RISING = ro(0x60BC_00, I32, "Touch probe 2 positive edge", POSITION, TX)
TOUCH_PROBE_2_FALLING = ro(0x60BD_00, I32, "Touch probe 2 negative edge", POSITION, TX)
INTERPOLATION_SUBMODE = rw(
    0x60C0_00,
    I16,
    "Interpolation sub mode select: -1 PVT records, 0 the set-points of 0x2011",
    PVT_SUBMODE,
    PVT_SUBMODE,
    LINEAR_SUBMODE,
    write="AxisDrive.select_submode",
)
record(0x60C1, "Interpolation data record (PVT)")
PVT_DISPLACEMENT = rw(0x60C1_01, I24, "Displacement in {unit}", unit=POSITION, mapping=RX)
PVT_END_VELOCITY = rw(0x60C1_02, I24, "End velocity in {unit}", unit=EntryUnit.PVT_VELOCITY, mapping=RX)
PVT_DURATION_MS = rw(0x60C1_03, U8, "Duration in {unit}", unit=MS, mapping=RX)
PVT_SEQUENCE = rw(
    0x60C1_04, U8, "Sequence number: writing it queues the record", mapping=RX, write="Interpolation.take_record"
)
record(0x60C2, "Interpolation time period")
# A period of value 10^index seconds. At 1 ms, CiA 402's default, eight axes would fill a bus of 1 Mbit/s.
INTERPOLATION_PERIOD = rw(
    0x60C2_01,
    U8,
    "Interpolation time period value",
    CYCLE_MS_MAX,
    1,
    CYCLE_MS_MAX,
    unit=MS,
    write="CyclicPosition.check_period",
)
INTERPOLATION_PERIOD_EXPONENT = rw(0x60C2_02, I8, "Interpolation time index: -3 is ms", MILLI, MILLI, MILLI)
record(0x60C4, "Interpolation data configuration")
BUFFER_SIZE_MAX = ro(0x60C4_01, U32, "Maximum buffer size in {unit}", RECORDS, default=64)
BUFFER_SIZE = ro(0x60C4_02, U32, "Actual buffer size in {unit}", RECORDS, default=64)
BUFFER_ORGANIZATION = ro(0x60C4_03, U8, "Buffer organization: 0 is FIFO")
BUFFER_POSITION = ro(0x60C4_04, U16, "Buffer position in {unit}", RECORDS, read="AxisMotion.queued")
BUFFER_RECORD_BYTES = ro(0x60C4_05, U8, "Size of data record in {unit}", EntryUnit.BYTES, default=8)
BUFFER_CLEAR = wo(0x60C4_06, U8, "Buffer clear: 0 clears", 0, 1, write="Interpolation.clear")
MAX_ACCELERATION = rw(0x60C5_00, U32, "Max acceleration", U32.high, 1, unit=ACCELERATION)
MAX_DECELERATION = rw(0x60C6_00, U32, "Max deceleration", U32.high, 1, unit=ACCELERATION)
array(0x60E3, "Supported homing methods")
SUPPORTED_HOMING_METHODS: Final = tuple(
    const(0x60E3_00 + i, I8, f"Supported homing method {i}", method) for i, method in enumerate(HOMING_METHODS, start=1)
)
_RELATIVES: Final = (0, 1, 2)
_DIRECTIONS: Final = (0x00, 0x40, 0x80, 0xC0)
POSITIONING_OPTION = rw(
    0x60F2_00,
    U16,
    "Positioning option code: bits 1 and 0 what a relative target counts from, bits 7 and 6 the direction",
    values=frozenset(relative | direction for relative in _RELATIVES for direction in _DIRECTIONS),
)
FOLLOWING_ERROR_ACTUAL = ro(
    0x60F4_00, I32, "Following error actual value", POSITION, TX, read="PositionReference.following_error_units"
)
POSITION_DEMAND_STEPS = ro(
    0x60FC_00, I32, "Position demand internal value in {unit}", STEPS, TX, read="AxisMotion.demand_steps"
)
DIGITAL_INPUTS = ro(0x60FD_00, U32, "Digital inputs", mapping=TX, read="Supervision.inputs")
array(0x60FE, "Digital outputs")
# Bits without an output are stored and do nothing, as in CiA 402 drives: one word may serve different drives, and a PDO
# with such a bit is not lost. The mask enables both outputs by default, so that a plain write of sub-index 1 switches
# them. (In many drives its default is 0.)
DIGITAL_OUTPUTS = rw(0x60FE_01, U32, "Physical outputs", mapping=RX, write="AxisNode.switch_outputs_at")
DIGITAL_OUTPUTS_MASK = rw(
    0x60FE_02,
    U32,
    "Bit mask: an output whose bit is 0 is off",
    DigitalOutput.OUT1 | DigitalOutput.OUT2,
    write="AxisNode.switch_outputs_at",
)
TARGET_VELOCITY = rw(
    0x60FF_00, I32, "Target velocity", unit=VELOCITY, mapping=RX, write="ProfileVelocity.follow_target"
)
MOTOR_TYPE = const(0x6402_00, U16, "Motor type: 9 is a micro-step stepper motor", MICRO_STEP_MOTOR)
SUPPORTED_DRIVE_MODES = const(0x6502_00, U32, "Supported drive modes", sum(mode.supported_bit for mode in Mode))
VERSION_NUMBER = const(0x67FE_00, U32, "Version number of the profile: major in bits 16 to 23", PROFILE_VERSION)
