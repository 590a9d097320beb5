"""Write value change dumps (IEEE 1364-2005, clause 18), which logic analysers and waveform viewers read.

For sigrok a file holds wires of one bit only, since sigrok's import stops at a wire of several bits. It also drops
scopes, so names differ without them. Numbers and texts are variables of type `real` and `string`; GTKWave defines the
latter.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.waveforms.merging import Merged, initial_values, merged
from steptwin.host.record.waveforms.signal import Signal, SignalKind, Values
from steptwin.host.record.waveforms.text import Text, constant, decimals, lines, matrix, seconds
from steptwin.host.record.waveforms.timebase import COUNTS, NANOSECONDS, TimeScale, Window

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


_TYPES: Final = {SignalKind.WIRE: "wire 1", SignalKind.REAL: "real 64", SignalKind.TEXT: "string 1"}
_BEFORE: Final = {SignalKind.WIRE: "", SignalKind.REAL: "r", SignalKind.TEXT: "s"}
_BEHIND: Final = {SignalKind.WIRE: "", SignalKind.REAL: " ", SignalKind.TEXT: " "}
"""Characters before a value, and between the value and the signal's code."""

_FIRST_CODE: Final = ord("!")
_CODES: Final = 94
"""Number of printable ASCII characters: codes are made of these."""


def vcd(signals: Sequence[Signal], window: Window, scale: TimeScale, title: str) -> Iterator[bytes]:
    """Yield a file in pieces; its instants count from power-up, as in edges.npz and bus.log.

    Raises:
        InputError: a pulse is too short for the scale (see `merged`).
    """
    yield _header(signals, window, scale, title)
    last, end = scale.unit(window.from_counts), scale.unit(window.to_counts)
    initial = _assignments(signals, np.arange(len(signals)), initial_values(signals, window))
    yield f"#{last}\n$dumpvars\n".encode() + lines(*initial) + b"$end\n"
    for part in merged(signals, window, scale):
        yield _lines(signals, part, last)
        last = int(part.instants[-1])
    if end != last:
        yield f"#{end}\n".encode()


def _header(signals: Sequence[Signal], window: Window, scale: TimeScale, title: str) -> bytes:
    words = [
        f"$version StepTwin, SIMULATED: {title.replace('$', '')} $end",
        f"$comment #0 is power-up, #{scale.unit(window.start_counts)} the motion's t = 0 $end",
        f"$timescale {scale.vcd} $end",
    ]
    for scope, group in groupby(enumerate(signals), key=lambda numbered: numbered[1].scope):
        words.append(f"$scope module {scope} $end")
        words += [f"$var {_TYPES[signal.kind]} {_code(i)} {signal.name} $end" for i, signal in group]
        words.append("$upscope $end")
    return ("\n".join(words) + "\n$enddefinitions $end\n").encode()


def _lines(signals: Sequence[Signal], part: Merged, last: int) -> bytes:
    """Return the changes as lines, with a line of the instant before the first change at each instant."""
    later = np.diff(part.instants, prepend=last) != 0
    instants = part.instants[later]
    stamps = np.concatenate([constant("#", instants.size), decimals(instants), constant("\n", instants.size)], axis=1)
    stamped = np.zeros((later.size, stamps.shape[1]), np.uint8)
    stamped[later] = stamps
    return lines(stamped, *_assignments(signals, part.which, part.values))


def _assignments(signals: Sequence[Signal], which: NDArray[np.intp], values: Text) -> tuple[Text, Text, Text]:
    before = matrix([_BEFORE[signal.kind] for signal in signals])
    behind = matrix([f"{_BEHIND[signal.kind]}{_code(i)}\n" for i, signal in enumerate(signals)])
    return before[which], values, behind[which]


def _code(i: int) -> str:
    """Return a signal's code: one character, two from the 95th signal on."""
    more, last = divmod(i, _CODES)
    return (_code(more - 1) if more else "") + chr(_FIRST_CODE + last)
