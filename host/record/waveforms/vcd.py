"""Value change dump (IEEE 1364-2005, clause 18): what logic analysers and waveform viewers read.

A file of wires alone suits sigrok, whose import stops at the first wire of several bits and drops scopes, so that names
must be different without them. Numbers and texts are variables of type `real` and `string`; the latter is GTKWave's.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.record.waveforms.merging import Merged, initial_values, merged
from steptwin.host.record.waveforms.signal import Signal, SignalKind
from steptwin.host.record.waveforms.text import Text, constant, decimals, lines, matrix
from steptwin.host.record.waveforms.timebase import TimeScale, Window

_TYPES: Final = {SignalKind.WIRE: "wire 1", SignalKind.REAL: "real 64", SignalKind.TEXT: "string 1"}
_BEFORE: Final = {SignalKind.WIRE: "", SignalKind.REAL: "r", SignalKind.TEXT: "s"}
_BEHIND: Final = {SignalKind.WIRE: "", SignalKind.REAL: " ", SignalKind.TEXT: " "}
"""What stands around a value, in front of the signal's code."""

_FIRST_CODE: Final = ord("!")
_CODES: Final = 94
"""The printable characters of ASCII, of which codes are made."""


def vcd(signals: Sequence[Signal], window: Window, scale: TimeScale, title: str) -> Iterator[bytes]:
    """A file in pieces. Its instants count from power-up, as those of edges.npz and bus.log.

    Raises:
        InputError: a pulse is too short for the scale, as `merged` has it.
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
    """The changes, with an instant in front of those that do not share the one before."""
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
    """A signal's code: one character, two from the 95th signal on."""
    more, last = divmod(i, _CODES)
    return (_code(more - 1) if more else "") + chr(_FIRST_CODE + last)
