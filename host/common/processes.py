"""Garbage collection and signals of StepTwin's own programs, and a clock that a slow computer holds up."""

import gc
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Final

WORTH_TELLING_MS: Final = 100.0
"""Time for which the board's clock must have stood to be worth a warning; the next comes at twice the time told."""


@dataclass(frozen=True, slots=True)
class ClockStood:
    """The stops of a board's clock since power-up: their number, and milliseconds of the wall clock."""

    count: float
    total_ms: float
    longest_ms: float

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count:.0f} times"
        return (
            f"computer too slow: the board's clock stood {times}, {self.total_ms / 1000:.2f} s in all, "
            f"longest {self.longest_ms:.0f} ms"
        )


class Slowness:
    """Decides when it is worth telling: once, and again each time the time lost has doubled."""

    def __init__(self) -> None:
        self._worth_ms = WORTH_TELLING_MS

    def worth_telling(self, stood: ClockStood) -> bool:
        """Return whether enough time has been lost since this was True the last time."""
        if stood.total_ms < self._worth_ms:
            return False
        self._worth_ms = 2.0 * stood.total_ms
        return True


_ENDS: Final = ("SIGINT", "SIGTERM", "SIGBREAK")
"""What asks a program to end: Ctrl-C, a service, and on Windows Ctrl-Break, since nothing sends SIGTERM there."""


@contextmanager
def on_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Call a function at each SIGINT, SIGTERM and SIGBREAK while the block runs, instead of ending the program.

    It gets the signal's number and the frame that was interrupted. Only the main thread may use this.
    """
    before = {number: signal.signal(number, handler) for number in _numbers(_ENDS)}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


def _numbers(names: Iterable[str]) -> list[int]:
    """Return the signals that this system has."""
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


_YOUNG_OBJECTS_OF_A_RUN: Final = 50_000
"""Number of new objects between two collections: as many as a run makes and some more, and nearly all of them stay."""
_YOUNG_OBJECTS_OF_A_SERVER: Final = 700
"""Python's own choice: each collection is short, and what is left of a closed page does not wait for a hundred more."""


def collect_seldom() -> None:
    """Let a program's process collect garbage seldom; a program that uses StepTwin as a library decides for itself.

    Python's default costs a seventh of a run.
    """
    gc.set_threshold(_YOUNG_OBJECTS_OF_A_RUN)


@contextmanager
def collecting_often() -> Iterator[None]:
    """Collect garbage often and shortly while a server answers: it must do so in time, and runs for days.

    What was there before is spared: numba and web frameworks leave so much that each collection of it would be felt.
    """
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(_YOUNG_OBJECTS_OF_A_SERVER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
