"""Name the words of the control port, by which programs operate the machine of a served board: docs/control-port.md."""

from enum import StrEnum
from typing import Final

from steptwin.protocol.cia402 import DigitalInput

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
