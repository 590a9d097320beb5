"""SDO abort codes (CiA 301 table 22), and the exception of the device side that refuses an access."""

from enum import IntEnum


class AbortCode(IntEnum):
    """Reason why an SDO transfer is aborted."""

    TOGGLE_NOT_ALTERNATED = 0x0503_0000
    COMMAND_UNKNOWN = 0x0504_0001
    BLOCK_SIZE_INVALID = 0x0504_0002
    SEQUENCE_INVALID = 0x0504_0003
    CRC_WRONG = 0x0504_0004
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    CANNOT_BE_MAPPED = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    LENGTH_MISMATCH = 0x0607_0010
    LENGTH_TOO_HIGH = 0x0607_0012
    LENGTH_TOO_LOW = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    VALUE_RANGE = 0x0609_0030
    VALUE_TOO_HIGH = 0x0609_0031
    VALUE_TOO_LOW = 0x0609_0032
    MAX_BELOW_MIN = 0x0609_0036
    NOT_STORED = 0x0800_0020
    DEVICE_STATE = 0x0800_0022


class SdoAbortError(Exception):
    """Refusal of an access to the object dictionary: SDO answers with the code, a PDO drops the value."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"{code.name} (0x{code:08X})")
        self.code = code
