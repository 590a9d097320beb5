"""The data types of CANopen that this board uses, and their little-endian codecs (CiA 301, section 7.1.6)."""

from enum import IntEnum


class DataType(IntEnum):
    """Codes of CiA 301 table 44, each with its size in bytes (0 for a string, which has any length) and its sign."""

    INTEGER8 = 0x02, 1, True
    INTEGER16 = 0x03, 2, True
    INTEGER32 = 0x04, 4, True
    UNSIGNED8 = 0x05, 1, False
    UNSIGNED16 = 0x06, 2, False
    UNSIGNED32 = 0x07, 4, False
    VISIBLE_STRING = 0x09, 0, False
    INTEGER24 = 0x10, 3, True

    size: int
    signed: bool
    low: int
    """Least value of the type."""
    high: int
    """Greatest value of the type."""

    def __new__(cls, code: int, size: int, signed: bool) -> "DataType":
        """Make a member from its code and compute its range: two's complement if signed, else from 0."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.size, member.signed = size, signed
        member.low = -(1 << 8 * size) // 2 if signed else 0
        member.high = (1 << 8 * size) - 1 + member.low
        return member


def encode(data_type: DataType, value: int | str) -> bytes:
    """Return the bytes of a value that is known to lie in the type's range."""
    if isinstance(value, str):
        return value.encode("ascii")
    return value.to_bytes(data_type.size, "little", signed=data_type.signed)


def decode(data_type: DataType, data: bytes) -> int:
    """Return the integer in exactly `size` bytes."""
    return int.from_bytes(data, "little", signed=data_type.signed)
