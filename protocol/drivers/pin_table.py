"""Tables of a datasheet in which the levels of some pins select a value."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic

from steptwin.protocol.drivers.facts import Value


@dataclass(frozen=True, slots=True)
class PinTable(Generic[Value]):
    """Values by the levels of pins.

    Attributes:
        pins: names of the pins, or of the switches and register bits that act like pins.
        rows: each value with a letter for each pin: `L`, `H`, or `-` where the level does not matter.
    """

    pins: tuple[str, ...]
    rows: tuple[tuple[Value, str], ...]

    @property
    def values(self) -> tuple[Value, ...]:
        """All values once, in the datasheet's order."""
        return tuple(dict(self.rows))

    def levels(self, value: Value) -> dict[str, int]:
        """Return levels of the pins that select a value, by its first row; KeyError if none do."""
        letters = dict(reversed(self.rows))[value]
        return {pin: int(letter == "H") for pin, letter in zip(self.pins, letters, strict=True)}

    def selected(self, levels: Mapping[str, int]) -> Value | None:
        """Return the value that levels select; None where the datasheet names none."""
        shown = "".join("LH"[levels[pin]] for pin in self.pins)
        for value, letters in self.rows:
            if all(letter in (level, "-") for letter, level in zip(letters, shown, strict=True)):
                return value
        return None


def always(value: Value) -> PinTable[Value]:
    """Return the table of a value that no pin changes."""
    return PinTable((), ((value, ""),))
