"""Name the words of the control port, by which programs operate the machine of a served board: docs/control-port.md."""

from enum import StrEnum
from typing import Final

from steptwin.protocol.cia402 import DigitalInput

EXAMPLE_PORT: Final = 29537
"""TCP port in examples; each served board has the one that it is given."""


class Do(StrEnum):
    """What a request asks for."""

    ESTOP = "estop"
    SUPPLY = "supply"
    TEMPERATURE = "temperature"
    PROTECT = "protect"
    INPUT = "input"
    SWITCH = "switch"
    SWITCH_WIRE = "switch-wire"
    BOUNCE = "bounce"
    MODE = "mode"
    OSC = "osc"
    SLIP = "slip"
    PAYLOAD = "payload"
    WIRE = "wire"
    BROWN_OUT = "brown-out"
    WATCHDOG = "watchdog"
    POWER_UP = "power-up"
    STRANGER = "stranger"
    BABBLE = "babble"
    LOSS = "loss"
    CORRUPTION = "corruption"
    DUPLICATE = "duplicate"
    DELAY = "delay"
    BUS_OFF = "bus-off"
    BUS_OK = "bus-ok"
    HOST = "host"
    STATE = "state"


class Stuck(StrEnum):
    """How a switch sticks; a free one follows the machine."""

    CLOSED = "closed"
    OPEN = "open"
    FREE = "free"


class SwitchWiring(StrEnum):
    """What the wire of a switch is like: whole, or broken, at a contact that is open or closed at rest."""

    WHOLE = "whole"
    NORMALLY_OPEN = "normally-open"
    NORMALLY_CLOSED = "normally-closed"


class Wiring(StrEnum):
    """What a wire to a driver is like."""

    WHOLE = "whole"
    BROKEN = "broken"
    LOW = "low"
    HIGH = "high"
    NOISY = "noisy"


SWITCHES: Final = {
    "-": DigitalInput.NEGATIVE_LIMIT,
    "+": DigitalInput.POSITIVE_LIMIT,
    "home": DigitalInput.HOME,
}
"""The switches along a joint by the names that requests give them."""
