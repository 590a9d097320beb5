"""States, modes, control bits, status bits and error codes of CiA 402 (IEC 61800-7-201), shared by drive and master."""

from enum import Enum, IntEnum, IntFlag
from functools import cache
from typing import Final


class State(Enum):
    """A drive's state; the value is its statusword pattern as (mask, bits), CiA 402 table 30."""

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
        """Bits of the statusword that tell this state from the others."""
        self.bits = bits
        """Values of these bits in this state."""

    @classmethod
    @cache
    def of(cls, statusword: int) -> "State":
        """Return the state that a statusword shows; raise ValueError if it shows none."""
        for state in cls:
            if statusword & state.mask == state.bits:
                return state
        raise ValueError(f"statusword 0x{statusword:04X} shows no state of CiA 402")


class Control(IntEnum):
    """Bits of the controlword (6040h); combined bits are plain integers."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2
    """Active low: the bit is cleared to command a quick stop."""
    ENABLE_OPERATION = 1 << 3
    START = 1 << 4
    """Homing: start; interpolated position: enable; profile position: new set-point."""
    CHANGE_AT_ONCE = 1 << 5
    """Profile position: take the new set-point at once, without waiting until the present one is reached."""
    RELATIVE = 1 << 6
    """Profile position: the target is relative to the target before it."""
    FAULT_RESET = 1 << 7
    HALT = 1 << 8
    CHANGE_ON_SET_POINT = 1 << 9
    """Profile position: pass the present target at the profile velocity on the way to the new set-point."""


SHUTDOWN = 0x06
SWITCH_ON = 0x07
ENABLE_OPERATION = 0x0F
DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
"""Controlwords of the commands that CiA 402 names."""


class Status(IntEnum):
    """Bits of the statusword (6041h) beside those of the state; combined bits are plain integers."""

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
    """Manufacturer-specific: set from homing on, until the drive is disabled while the axis moves."""


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
        """The mode's bit in supported drive modes (6502h)."""
        return 1 << (self - 1) if self else 0


class DigitalInput(IntFlag):
    """Bits of the digital inputs (60FDh, CiA 402-2), set while the input is active; from bit 16 on manufacturer's."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2
    ESTOP = 1 << 16
    DRIVER_PROTECT = 1 << 17
    """Set while the driver chip is switched off by its thermal shutdown."""
    IN1 = 1 << 18
    IN2 = 1 << 19
    """IN1 and IN2 at the axis' connector: the drive only reports them, they are for the host's programs."""
    DRIVER_FAULT = 1 << 20
    """Set while the fault output of a driver that is wired to the board tells that it has switched itself off."""


SWITCH_INPUTS = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME
"""The inputs for the switches along an axis."""

GENERAL_INPUTS = DigitalInput.IN1, DigitalInput.IN2
"""The inputs for a user's sensors, in the order of their numbers."""


class DigitalOutput(IntFlag):
    """Bits of the digital outputs (60FEh:01) and of their mask (:02): OUT1 and OUT2 at the axis' connector.

    CiA 402-2 leaves bits 16 to 31 to the manufacturer; bit 0 would be a brake, which this board does not have.
    """

    OUT1 = 1 << 16
    OUT2 = 1 << 17


class TouchProbeBit(IntEnum):
    """Bits of a probe's byte in the touch probe function (60B8h) and, _STORED, in its status (60B9h, CiA 402-2)."""

    ON = 1 << 0
    """In both words."""
    CONTINUOUS = 1 << 1
    RISING = 1 << 4
    FALLING = 1 << 5
    RISING_STORED = 1 << 1
    FALLING_STORED = 1 << 2


class AbortConnection(IntEnum):
    """Reactions of a drive to a lost connection: abort connection option code (6007h, CiA 402 table 41)."""

    NO_ACTION = 0
    FAULT_SIGNAL = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


PVT_SUBMODE = -1
"""Interpolation sub mode (60C0h) of position-velocity-time records; negative values are manufacturer-specific."""


class HomingError(IntEnum):
    """Reason why a homing has failed: object 2020h:02, and the detail of EMCY FF05h."""

    NONE = 0
    NOT_FOUND = 1
    """The search reached the end of travel, or both ends if the method turns round, without meeting the switch."""
    STUCK = 2
    """The switch was found, but did not open or close again before the axis reached a limit switch."""
    WRONG_SWITCH = 3
    """A limit switch closed towards which the axis does not move."""
    TIMEOUT = 4
    """The homing took longer than its timeout (2020h:01)."""
    NO_SPEED = 5
    """The axis' speed limit is too low for any motion."""


class Overrun(IntEnum):
    """Place where CAN frames were lost because it was full: the detail of EMCY 8110h."""

    RECEIVE_FIFO = 0
    """Of the CAN controller."""
    TRANSMIT_QUEUE = 1
    """Of the CAN driver: the bus is too busy for what the node has to send."""
    EMCY_QUEUE = 2
    """Of the node: the inhibit time EMCY (1015h) spaces the frames more than the errors."""


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
    """Detail 0: the board is too hot; 1: the driver chip is, and has switched itself off."""
    OUTPUT_STAGE = 0x5410
    """The fault output of a driver that is wired to the board: a short circuit, too much current, heat or voltage."""
    PARAMETER = 0x6320
    COMMUNICATION = 0x8100
    """CiA 301's "communication, generic": the master has stopped or reset the node. The detail is the NmtCommand."""
    CAN_OVERRUN = 0x8110
    """CiA 301's "CAN overrun (objects lost)". The detail is an Overrun."""
    CAN_ERROR_PASSIVE = 0x8120
    HEARTBEAT_LOST = 0x8130
    CAN_BUS_OFF_RECOVERED = 0x8140
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    SYNC_LENGTH = 0x8240
    RPDO_TIMEOUT = 0x8250
    """An RPDO came too late or not at all (1400h:05). The detail is its number."""
    OVERSPEED = 0x8400
    FOLLOWING_ERROR = 0x8611
    LIMIT_SWITCH = 0x8612
    """CiA 402's "reference limit". Detail 0: negative limit switch; 1: positive limit switch."""
    SYNC_CONTROLLER = 0x8700
    """Too many SYNCs (detail 0) or set-points (detail 1) of cyclic synchronous position came late or not at all."""
    ESTOP = 0x9000
    """CiA 301's "external error"."""
    PVT_UNDERRUN = 0xFF01
    GROUP_STOPPED = 0xFF02
    """Another axis of the group has a fault, and this axis stopped with it."""
    SEGMENT_REFUSED = 0xFF03
    LATE_STEP = 0xFF04
    """A step had to wait more than one servo tick until the driver's timing allowed it."""
    HOMING_FAILED = 0xFF05
    """Not a fault: the axis stops and stays enabled. The detail is a HomingError."""

    @property
    def communication(self) -> bool:
        """True for errors of the bus; most end with their cause and not by a fault reset."""
        return self >> 8 in (0x81, 0x82)

    @property
    def lost_connection(self) -> bool:
        """True for errors of a lost connection: a drive goes into fault by them if its option code (6007h) is 1."""
        return self in _LOST_CONNECTION

    @property
    def register(self) -> int:
        """Bits that the error sets in the error register (1001h, CiA 301 table 48): always bit 0, "generic error"."""
        if self == ErrorCode.NONE:
            return 0
        return 0x01 | (0x10 if self.communication else _REGISTER_BITS[self >> 12])


_LOST_CONNECTION = frozenset(
    (ErrorCode.COMMUNICATION, ErrorCode.HEARTBEAT_LOST, ErrorCode.CAN_BUS_OFF_RECOVERED, ErrorCode.RPDO_TIMEOUT)
)
_REGISTER_BITS = {0x3: 0x04, 0x4: 0x08, 0x5: 0x00, 0x6: 0x20, 0x8: 0x20, 0x9: 0x00, 0xF: 0x80}
"""Bits by the code's first hexadecimal digit: voltage, temperature, profile (6 and 8), manufacturer; 5 and 9: none."""


SI_PREFIXES: Final = range(-9, 4)
"""Powers of ten that the SI unit of positions (60A8h) may have: nano to kilo."""
INCREMENTS: Final = 0xB5
"""The unit of 60A8h that counts a position encoder's increments, which here are the wire units."""
SI_UNITS: Final = {0x00: "no unit", 0x01: "m", 0x10: "rad", 0x41: "deg", 0xB4: "revolutions", INCREMENTS: "increments"}
"""Units that 60A8h may name, by their notation index: CiA 303-2, and those of drives for the last two."""
