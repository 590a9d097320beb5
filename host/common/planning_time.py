"""Bound the processor time that planning takes: what cannot be planned within it ends with a sentence.

Whatever plans is a block of `in_planning_time`, and each of its loops that an input can make long calls
`check_planning_time`. The outermost of such blocks counts. `plan_within` gives all those in it one bound together. Only
the processor time of the own thread counts, so a busy computer changes nothing.
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
    """The time that planning has.

    Attributes:
        bound_s: the time.
        now_s: the processor time of the thread.
        thread: the thread.
        steps: what is being planned, the innermost last.
        until_s: the time of `now_s` at which it is over; None while nothing is planned.
        error: the error once it is over.
    """

    bound_s: float
    now_s: Callable[[], float]
    thread: int = field(default_factory=get_ident)
    steps: list[str] = field(default_factory=list)
    until_s: float | None = None
    error: PlanningTimeError | None = None
    left_s: float = field(init=False)

    def __post_init__(self) -> None:
        self.left_s = self.bound_s

    def check(self) -> None:
        if self.until_s is None or self.now_s() < self.until_s:
            return
        if self.error is None:
            what = self.steps[-1] if self.steps else "the motion"
            self.error = PlanningTimeError(
                f"{what}: is not planned after {self.bound_s:g} s of processor time: make it simpler or shorter, or"
                f" give it more time, such as plan_within={2 * self.bound_s:g}"
            )
        raise self.error

    @contextmanager
    def runs(self) -> Iterator[None]:
        """Count the time of the block; an error that it has hidden comes at its end."""
        self.until_s = self.now_s() + self.left_s
        try:
            yield
        except InputError as error:
            if self.error is None or isinstance(error, PlanningTimeError):
                raise
            raise self.error from error
        finally:
            self.left_s, self.until_s = self.until_s - self.now_s(), None
        if self.error is not None:
            raise self.error


_CLOCK: ContextVar[_Clock | None] = ContextVar("planning clock", default=None)


def _present() -> _Clock | None:
    """Return the clock of this thread; a thread that takes over the context of another one has none of its own."""
    clock = _CLOCK.get()
    return clock if clock is not None and clock.thread == get_ident() else None


def processor_s() -> float:
    """Return the processor time of this thread in s."""
    return time.thread_time()


@contextmanager
def plan_within(seconds: float = PLANNING_S, now_s: Callable[[], float] = processor_s) -> Iterator[None]:
    """Bound the processor time, in s, that all planning in the block takes together; other work does not count.

    `now_s` tells the processor time of this thread. Raises InputError unless the bound is above 0.
    """
    if not seconds > 0:
        raise InputError(f"plan_within={seconds:g}: is not above 0")
    token = _CLOCK.set(_Clock(seconds, now_s))
    try:
        yield
    finally:
        _CLOCK.reset(token)


@contextmanager
def in_planning_time() -> Iterator[None]:
    """Let the block, or the function that this decorates, be planning, within the bound around it or the usual one.

    Raises PlanningTimeError when the time is over; nothing in the block hides it, as it comes at the end at the latest.
    """
    clock = _present()
    if clock is None:
        with plan_within(), in_planning_time():
            yield
    elif clock.until_s is not None:
        yield
    else:
        with clock.runs():
            yield


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
    """Raise PlanningTimeError if the time is over; outside of planning there is no bound."""
    clock = _present()
    if clock is not None:
        clock.check()
