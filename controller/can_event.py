"""What the CAN controller tells the firmware beside messages."""

from enum import Enum

from protocol.cia402 import ErrorCode


class CanEvent(Enum):
    """A condition of the CAN controller; the value is the error code that stands for it (CiA 301, table 26)."""

    OVERRUN = ErrorCode.CAN_OVERRUN
    """A message came while its FIFO was full, and is lost."""
    ERROR_PASSIVE = ErrorCode.CAN_ERROR_PASSIVE
    BUS_OFF_RECOVERED = ErrorCode.CAN_BUS_OFF_RECOVERED
