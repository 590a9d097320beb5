"""CANopen's data types as used here, with their little-endian codecs (CiA 301, section 7.1.6)."""

from enum import IntEnum


class DataType(IntEnum):
    """Codes of CiA 301 table 44."""

    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    VISIBLE_STRING = 0x09
    INTEGER24 = 0x10

    @property
    def size(self) -> int:
        """Bytes on the wire; 0 for a string, whose length is its own."""
        return _SIZES[self]

    @property
    def signed(self) -> bool:
        """Whether negative values exist."""
        return self in _SIGNED

    @property
    def low(self) -> int:
        """The least value."""
        return -(1 << 8 * self.size - 1) if self.signed else 0

    @property
    def high(self) -> int:
        """The greatest value."""
        return (1 << 8 * self.size - (1 if self.signed else 0)) - 1


_SIGNED = frozenset((DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER24, DataType.INTEGER32))
_SIZES = {
    DataType.INTEGER8: 1,
    DataType.UNSIGNED8: 1,
    DataType.INTEGER16: 2,
    DataType.UNSIGNED16: 2,
    DataType.INTEGER24: 3,
    DataType.INTEGER32: 4,
    DataType.UNSIGNED32: 4,
    DataType.VISIBLE_STRING: 0,
}


def encode(data_type: DataType, value: int | str) -> bytes:
    """Return the bytes of a value that is known to lie in the type's range."""
    if isinstance(value, str):
        return value.encode("ascii")
    return value.to_bytes(data_type.size, "little", signed=data_type.signed)


def decode(data_type: DataType, data: bytes) -> int:
    """Return the integer in exactly `size` bytes."""
    return int.from_bytes(data, "little", signed=data_type.signed)
