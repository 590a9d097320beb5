"""Merge the changes of all signals into one order of time, stretch by stretch, as text for millions of lines.

Text is columns of characters: uint8 matrices with a row for each line. A 0 in a matrix stands for no character.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms.signal import Signal, SignalKind, TimeScale, Values, Window, stretches
from steptwin.protocol.timer import COUNTS_PER_SECOND

Text = NDArray[np.uint8]

NS_PER_S = 1_000_000_000

_DIGITS = 4
_ZERO = ord("0")


def _four_digits() -> Text:
    numbers = np.arange(10**_DIGITS)
    return np.stack([numbers // 10**i % 10 + _ZERO for i in reversed(range(_DIGITS))], axis=1).astype(np.uint8)


_FOUR_DIGITS = _four_digits()


def decimals(values: Int64Array) -> Text:
    """Return whole numbers, not negative, as text of shape (n, width) without leading zeros."""
    width = len(str(values.max(initial=0)))
    digits = padded_decimals(values, width)
    if values.size and values.min() >= 10 ** (width - 1):
        return digits
    written = np.maximum.accumulate(digits != _ZERO, axis=1)
    written[:, -1] = True
    return digits * written


def padded_decimals(values: Int64Array, width: int) -> Text:
    """Return the last `width` digits of whole numbers, shape (n, width), with leading zeros."""
    groups = []
    for _ in range(-(-width // _DIGITS)):
        higher = values // 10**_DIGITS
        groups.append(_FOUR_DIGITS[values - higher * 10**_DIGITS])
        values = higher
    return np.concatenate(groups[::-1], axis=1)[:, -width:]


def seconds(ns: Int64Array) -> Text:
    """Return times in seconds with nine decimals, and with a sign if negative."""
    whole, rest = np.divmod(np.abs(ns), NS_PER_S)
    sign = np.where(ns < 0, np.uint8(ord("-")), np.uint8(0))[:, np.newaxis]
    return np.concatenate([sign, decimals(whole), constant(".", ns.size), padded_decimals(rest, 9)], axis=1)


def constant(text: str, rows: int) -> Text:
    """Return the same text in each row."""
    return np.tile(np.frombuffer(text.encode(), np.uint8), (rows, 1))


def chosen(texts: Sequence[str], index: NDArray[np.integer]) -> Text:
    """Return in each row the text of that index."""
    rows: Text = matrix(texts)[index]
    return rows


def matrix(texts: Sequence[str]) -> Text:
    """Return a row for each text."""
    rows = np.array([text.encode() for text in texts], dtype=np.bytes_)
    return rows.view(np.uint8).reshape(len(texts), rows.itemsize)


def stacked(texts: Sequence[Text]) -> Text:
    """Return the rows of all matrices below each other."""
    rows = np.zeros((sum(len(text) for text in texts), max(text.shape[1] for text in texts)), np.uint8)
    end = 0
    for text in texts:
        rows[end : end + len(text), : text.shape[1]] = text
        end += len(text)
    return rows


def spelt(values: NDArray[np.generic], spell: Callable[[object], str]) -> Text:
    """Return each value as text; call `spell` once for each distinct value."""
    different, index = np.unique(values, return_inverse=True)
    return chosen([spell(value) for value in different.tolist()], index)


def lines(*columns: Text) -> bytes:
    """Return the bytes of the columns side by side, row after row."""
    return np.concatenate(columns, axis=1).tobytes().translate(None, b"\0")


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
