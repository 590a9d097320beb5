"""Words and values to choose from: levels, bit rates, names with values, the control port's words.

By the control port programs operate the machine of a served board: docs/control-port.md.
"""

from enum import StrEnum
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import BITRATES

LEVELS: Final = {"on": True, "off": False}
"""Levels of digital inputs, outputs and buttons by their words."""


def name_value_pairs(texts: list[str]) -> dict[str, str]:
    """Return NAME=VALUE texts as a mapping; InputError for another form, or a name given twice."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator:
            raise InputError(f"'{text}' is not of the form NAME=VALUE")
        key, given = name.strip(), value.strip()
        if key in pairs:
            raise InputError(f"{key} is given twice: {pairs[key]} and {given}")
        pairs[key] = given
    return pairs


def check_bitrate(bitrate: int, told: str) -> None:
    """Raise InputError for a bit rate that no bus has; `told` names key and value."""
    if bitrate not in BITRATES:
        raise InputError(f"{told} is not one of {', '.join(map(str, BITRATES))}")


EXAMPLE_PORT: Final = 29537
"""TCP port in examples; each served board has the one that it is given."""


class Stuck(StrEnum):
    """How a switch sticks; a free one follows the machine."""

    CLOSED = "closed"
    OPEN = "open"
    FREE = "free"


SWITCHES: Final = {
    "-": DigitalInput.NEGATIVE_LIMIT,
    "+": DigitalInput.POSITIVE_LIMIT,
    "home": DigitalInput.HOME,
}
"""The switches along a joint by the names that requests give them."""

STATE: Final = "state"
"""The request of the control port that does nothing: it asks how the machine is."""
