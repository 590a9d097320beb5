"""Build text for millions of lines: columns of characters as uint8 matrices with a row for each line.

A 0 in a matrix stands for no character.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array

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
