"""Choices of users: levels, bit rates, NAME=VALUE pairs, names of the control port (docs/live.md)."""

from enum import StrEnum
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import BITRATES

LEVELS: Final = {"on": True, "off": False}
"""Levels of digital inputs, outputs and buttons by their names."""


def name_value_pairs(texts: list[str]) -> dict[str, str]:
    """Parse NAME=VALUE texts; raise InputError for another form, or a name that is given twice."""
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


def check_bitrate(bitrate: int, given: str) -> None:
    """Raise InputError for an unsupported bit rate; `given` is key and value for the message."""
    if bitrate not in BITRATES:
        raise InputError(f"{given} is not one of {', '.join(map(str, BITRATES))}")


EXAMPLE_PORT: Final = 29537
"""TCP port in examples; a served board uses the port that its user gives."""


class Stuck(StrEnum):
    """Level at which a limit switch is stuck; a free switch follows the axis."""

    CLOSED = "closed"
    OPEN = "open"
    FREE = "free"


SWITCHES: Final = {
    "-": DigitalInput.NEGATIVE_LIMIT,
    "+": DigitalInput.POSITIVE_LIMIT,
    "home": DigitalInput.HOME,
}
"""Switches of a joint by their names in requests."""

STATE: Final = "state"
"""Request of the control port that only reads the machine's state."""
