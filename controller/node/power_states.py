"""The CiA 402 power state machine of one axis, as one table (CiA 402, figure 2 and table 23).

This module determines the state after a controlword. `AxisDrive` executes the transitions: outputs and motion.
"""

from enum import Enum
from typing import Final

from steptwin.protocol.cia402 import Control, State


class DriveCommand(Enum):
    """The command in a controlword. A command without a transition from the present state changes nothing."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"
    ENABLE_OPERATION = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    FAULT_RESET = "fault reset"


_RTSO, _SO, _OE = State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED
_SOD, _QSA = State.SWITCH_ON_DISABLED, State.QUICK_STOP_ACTIVE

TRANSITIONS: dict[tuple[State, DriveCommand], State] = {
    (_SOD, DriveCommand.SHUTDOWN): _RTSO,  # 2
    (_RTSO, DriveCommand.SWITCH_ON): _SO,  # 3
    (_RTSO, DriveCommand.ENABLE_OPERATION): _OE,  # 3 + 4
    (_SO, DriveCommand.ENABLE_OPERATION): _OE,  # 4
    (_OE, DriveCommand.SWITCH_ON): _SO,  # 5, "disable operation"
    (_SO, DriveCommand.SHUTDOWN): _RTSO,  # 6
    (_RTSO, DriveCommand.QUICK_STOP): _SOD,  # 7
    (_RTSO, DriveCommand.DISABLE_VOLTAGE): _SOD,  # 7
    (_OE, DriveCommand.SHUTDOWN): _RTSO,  # 8
    (_OE, DriveCommand.DISABLE_VOLTAGE): _SOD,  # 9
    (_SO, DriveCommand.QUICK_STOP): _SOD,  # 10
    (_SO, DriveCommand.DISABLE_VOLTAGE): _SOD,  # 10
    (_OE, DriveCommand.QUICK_STOP): _QSA,  # 11
    (_QSA, DriveCommand.DISABLE_VOLTAGE): _SOD,  # 12
    (State.FAULT, DriveCommand.FAULT_RESET): _SOD,  # 15
    (_QSA, DriveCommand.ENABLE_OPERATION): _OE,  # 16, only at standstill: with the option codes 5 to 8
}
"""All transitions that a controlword causes, with their numbers in CiA 402.

The drive makes 0 and 1 (boot), 12 (end of a quick stop) and 13 and 14 (fault and end of its reaction) by itself.
"""

_STOPS: Final = (_SO, _RTSO, _QSA, _SOD)
"""States after a stop from OPERATION ENABLED, the nearest one first."""

ENERGISED = frozenset((_SO, _OE, _QSA, State.FAULT_REACTION_ACTIVE))
"""States with the driver's outputs on: the motor holds its position."""


def leads_further(target: State, stop: State) -> bool:
    """Return whether `target` is further away from OPERATION ENABLED than `stop`, the stop in progress."""
    return target in _STOPS and _STOPS.index(target) > _STOPS.index(stop)


def command_of(controlword: int, previous: int) -> DriveCommand:
    """Decode a controlword by the bit patterns of CiA 402 table 23. Fault reset is a rising edge of bit 7."""
    if controlword & ~previous & Control.FAULT_RESET:
        return DriveCommand.FAULT_RESET
    if not controlword & Control.ENABLE_VOLTAGE:
        return DriveCommand.DISABLE_VOLTAGE
    if not controlword & Control.QUICK_STOP:
        return DriveCommand.QUICK_STOP
    if not controlword & Control.SWITCH_ON:
        return DriveCommand.SHUTDOWN
    if not controlword & Control.ENABLE_OPERATION:
        return DriveCommand.SWITCH_ON
    return DriveCommand.ENABLE_OPERATION


def next_state(state: State, controlword: int, previous: int) -> State:
    """Return the state after a controlword; the present one if the word causes no transition.

    A rising fault reset bit acts in FAULT only. In other states the other bits of the word count.
    """
    command = command_of(controlword, previous)
    if command is DriveCommand.FAULT_RESET and state is not State.FAULT:
        command = command_of(controlword, controlword)
    return TRANSITIONS.get((state, command), state)
