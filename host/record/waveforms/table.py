"""Write changes as a table in a CSV file, or as arrays for numpy."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.waveforms.merging import initial_values, merged
from steptwin.host.record.waveforms.signal import Signal, Values
from steptwin.host.record.waveforms.text import Text, constant, decimals, lines, matrix, seconds
from steptwin.host.record.waveforms.timebase import COUNTS, NANOSECONDS, Window

HEADER: Final = "counts,t_s,signal,value\n"


def csv(signals: Sequence[Signal], window: Window) -> Iterator[bytes]:
    """Yield a CSV file in pieces; columns: counts since power-up, motion time in seconds, signal, new value.

    The first rows are the values of all signals at the beginning of the window.
    """
    every = np.arange(len(signals))
    yield HEADER.encode()
    yield _rows(signals, window, np.full(every.size, window.from_counts), every, initial_values(signals, window))
    for part in merged(signals, window, COUNTS):
        yield _rows(signals, window, part.instants, part.which, part.values)


def arrays(signals: Sequence[Signal], window: Window) -> dict[str, Values]:
    """Return NAME_change_counts, NAME_values and NAME_initial for each signal; also the window and t = 0, in counts."""
    made: dict[str, Any] = {
        "from_counts": np.int64(window.from_counts),
        "to_counts": np.int64(window.to_counts),
        "start_counts": np.int64(window.start_counts),
    }
    for signal in signals:
        counts, values = signal.changes.between(window.from_counts, window.to_counts)
        made[f"{signal.name}_initial"] = np.asarray(signal.changes.at(window.from_counts), values.dtype)
        made[f"{signal.name}_change_counts"] = counts
        made[f"{signal.name}_values"] = values
    return made


def _rows(
    signals: Sequence[Signal], window: Window, counts: Int64Array, which: NDArray[np.intp], values: Text
) -> bytes:
    ns = NANOSECONDS.rounded(counts - window.start_counts)
    comma = constant(",", counts.size)
    names = matrix([f",{signal.name}," for signal in signals])[which]
    return lines(decimals(counts), comma, seconds(ns), names, values, constant("\n", counts.size))
