"""Describe a simple node: the entries of its object dictionary as data, whoever has read them from where."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from steptwin.protocol.entry import Access


class ValueForm(Enum):
    """What an entry's bytes mean; the member's value says what a value is in Python."""

    WHOLE = "whole number"
    REAL = "number"
    TEXT = "text"
    """ISO 8859-1: a visible string is ASCII, and some devices have more."""
    WIDE_TEXT = "text in Unicode"
    BYTES = "bytes"


NodeValue = int | float | str | bytes
_REALS: Final = {32: "<f", 64: "<d"}
_ENCODINGS: Final = {ValueForm.TEXT: "latin-1", ValueForm.WIDE_TEXT: "utf-16-le"}
BYTES_MAX: Final = 4096
"""Longest text and longest bytes that an entry takes."""


@dataclass(frozen=True, slots=True)
class NodeEntry:
    """One entry of a simple node's dictionary.

    Attributes:
        name: as the description has it.
        form: what its bytes mean.
        bits: width of its value; 0 for a text and bytes, whose length is not fixed.
        signed: True for a number with a sign.
        access: access by SDO.
        default: value after power-up, as its bytes mean it.
        low: least whole number that may be written; None: that of the type.
        high: greatest one.
        mappable: True if PDOs may carry it.
    """

    name: str
    form: ValueForm
    bits: int
    signed: bool
    access: Access
    default: NodeValue
    low: int | None = None
    high: int | None = None
    mappable: bool = False

    @property
    def size(self) -> int:
        """Bytes of a value in an SDO; 0 if its length is not fixed."""
        return -(-self.bits // 8)

    @property
    def range(self) -> tuple[int, int]:
        """The whole numbers that its type has."""
        least = -(1 << self.bits - 1) if self.signed else 0
        return least, least + (1 << self.bits) - 1

    def to_bytes(self, value: NodeValue) -> bytes:
        """Return a value's bytes.

        Raises:
            ValueError: the value is of another kind, or its type does not have it.
        """
        match self.form, value:
            case ValueForm.WHOLE, int() if not isinstance(value, bool) or self.bits == 1:
                least, most = self.range
                if not least <= value <= most:
                    raise ValueError(f"{value} is not from {least} to {most}")
                return int(value).to_bytes(self.size, "little", signed=self.signed)
            case ValueForm.REAL, int() | float() if not isinstance(value, bool):
                try:
                    return struct.pack(_REALS[self.bits], value)
                except (OverflowError, struct.error):
                    raise ValueError(f"{value} does not fit into {self.bits} bits") from None
            case ((ValueForm.TEXT | ValueForm.WIDE_TEXT), str()):
                return self._text_bytes(value)
            case ValueForm.BYTES, bytes():
                return value
        raise ValueError(f"{value!r} is no {self.form.value}")

    def _text_bytes(self, text: str) -> bytes:
        try:
            return text.encode(_ENCODINGS[self.form])
        except UnicodeEncodeError:
            raise ValueError(f"{text!r} has characters that the type does not have") from None

    def to_value(self, data: bytes) -> NodeValue:
        """Return what bytes of the right length mean."""
        match self.form:
            case ValueForm.WHOLE:
                return int.from_bytes(data, "little", signed=self.signed)
            case ValueForm.REAL:
                real: float = struct.unpack(_REALS[self.bits], data)[0]
                return real
            case ValueForm.TEXT | ValueForm.WIDE_TEXT:
                return data.decode(_ENCODINGS[self.form], "replace")
            case ValueForm.BYTES:
                return data


@dataclass(frozen=True, slots=True)
class NodeDescription:
    """A simple node: its id, the file that describes it, and its entries by address."""

    node_id: int
    source: str
    entries: Mapping[int, NodeEntry]
