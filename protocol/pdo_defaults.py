"""The PDOs of an axis node as they are after power-up: what they carry and when they are sent."""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol import od

SYNCHRONOUS: Final = 1
"""Transmission type: with every SYNC."""
MANUFACTURER_EVENT: Final = 254
ASYNCHRONOUS: Final = 255
"""Transmission types: when a value changes, and by the event timer."""


@dataclass(frozen=True, slots=True)
class PdoDefault:
    """One PDO after power-up.

    Attributes:
        transmission_type: of CiA 301, section 7.5.2.37.
        mapping: addresses of the entries that it carries, in their order on the wire.
        inhibit_100us: least time between two transmissions in 100 us.
        event_timer_ms: a transmit PDO is sent at least this often; 0 for no timer.
        enabled: False if its COB-ID is marked invalid.
    """

    transmission_type: int
    mapping: tuple[int, ...]
    inhibit_100us: int = 0
    event_timer_ms: int = 0
    enabled: bool = True


RPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.CONTROLWORD, od.MODE_OF_OPERATION)),
    PdoDefault(SYNCHRONOUS, (od.CONTROLWORD,)),
    PdoDefault(SYNCHRONOUS, (od.TARGET_POSITION,)),
    PdoDefault(ASYNCHRONOUS, (od.PVT_DISPLACEMENT, od.PVT_END_VELOCITY, od.PVT_DURATION_MS, od.PVT_SEQUENCE)),
)
TPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.STATUSWORD, od.MODE_OF_OPERATION_DISPLAY, od.POSITION_ACTUAL), 50, 100),
    PdoDefault(SYNCHRONOUS, (od.POSITION_ACTUAL, od.VELOCITY_ACTUAL), enabled=False),
    PdoDefault(
        MANUFACTURER_EVENT,
        (od.PVT_NEXT_SEQUENCE, od.PVT_FREE_RECORDS, od.PVT_FLAGS, od.PVT_EXECUTING_SEQUENCE, od.BOARD_CLOCK_US),
        100,
        100,
    ),
    PdoDefault(ASYNCHRONOUS, (od.DIGITAL_INPUTS, od.ERROR_CODE)),
)
