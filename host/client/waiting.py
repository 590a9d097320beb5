"""Wait for the board: a polling loop and its time limits, for virtual and real time."""

from collections.abc import Callable
from typing import Final

from steptwin.host.client.links import Clock
from steptwin.host.common.errors import BusError

POLL_S: Final = 0.010
"""Polling period; equal to the inhibit time of the boards' status reports."""
REST_TIMEOUT_S: Final = 20.0
"""Longest wait for standstill; a stop ramp lasts at most as long as a queue of the longest records, 16.3 s."""
REPLY_TIMEOUT_S: Final = 1.0
"""Longest wait for an immediate reaction of a drive."""
SILENCE_S: Final = 1.0
"""Longest time without a status report, ten periods; after it the board counts as lost."""


def wait_until(clock: Clock, condition: Callable[[], bool], timeout_s: float, poll_s: float = POLL_S) -> bool:
    """Wait until a condition is true, which is checked first; return False if it is false after `timeout_s`."""
    deadline_s = clock.now_s() + timeout_s
    while not condition():
        if clock.now_s() >= deadline_s:
            return False
        clock.wait(poll_s)
    return True


def silent(name: str) -> BusError:
    """Return the error for an axis that has not reported its status for SILENCE_S."""
    text = f"{name}: no status for {SILENCE_S:g} s"
    return BusError(text).plainly(
        f"{name} has been silent for {SILENCE_S:g} s: is the machine switched on and connected?"
    )


def require(clock: Clock, condition: Callable[[], bool], message: str, timeout_s: float) -> None:
    """Wait until a condition is true; raise BusError, which begins with `message`, if it stays false."""
    if not wait_until(clock, condition, timeout_s):
        raise BusError(f"{message} within {timeout_s:g} s")
