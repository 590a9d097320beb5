"""The words of CiA 402 (IEC 61800-7-201) that drive and master share: states, modes, control, status and errors."""

from enum import Enum, IntEnum, IntFlag
from functools import cache


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
        """Which bits of the statusword tell the states apart."""
        self.bits = bits
        """What the state contributes to the statusword."""

    @classmethod
    @cache
    def of(cls, statusword: int) -> "State":
        """Read the state from a statusword; raise ValueError if its bits are no state's."""
        for state in cls:
            if statusword & state.mask == state.bits:
                return state
        raise ValueError(f"statusword 0x{statusword:04X} shows no state of CiA 402")


class Control(IntEnum):
    """Bits of the controlword 0x6040; combined they are plain integers."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2
    """Active low: a quick stop is asked for by clearing it."""
    ENABLE_OPERATION = 1 << 3
    START = 1 << 4
    """Homing: start; interpolated position: enable; profile position: new set-point."""
    CHANGE_AT_ONCE = 1 << 5
    """Profile position: do not wait for the set-point in progress."""
    RELATIVE = 1 << 6
    """Profile position: the target counts from the one before."""
    FAULT_RESET = 1 << 7
    HALT = 1 << 8


SHUTDOWN = 0x06
SWITCH_ON = 0x07
ENABLE_OPERATION = 0x0F
DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
"""The controlwords that CiA 402 names."""


class Status(IntEnum):
    """Bits of the statusword 0x6041 beside those of the state; combined they are plain integers."""

    VOLTAGE_ENABLED = 1 << 4
    WARNING = 1 << 7
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    HOMING_ATTAINED = 1 << 12
    SETPOINT_ACKNOWLEDGED = 1 << 12
    ZERO_SPEED = 1 << 12
    IP_ACTIVE = 1 << 12
    FOLLOWS_COMMAND = 1 << 12
    HOMING_ERROR = 1 << 13
    FOLLOWING_ERROR = 1 << 13
    POSITION_KNOWN = 1 << 14
    """The manufacturer's: the axis was homed since power-up and has not been cut off while it moved."""


class Mode(IntEnum):
    """Modes of operation, objects 0x6060 and 0x6061."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8

    @property
    def supported_bit(self) -> int:
        """The mode's bit in 0x6502."""
        return 1 << (self - 1) if self else 0


class DigitalInput(IntFlag):
    """Bits of 0x60FD (CiA 402-2); from bit 16 on they are the manufacturer's. A set bit is an input that is active."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2
    ESTOP = 1 << 16
    DRIVER_PROTECT = 1 << 17
    """The driver chip has switched itself off because it is too hot."""


class DigitalOutput(IntFlag):
    """Bits of 0x60FE:01 and of its mask :02: OUT1 and OUT2 at the axis' connector.

    CiA 402-2 leaves bits 16 to 31 to the manufacturer; bit 0 would be a brake, which this board does not have.
    """

    OUT1 = 1 << 16
    OUT2 = 1 << 17


class AbortConnection(IntEnum):
    """What a drive does when it has lost its host, object 0x6007 (CiA 402 table 41)."""

    NO_ACTION = 0
    FAULT_SIGNAL = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


PVT_SUBMODE = -1
"""0x60C0: the manufacturer's interpolation, position-velocity-time records."""


class HomingError(IntEnum):
    """Why a homing has failed: object 0x2020:02 and the detail of EMCY 0xFF05."""

    NONE = 0
    NOT_FOUND = 1
    """The search came to the end of travel, or to both ends where the method turns round, without the switch."""
    STUCK = 2
    """The switch was found, but the way over its edge ended at a limit switch: it did not open, or did not close."""
    WRONG_SWITCH = 3
    """A limit switch closed behind the axis or, of two that should be apart, the one of the other end."""
    TIMEOUT = 4
    """It took longer than 0x2020:01."""
    NO_SPEED = 5
    """The axis' speed limit leaves no motion."""


LINEAR_RAMP = 0
JERK_LIMITED_RAMP = 3
"""0x6086; the other two of CiA 402, sin^2 and jerk-free, are not offered."""


class ErrorCode(IntEnum):
    """What 0x603F and EMCY say (CiA 402 table 25, CiA 301 table 26; 0xFFxx is the manufacturer's)."""

    NONE = 0x0000
    OVERVOLTAGE = 0x3210
    UNDERVOLTAGE = 0x3220
    TEMPERATURE = 0x4310
    """Detail 0: the board; 1: the driver chip, which has switched itself off."""
    PARAMETER = 0x6320
    CAN_OVERRUN = 0x8110
    """A message was lost because nobody fetched its predecessors from the CAN controller."""
    CAN_ERROR_PASSIVE = 0x8120
    HEARTBEAT_LOST = 0x8130
    CAN_BUS_OFF_RECOVERED = 0x8140
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    SYNC_LENGTH = 0x8240
    OVERSPEED = 0x8400
    FOLLOWING_ERROR = 0x8611
    LIMIT_SWITCH = 0x8612
    """CiA 402's "reference limit". Detail 0: the negative one; 1: the positive one."""
    SYNC_CONTROLLER = 0x8700
    """Too many SYNCs (detail 0) or set-points (detail 1) of cyclic synchronous position have not come in time."""
    ESTOP = 0x9000
    """CiA 301's "external error"."""
    PVT_UNDERRUN = 0xFF01
    GROUP_STOPPED = 0xFF02
    """Another axis of the group has a fault; this one stopped with it."""
    SEGMENT_REFUSED = 0xFF03
    LATE_STEP = 0xFF04
    """A step had to wait for the driver's timing for more than one servo tick."""
    HOMING_FAILED = 0xFF05
    """No fault: the axis stops and stays enabled. The detail is a HomingError."""

    @property
    def communication(self) -> bool:
        """Whether it is an error of the bus, which goes when its cause goes, not by a fault reset."""
        return self >> 8 in (0x81, 0x82)

    @property
    def register(self) -> int:
        """The error register 0x1001 that goes with it (CiA 301, table 48); every error sets bit 0, generic."""
        if self == ErrorCode.NONE:
            return 0
        return 0x01 | (0x10 if self.communication else _REGISTER_BITS[self >> 12])


_REGISTER_BITS = {0x3: 0x04, 0x4: 0x08, 0x6: 0x20, 0x8: 0x20, 0x9: 0x00, 0xF: 0x80}
"""By the code's first digit: voltage, temperature, device profile (twice), none, manufacturer."""
