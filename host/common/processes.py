"""Garbage collection and signals of StepTwin's programs, and reports about a slow computer."""

import gc
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Final

WORTH_TELLING_MS: Final = 100.0
"""Total pause of the board's clock that causes a warning; the next warning follows at twice the reported time."""


@dataclass(frozen=True, slots=True)
class ClockStood:
    """Pauses of a board's clock since power-up: number, total and longest, in milliseconds of the wall clock."""

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
    """Decides when to warn: once, and again each time the lost time has doubled."""

    def __init__(self) -> None:
        self._worth_ms = WORTH_TELLING_MS

    def worth_telling(self, stood: ClockStood) -> bool:
        """Return whether enough time has been lost since the last warning."""
        if stood.total_ms < self._worth_ms:
            return False
        self._worth_ms = 2.0 * stood.total_ms
        return True


_ENDS: Final = ("SIGINT", "SIGTERM", "SIGBREAK")
"""Signals that request a program's end: Ctrl-C, a service, and on Windows, which has no SIGTERM, Ctrl-Break."""


@contextmanager
def on_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Call a function at each SIGINT, SIGTERM and SIGBREAK during the block, instead of ending the program.

    It receives the signal's number and the interrupted frame. Only the main thread may use this.
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
"""New objects between two collections in a run: more than a run creates, because nearly all of them stay."""
_YOUNG_OBJECTS_OF_A_SERVER: Final = 700
"""New objects between two collections in a server, as Python's default: collections are short and frequent."""


def collect_seldom() -> None:
    """Make garbage collection rare in StepTwin's own programs; Python's default costs a seventh of a run.

    A program that uses StepTwin as a library decides for itself.
    """
    gc.set_threshold(_YOUNG_OBJECTS_OF_A_RUN)


@contextmanager
def collecting_often() -> Iterator[None]:
    """Make garbage collections frequent and short in the block, because a server must answer in time for days.

    Objects from before the block are excluded: numba and web frameworks leave so many that a collection would be slow.
    """
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(_YOUNG_OBJECTS_OF_A_SERVER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
