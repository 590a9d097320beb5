"""Limit the processor time of planning; a plan that needs more ends with an error message.

Planning runs in a block of `in_planning_time`. Each loop that can be long calls `check_planning_time`. In nested blocks
the outermost counts. `plan_within` sets one limit for all blocks in it. Only the processor time of the present thread
counts, so a busy computer has no effect.
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
"""Default limit in s: the longest job takes a few seconds, a program of 5000 steps less than a minute."""


class PlanningTimeError(InputError):
    """Planning has exceeded its time limit; the message names the step."""


@dataclass(slots=True)
class _Clock:
    """The time limit of planning.

    Attributes:
        bound_s: the limit.
        now_s: returns the processor time of the thread.
        thread: identifier of the thread.
        steps: names of the present planning steps, the innermost last.
        until_s: value of `now_s` at which the limit is exceeded; None while nothing is planned.
        error: error after the limit is exceeded.
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
        """Measure the time of the block; if the block has hidden the error, raise it at its end."""
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
    """Return the clock of this thread; None in a thread that has inherited the context of another one."""
    clock = _CLOCK.get()
    return clock if clock is not None and clock.thread == get_ident() else None


def processor_s() -> float:
    """Return the processor time of this thread in s."""
    return time.thread_time()


@contextmanager
def plan_within(seconds: float = PLANNING_S, now_s: Callable[[], float] = processor_s) -> Iterator[None]:
    """Limit the total processor time, in s, of all planning in the block; other work does not count.

    `now_s` returns the processor time of this thread. Raises InputError if the limit is not above 0.
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
    """Mark a block, or a decorated function, as planning, with the limit around it or the default one.

    Raises PlanningTimeError when the limit is exceeded, at the latest at the end of the block.
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
    """Name the planning step of the block, such as `step 3 (go pick)`, for the error message."""
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
    """Raise PlanningTimeError if the limit is exceeded; outside of planning there is no limit."""
    clock = _present()
    if clock is not None:
        clock.check()
