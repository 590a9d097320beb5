"""States, modes, control bits, status bits and error codes of CiA 402 (IEC 61800-7-201), shared by drive and master."""

from enum import Enum, IntEnum, IntFlag
from functools import cache
from typing import Final


class State(Enum):
    """State of a drive; the value is its statusword pattern (mask, bits) of CiA 402, table 30."""

    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)

    def __init__(self, mask: int, bits: int) -> None:
        self.mask = mask
        """Statusword bits that identify the state."""
        self.bits = bits
        """Values of these bits in the state."""

    @classmethod
    @cache
    def of(cls, statusword: int) -> "State":
        """Return the state of a statusword; raise ValueError if it matches none."""
        for state in cls:
            if statusword & state.mask == state.bits:
                return state
        raise ValueError(f"statusword 0x{statusword:04X} shows no state of CiA 402")


class Control(IntEnum):
    """Bits of the controlword (6040h); combined bits are plain integers."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2
    """Active low: 0 commands a quick stop."""
    ENABLE_OPERATION = 1 << 3
    START = 1 << 4
    """Homing: start; interpolated position: enable; profile position: new set-point."""
    CHANGE_AT_ONCE = 1 << 5
    """Profile position: change to the new set-point at once, before the present one is reached."""
    RELATIVE = 1 << 6
    """Profile position: the target is relative to the previous target."""
    FAULT_RESET = 1 << 7
    HALT = 1 << 8
    CHANGE_ON_SET_POINT = 1 << 9
    """Profile position: pass the present target at the profile velocity, then move to the new set-point."""


SHUTDOWN = 0x06
SWITCH_ON = 0x07
ENABLE_OPERATION = 0x0F
DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
"""Controlwords of the commands that CiA 402 names."""


class Status(IntEnum):
    """Bits of the statusword (6041h) that are not part of the state; combined bits are plain integers."""

    VOLTAGE_ENABLED = 1 << 4
    WARNING = 1 << 7
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    HOMING_ATTAINED = 1 << 12
    SET_POINT_ACKNOWLEDGED = 1 << 12
    ZERO_SPEED = 1 << 12
    IP_ACTIVE = 1 << 12
    FOLLOWS_COMMAND = 1 << 12
    HOMING_ERROR = 1 << 13
    FOLLOWING_ERROR = 1 << 13
    POSITION_KNOWN = 1 << 14
    """Manufacturer-specific: set by homing, cleared if the drive is disabled while the axis moves."""


class Mode(IntEnum):
    """Values of modes of operation (6060h) and of its display (6061h)."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8
    CYCLIC_SYNCHRONOUS_VELOCITY = 9

    @property
    def supported_bit(self) -> int:
        """The mode's bit in the supported drive modes (6502h)."""
        return 1 << (self - 1) if self else 0


class DigitalInput(IntFlag):
    """Bits of the digital inputs (60FDh, CiA 402-2), set while active; bits 16 and up are manufacturer-specific."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2
    ESTOP = 1 << 16
    DRIVER_PROTECT = 1 << 17
    """The driver chip is in thermal shutdown."""
    IN1 = 1 << 18
    IN2 = 1 << 19
    """IN1 and IN2 are at the axis' connector. The drive only reports them to the host."""
    DRIVER_FAULT = 1 << 20
    """The fault output of a driver that is wired to the board reports a shutdown."""
    TORQUE_OFF = 1 << 21
    """Safe torque off (STO) is requested: the drivers get no pulses and no ENABLE."""


SWITCH_INPUTS = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME
"""Inputs of the limit and home switches."""

GENERAL_INPUTS = DigitalInput.IN1, DigitalInput.IN2
"""Inputs of a user's sensors, in the order of their numbers."""


class DigitalOutput(IntFlag):
    """Bits of the digital outputs (60FEh:01) and of their mask (:02): OUT1 and OUT2 at the axis' connector.

    In CiA 402-2 bits 16 to 31 are manufacturer-specific. Bit 0 is a brake, which this board does not have.
    """

    OUT1 = 1 << 16
    OUT2 = 1 << 17


class TouchProbeBit(IntEnum):
    """Bits of one probe in the touch probe function (60B8h) and status (60B9h), CiA 402-2; _STORED: status only."""

    ON = 1 << 0
    """In function and status."""
    CONTINUOUS = 1 << 1
    RISING = 1 << 4
    FALLING = 1 << 5
    RISING_STORED = 1 << 1
    FALLING_STORED = 1 << 2


class AbortConnection(IntEnum):
    """Reaction to a lost connection: abort connection option code (6007h, CiA 402 table 41)."""

    NO_ACTION = 0
    FAULT_SIGNAL = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


LINEAR_SUBMODE = 0
"""Interpolation sub mode (60C0h) of set-points at each SYNC, connected linearly."""
PVT_SUBMODE = -1
"""Interpolation sub mode (60C0h) of position-velocity-time records; negative values are manufacturer-specific."""


class HomingError(IntEnum):
    """Reason of a failed homing: object 2020h:02, and the detail of EMCY FF05h."""

    NONE = 0
    NOT_FOUND = 1
    """The search reached the end of travel, or both ends if the method reverses, and met no switch."""
    STUCK = 2
    """The switch was found, but did not open or close again before the axis reached a limit switch."""
    WRONG_SWITCH = 3
    """The limit switch behind the axis has closed."""
    TIMEOUT = 4
    """The homing took longer than its timeout (2020h:01)."""
    NO_SPEED = 5
    """The axis' speed limit is too low for any motion."""


class Overrun(IntEnum):
    """Full buffer that has lost CAN frames: the detail of EMCY 8110h."""

    RECEIVE_FIFO = 0
    """Receive FIFO of the CAN controller."""
    TRANSMIT_QUEUE = 1
    """Transmit queue of the CAN driver: the bus is too busy."""
    EMCY_QUEUE = 2
    """Emergency queue of the node: errors occur faster than the inhibit time EMCY (1015h) lets frames go."""


LINEAR_RAMP = 0
JERK_LIMITED_RAMP = 3
RAMPS = LINEAR_RAMP, JERK_LIMITED_RAMP
"""Motion profile types (6086h) of this drive; CiA 402's sin^2 and jerk-free ramps are not offered."""


class ErrorCode(IntEnum):
    """Error codes of object 603Fh and of EMCY (CiA 402 table 25, CiA 301 table 26; FFxxh is manufacturer-specific)."""

    NONE = 0x0000
    OVERVOLTAGE = 0x3210
    UNDERVOLTAGE = 0x3220
    TEMPERATURE = 0x4310
    """Detail 0: the board is too hot; 1: the driver chip is in thermal shutdown."""
    OUTPUT_STAGE = 0x5410
    """A driver's fault output is active: short circuit, overcurrent, overtemperature or overvoltage."""
    PARAMETER = 0x6320
    COMMUNICATION = 0x8100
    """"Communication, generic" of CiA 301: the master has stopped or reset the node. The detail is the NmtCommand."""
    CAN_OVERRUN = 0x8110
    """"CAN overrun (objects lost)" of CiA 301. The detail is an Overrun."""
    CAN_ERROR_PASSIVE = 0x8120
    HEARTBEAT_LOST = 0x8130
    CAN_BUS_OFF_RECOVERED = 0x8140
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    SYNC_LENGTH = 0x8240
    RPDO_TIMEOUT = 0x8250
    """The event timer of an RPDO (1400h:05) has timed out. The detail is the RPDO's number."""
    OVERSPEED = 0x8400
    FOLLOWING_ERROR = 0x8611
    LIMIT_SWITCH = 0x8612
    """"Reference limit" of CiA 402. Detail 0: negative limit switch; 1: positive limit switch."""
    SYNC_CONTROLLER = 0x8700
    """In cyclic synchronous position, too many SYNCs (detail 0) or set-points (detail 1) were late or missing."""
    ESTOP = 0x9000
    """"External error" of CiA 301."""
    PVT_UNDERRUN = 0xFF01
    GROUP_STOPPED = 0xFF02
    """Another axis of the group has a fault, and this axis stopped with it."""
    SEGMENT_REFUSED = 0xFF03
    LATE_STEP = 0xFF04
    """The driver's timing has delayed a step by more than one servo tick."""
    HOMING_FAILED = 0xFF05
    """Not a fault: the axis stops and stays enabled. The detail is a HomingError."""
    TORQUE_OFF = 0xFF06
    """Not a fault: safe torque off is requested, and the drive is in SWITCH ON DISABLED until the request ends."""

    @property
    def communication(self) -> bool:
        """True for a bus error. Most of them end when their cause ends, not by a fault reset."""
        return self >> 8 in (0x81, 0x82)

    @property
    def lost_connection(self) -> bool:
        """True for a lost connection; it is a fault if the abort connection option code (6007h) is 1."""
        return self in _LOST_CONNECTION

    @property
    def register(self) -> int:
        """Bits that the error sets in the error register (1001h, CiA 301 table 48); bit 0 is always set."""
        if self == ErrorCode.NONE:
            return 0
        return 0x01 | (0x10 if self.communication else _REGISTER_BITS[self >> 12])


_LOST_CONNECTION = frozenset(
    (ErrorCode.COMMUNICATION, ErrorCode.HEARTBEAT_LOST, ErrorCode.CAN_BUS_OFF_RECOVERED, ErrorCode.RPDO_TIMEOUT)
)
_REGISTER_BITS = {0x3: 0x04, 0x4: 0x08, 0x5: 0x00, 0x6: 0x20, 0x8: 0x20, 0x9: 0x00, 0xF: 0x80}
"""Register bits by the code's first hexadecimal digit: voltage, temperature, profile (6, 8), manufacturer (F)."""


SI_PREFIXES: Final = range(-9, 4)
"""Allowed powers of ten in the SI unit of positions (60A8h): nano to kilo."""
INCREMENTS: Final = 0xB5
"""Unit of 60A8h: increments of a position encoder, which are wire units here."""
SI_UNITS: Final = {0x00: "no unit", 0x01: "m", 0x10: "rad", 0x41: "deg", 0xB4: "revolutions", INCREMENTS: "increments"}
"""Allowed units of 60A8h by their notation index: CiA 303-2; the last two are those of drives."""
