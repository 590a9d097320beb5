"""Name states, modes and error codes in words, as messages and reports show them."""

from enum import Enum

from steptwin.protocol.cia402 import ErrorCode, Mode, State


def words(member: Enum) -> str:
    """Return the name of an enumeration's member in lower case, with spaces."""
    return (member.name or "").replace("_", " ").lower()


def error_text(code: int) -> str:
    """Return an EMCY error code in words."""
    return words(ErrorCode(code)) if code in set(ErrorCode) else "unknown error"


def state_text(state: State) -> str:
    """Return a drive's state as CiA 402 writes it."""
    return state.name.replace("_", " ")


def mode_text(mode: int) -> str:
    """Return a mode of operation in words."""
    return words(Mode(mode)) if mode in set(Mode) else f"mode {mode}"
