"""Text by the million: columns of characters as uint8 matrices with a row for each line, in which 0 is no character."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from steptwin.host.verify.evidence import Int64Array

Text = NDArray[np.uint8]

NS_PER_S = 1_000_000_000

_DIGITS = 4
_ZERO = ord("0")


def _four_digits() -> Text:
    numbers = np.arange(10**_DIGITS)
    return np.stack([numbers // 10**i % 10 + _ZERO for i in reversed(range(_DIGITS))], axis=1).astype(np.uint8)


_FOUR_DIGITS = _four_digits()


def decimals(values: Int64Array) -> Text:
    """Whole numbers, none negative, shape (n, width); leading zeros are no characters."""
    width = len(str(values.max(initial=0)))
    digits = padded_decimals(values, width)
    if values.size and values.min() >= 10 ** (width - 1):
        return digits
    written = np.maximum.accumulate(digits != _ZERO, axis=1)
    written[:, -1] = True
    return digits * written


def padded_decimals(values: Int64Array, width: int) -> Text:
    """The last `width` digits of whole numbers, shape (n, width), with leading zeros."""
    groups = []
    for _ in range(-(-width // _DIGITS)):
        higher = values // 10**_DIGITS
        groups.append(_FOUR_DIGITS[values - higher * 10**_DIGITS])
        values = higher
    return np.concatenate(groups[::-1], axis=1)[:, -width:]


def seconds(ns: Int64Array) -> Text:
    """Times in seconds with nine decimals, negative ones with their sign."""
    whole, rest = np.divmod(np.abs(ns), NS_PER_S)
    sign = np.where(ns < 0, np.uint8(ord("-")), np.uint8(0))[:, np.newaxis]
    return np.concatenate([sign, decimals(whole), constant(".", ns.size), padded_decimals(rest, 9)], axis=1)


def constant(text: str, rows: int) -> Text:
    """The same text in each row."""
    return np.tile(np.frombuffer(text.encode(), np.uint8), (rows, 1))


def chosen(texts: Sequence[str], index: NDArray[np.integer]) -> Text:
    """In each row one of some texts, by its index."""
    rows: Text = matrix(texts)[index]
    return rows


def matrix(texts: Sequence[str]) -> Text:
    """A row for each text."""
    rows = np.array([text.encode() for text in texts], dtype=np.bytes_)
    return rows.view(np.uint8).reshape(len(texts), rows.itemsize)


def stacked(texts: Sequence[Text]) -> Text:
    """All of their rows below each other."""
    rows = np.zeros((sum(len(text) for text in texts), max(text.shape[1] for text in texts)), np.uint8)
    end = 0
    for text in texts:
        rows[end : end + len(text), : text.shape[1]] = text
        end += len(text)
    return rows


def spelt(values: NDArray[np.generic], spell: Callable[[object], str]) -> Text:
    """Each value as text: every different one is spelt once."""
    different, index = np.unique(values, return_inverse=True)
    return chosen([spell(value) for value in different.tolist()], index)


def lines(*columns: Text) -> bytes:
    """The columns beside each other, row after row."""
    return np.concatenate(columns, axis=1).tobytes().translate(None, b"\0")
