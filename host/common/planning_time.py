"""Bound the processor time that planning takes: what cannot be planned within it ends with a sentence.

Whatever plans opens `plan_within`, and each of its loops that an input can make long calls `check_planning_time`. The
outermost block counts, and it counts the processor time of its own thread, so a busy computer changes nothing.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from threading import get_ident
from typing import Final

from steptwin.host.common.errors import InputError

PLANNING_S: Final = 60.0
"""Usual bound in s: the longest job takes a few seconds, a program of 5000 steps less than a minute."""


class PlanningTimeError(InputError):
    """Something could not be planned within the time for it; the message names the step."""


@dataclass(slots=True)
class _Clock:
    """The time of a block.

    Attributes:
        seconds: its bound.
        now_s: the processor time of the thread.
        thread: the thread.
        until_s: time at which it is over.
        steps: what is being planned, the innermost last.
        error: the error once it is over.
    """

    seconds: float
    now_s: Callable[[], float]
    thread: int = field(default_factory=get_ident)
    until_s: float = field(init=False)
    steps: list[str] = field(default_factory=list)
    error: PlanningTimeError | None = None

    def __post_init__(self) -> None:
        self.until_s = self.now_s() + self.seconds

    def check(self) -> None:
        if self.now_s() < self.until_s:
            return
        if self.error is None:
            what = self.steps[-1] if self.steps else "the motion"
            self.error = PlanningTimeError(
                f"{what}: could not be planned in {self.seconds:g} s of processor time: make it simpler or shorter,"
                f" or give it more time, such as plan_within={2 * self.seconds:g}"
            )
        raise self.error


_CLOCK: ContextVar[_Clock | None] = ContextVar("planning clock", default=None)


def _present() -> _Clock | None:
    """Return the clock of this thread; a thread that takes over the context of another one has none of its own."""
    clock = _CLOCK.get()
    return clock if clock is not None and clock.thread == get_ident() else None


@contextmanager
def plan_within(seconds: float | None = None, now_s: Callable[[], float] | None = None) -> Iterator[None]:
    """Bound the processor time of all planning in the block, in s, by default PLANNING_S; the outermost block counts.

    Also a decorator of a function. `now_s` is another clock than the processor time of this thread.

    Raises:
        PlanningTimeError: the time is over. Nothing in the block hides that: it is raised at its end at the latest.
        InputError: the bound is not above 0.
    """
    if seconds is not None and not seconds > 0:
        raise InputError(f"plan_within={seconds:g}: is not above 0")
    if _present() is not None:
        yield
        return
    clock = _Clock(PLANNING_S if seconds is None else seconds, time.thread_time if now_s is None else now_s)
    token = _CLOCK.set(clock)
    try:
        yield
    except InputError as error:
        if clock.error is None or isinstance(error, PlanningTimeError):
            raise
        raise clock.error from error
    finally:
        _CLOCK.reset(token)
    if clock.error is not None:
        raise clock.error


@contextmanager
def planning_step(what: str) -> Iterator[None]:
    """Name what the block plans, such as `step 3 (go pick)`, for the error when the time is over."""
    clock = _present()
    if clock is None:
        yield
        return
    clock.steps.append(what)
    try:
        yield
    finally:
        clock.steps.pop()


def check_planning_time() -> None:
    """Raise PlanningTimeError if the time of the block around is over; outside of any block there is no bound."""
    clock = _present()
    if clock is not None:
        clock.check()
