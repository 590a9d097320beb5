"""Say in one line why a drive in fault does not move, and what to do about it."""

from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.words import error_text, state_text
from steptwin.protocol import od
from steptwin.protocol.cia402 import State

HELD: Final = "held by an emergency stop until `steptwin reset`"
"""What `steptwin estop` does to a drive."""


def fault_and_remedy(axis: AxisClient, state: State) -> str:
    """Read why a drive is in a fault state by SDO; return the reason and its remedy, without the axis' name."""
    if axis.read(od.EMERGENCY_STOP):
        return f"is {HELD}"
    code = axis.read(od.ERROR_CODE)
    reason = f"{error_text(code)} (0x{code:04X})"
    return f"the drive is in {state_text(state)}: {reason}; remove the cause, then `steptwin reset`"
