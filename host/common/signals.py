"""Let a program end in order when it is told to: by Ctrl-C, or by SIGTERM as service managers send it."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def on_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Call a function at each SIGINT and SIGTERM while the block runs, instead of ending the program.

    It gets the signal's number and the frame that was interrupted. Only the main thread may use this.
    """
    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)
