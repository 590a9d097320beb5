"""Merge the changes of all signals into one order of time, stretch by stretch."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms.signal import Signal, SignalKind, Values, stretches
from steptwin.host.record.waveforms.text import Text, chosen, spelt, stacked
from steptwin.host.record.waveforms.timebase import TimeScale, Window
from steptwin.protocol.timer import COUNTS_PER_SECOND


class TooFastForScaleError(InputError):
    """Two changes of a wire fall on the same instant of a time scale."""


@dataclass(frozen=True, slots=True)
class Merged:
    """Changes in order of time; changes at one instant are in the order of the signals.

    Attributes:
        instants: shape (n,), instant of each change, in units of the scale.
        which: shape (n,), index of the signal.
        values: shape (n, width), text of each new value.
    """

    instants: Int64Array
    which: NDArray[np.intp]
    values: Text


def merged(signals: Sequence[Signal], window: Window, scale: TimeScale) -> Iterator[Merged]:
    """Yield all changes after the window's beginning up to and including its end, without empty stretches.

    Raises:
        TooFastForScaleError: both ends of a wire's pulse or pause fall on the same instant of the scale.
    """
    for after, until in stretches(signals, window, scale):
        parts = [_part(signal, window, scale, after, until) for signal in signals]
        if any(instants.size for instants, _ in parts):
            yield _merged(parts)


def initial_values(signals: Sequence[Signal], window: Window) -> Text:
    """Return the value of each signal at the beginning of the window, a row for each signal."""
    return stacked([_text(signal, np.array([signal.changes.at(window.from_counts)])) for signal in signals])


def _text(signal: Signal, values: Values) -> Text:
    """Return values of one signal as text: 0 or 1, a number with all its digits, or one of the signal's texts."""
    if signal.kind is SignalKind.WIRE:
        return chosen(("0", "1"), values)
    if signal.kind is SignalKind.TEXT:
        return chosen(signal.texts, values)
    return spelt(values, repr)


def _part(signal: Signal, window: Window, scale: TimeScale, after: int, until: int) -> tuple[Int64Array, Text]:
    """Return one signal's changes; the last one at an instant counts, but a wire must not have several there."""
    counts, values = signal.changes.between(after, until)
    instants = scale.rounded(counts)
    again = np.flatnonzero(instants[1:] == instants[:-1])
    if again.size and signal.kind is SignalKind.WIRE:
        first, second = counts[again[0] : again[0] + 2].tolist()
        raise TooFastForScaleError(
            f"{signal.name}: changes twice within {(second - first) / COUNTS_PER_SECOND * 1e6:.3g} us at"
            f" t = {window.time_s(first):.6f} s, too fast for a time scale of {scale.vcd}: choose a finer one"
        )
    return np.delete(instants, again), _text(signal, np.delete(values, again))


def _merged(parts: list[tuple[Int64Array, Text]]) -> Merged:
    instants = np.concatenate([instants for instants, _ in parts])
    which = np.repeat(np.arange(len(parts)), [instants.size for instants, _ in parts])
    order = np.argsort(instants, kind="stable")
    return Merged(instants[order], which[order], stacked([text for _, text in parts])[order])
