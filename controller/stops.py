"""How an axis is brought to rest: the option codes of CiA 402 as tables."""

from enum import Enum
from typing import NamedTuple

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State


class Ramp(Enum):
    """Along which deceleration an axis stops; the value is the address of the entry that holds it."""

    CUT = None
    """None: no pulse follows. What the motor does then nobody knows."""
    SLOW_DOWN = od.PROFILE_DECELERATION
    QUICK_STOP = od.QUICK_STOP_DECELERATION


class QuickStop(NamedTuple):
    """How a quick stop goes, and the state in which it ends."""

    ramp: Ramp
    end: State


QUICK_STOPS = {
    0: QuickStop(Ramp.CUT, State.SWITCH_ON_DISABLED),
    1: QuickStop(Ramp.SLOW_DOWN, State.SWITCH_ON_DISABLED),
    2: QuickStop(Ramp.QUICK_STOP, State.SWITCH_ON_DISABLED),
    5: QuickStop(Ramp.SLOW_DOWN, State.QUICK_STOP_ACTIVE),
    6: QuickStop(Ramp.QUICK_STOP, State.QUICK_STOP_ACTIVE),
}
"""Object 0x605A; 3, 4, 7 and 8 are current and voltage limits, which a stepper has not."""
SHUTDOWNS = {0: Ramp.CUT, 1: Ramp.SLOW_DOWN}
"""Object 0x605B."""
DISABLES = {0: Ramp.CUT, 1: Ramp.SLOW_DOWN}
"""Object 0x605C."""
HALTS = {1: Ramp.SLOW_DOWN, 2: Ramp.QUICK_STOP}
"""Object 0x605D."""
FAULT_REACTIONS = {0: Ramp.CUT, 1: Ramp.SLOW_DOWN, 2: Ramp.QUICK_STOP}
"""Object 0x605E."""
OPTIONS: dict[int, frozenset[int]] = {
    od.QUICK_STOP_OPTION: frozenset(QUICK_STOPS),
    od.SHUTDOWN_OPTION: frozenset(SHUTDOWNS),
    od.DISABLE_OPERATION_OPTION: frozenset(DISABLES),
    od.HALT_OPTION: frozenset(HALTS),
    od.FAULT_REACTION_OPTION: frozenset(FAULT_REACTIONS),
}
"""The values that each option code may take."""

_FIXED_REACTIONS = {
    ErrorCode.UNDERVOLTAGE: Ramp.CUT,  # the driver's outputs cannot be relied on for a ramp
    ErrorCode.ESTOP: Ramp.QUICK_STOP,  # IEC 60204-1, stop category 1: stop, then take the power away
}


def fault_ramp(code: ErrorCode, detail: int, option: int) -> Ramp:
    """How an axis stops for an error: by 0x605E unless the error itself decides it."""
    if code is ErrorCode.TEMPERATURE and detail:  # the chip has switched itself off
        return Ramp.CUT
    return _FIXED_REACTIONS.get(code, FAULT_REACTIONS[option])
