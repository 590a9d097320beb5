"""Names of states, modes and error codes for messages and reports."""

from enum import Enum
from typing import Final

from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State

STATES: Final[dict[State, str]] = {
    State.NOT_READY_TO_SWITCH_ON: "starting",
    State.SWITCH_ON_DISABLED: "off",
    State.READY_TO_SWITCH_ON: "off",
    State.SWITCHED_ON: "on, without control",
    State.OPERATION_ENABLED: "enabled",
    State.QUICK_STOP_ACTIVE: "stopped, holds its position",
    State.FAULT_REACTION_ACTIVE: "stops because of a fault",
    State.FAULT: "fault, off",
}
"""Drive states for operators."""

ERRORS: Final[dict[ErrorCode, str]] = {
    ErrorCode.NONE: "no error",
    ErrorCode.OVERVOLTAGE: "the motor supply's voltage is too high",
    ErrorCode.UNDERVOLTAGE: "the motor supply's voltage is too low",
    ErrorCode.TEMPERATURE: "the board or a driver is too hot",
    ErrorCode.OUTPUT_STAGE: "a driver has switched itself off: a short circuit, too much current, heat or voltage",
    ErrorCode.PARAMETER: "a setting does not fit the other axes",
    ErrorCode.COMMUNICATION: "a program on the bus has stopped or reset it",
    ErrorCode.CAN_OVERRUN: "the bus is too busy: messages were lost",
    ErrorCode.CAN_ERROR_PASSIVE: "the bus is disturbed",
    ErrorCode.HEARTBEAT_LOST: "the program that was in charge has fallen silent",
    ErrorCode.CAN_BUS_OFF_RECOVERED: "the bus was interrupted",
    ErrorCode.PDO_TOO_SHORT: "a message was too short",
    ErrorCode.PDO_TOO_LONG: "a message was too long",
    ErrorCode.SYNC_LENGTH: "a message had the wrong length",
    ErrorCode.RPDO_TIMEOUT: "the messages that it expects have stopped",
    ErrorCode.OVERSPEED: "it was asked to move too fast",
    ErrorCode.FOLLOWING_ERROR: "the motor does not follow: is it blocked?",
    ErrorCode.LIMIT_SWITCH: "it has reached a limit switch",
    ErrorCode.SYNC_CONTROLLER: "positions came too late",
    ErrorCode.ESTOP: "emergency stop",
    ErrorCode.PVT_UNDERRUN: "the motion came too late",
    ErrorCode.GROUP_STOPPED: "stopped together with another axis",
    ErrorCode.SEGMENT_REFUSED: "a part of the motion was refused",
    ErrorCode.LATE_STEP: "a step came too late",
    ErrorCode.HOMING_FAILED: "homing has failed",
    ErrorCode.TORQUE_OFF: "safe torque off is requested",
}
"""Drive errors for operators."""

STOP_PRESSED: Final = "the machine's emergency stop is pressed"
"""Message about a joint whose emergency stop input is on."""

HINDRANCES: Final[dict[DigitalInput, str]] = {
    DigitalInput.ESTOP: STOP_PRESSED,
    DigitalInput.TORQUE_OFF: "safe torque off is requested",
    DigitalInput.DRIVER_PROTECT: "its driver protects itself, as when it is too hot",
    DigitalInput.DRIVER_FAULT: "its driver has switched itself off: a short circuit, too much current, heat or voltage",
}
"""Inputs that prevent a drive from being switched on, for operators, the most important first."""


def hindrance_words(inputs: int) -> str | None:
    """Return the reason why a drive with these inputs cannot be switched on; None if it can."""
    return next((words for bit, words in HINDRANCES.items() if inputs & bit), None)


def state_words(state: State) -> str:
    """Return a drive's state for operators."""
    return STATES[state]


def error_words(code: int) -> str:
    """Return an error code's meaning for operators."""
    return ERRORS[ErrorCode(code)] if code in set(ErrorCode) else f"unknown error 0x{code:04X}"


RAN_DRY: Final = "ran out of records at rest"
"""Message about a queue that ran empty at standstill; boards have no error code for it."""


def words(member: Enum) -> str:
    """Return the name of an enum member in lower case, with spaces."""
    return (member.name or "").replace("_", " ").lower()


def error_text(code: int) -> str:
    """Return the name of an EMCY error code."""
    return words(ErrorCode(code)) if code in set(ErrorCode) else "unknown error"


def state_text(state: State) -> str:
    """Return the name of a drive's state in CiA 402."""
    return state.name.replace("_", " ")


def mode_text(mode: int) -> str:
    """Return the name of a mode of operation."""
    return words(Mode(mode)) if mode in set(Mode) else f"mode {mode}"
