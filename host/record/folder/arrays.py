"""Read the arrays of an .npz file by key, and check kind, shape and order of each."""

from enum import StrEnum
from reprlib import repr as short
from typing import Any, Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray, Int8Array, Int16Array, Int64Array
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder.layout import ContradictionError

Choice = TypeVar("Choice", bound=StrEnum)

INSTANT_MAX: Final = 1 << 53
"""Last instant that a recording may have, in counts: 4 years. Floats hold it exactly, and 10 times as many
nanoseconds are still int64."""


class ArrayStore(Protocol):
    """Arrays by key, such as those of an .npz file."""

    def __contains__(self, key: str) -> bool: ...

    def array(self, key: str) -> NDArray[Any]:
        """Return an array of numbers or texts; raise InputError if it cannot be read."""
        ...


class Arrays:
    """Checked access to the file's arrays.

    Each method takes a key and raises InputError if the array is missing or has another kind or shape, and
    ContradictionError if its values do not fit another array; the message begins with the key.
    """

    def __init__(self, stored: ArrayStore) -> None:
        self._stored = stored

    def __contains__(self, key: str) -> bool:
        return key in self._stored

    def integer(self, key: str, bounds: tuple[int, int]) -> int:
        """Return one whole number within bounds."""
        value = self._array(key)
        if value.ndim != 0 or value.dtype.kind != "i":
            raise InputError(f"{key}: is not one whole number")
        if not bounds[0] <= value <= bounds[1]:
            raise ContradictionError(f"{key}: {value} is beyond {bounds[0]}..{bounds[1]}")
        return int(value)

    def instant(self, key: str) -> int:
        """Return one instant, in counts since power-up."""
        return self.integer(key, (0, INSTANT_MAX))

    def names(self, key: str) -> tuple[str, ...]:
        value = self._array(key)
        if value.ndim != 1 or value.dtype.kind != "U":
            raise InputError(f"{key}: is not a list of names")
        return tuple(value.tolist())

    def choice(self, key: str, choices: type[Choice]) -> Choice:
        value = self._array(key)
        if value.ndim != 0 or value.dtype.kind != "U":
            raise InputError(f"{key}: is not one text")
        text = str(value)
        if text not in list(choices):
            raise InputError(f"{key}: {short(text)} is not one of {', '.join(choices)}")
        return choices(text)

    def instants(self, key: str) -> Int64Array:
        """Return sorted instants, in counts since power-up."""
        values = self._integers(key).astype(np.int64, copy=False)
        if values.size and (values[0] < 0 or (values[1:] < values[:-1]).any()):  # a difference could overflow
            raise ContradictionError(f"{key}: the instants are not in order of time")
        if values.size and values[-1] > INSTANT_MAX:
            raise ContradictionError(f"{key}: goes up to {values[-1]} counts, beyond {INSTANT_MAX}")
        return values

    def one_of_two(self, key: str, choices: tuple[int, int], like: str, length: int) -> Int8Array:
        """Return one of two numbers for each of the `length` elements of the array `like`."""
        values = self.bounded(key, choices, like, length).astype(np.int8)
        if not ((values == choices[0]) | (values == choices[1])).all():
            raise ContradictionError(f"{key}: contains other numbers than {choices[0]} and {choices[1]}")
        return values

    def bounded(self, key: str, bounds: tuple[int, int], like: str, length: int) -> Int16Array:
        """Return a whole number within bounds for each of the `length` elements of the array `like`."""
        values = self._integers(key)
        _check_length(key, values, like, length)
        if values.size and not bounds[0] <= values.min() <= values.max() <= bounds[1]:
            raise ContradictionError(
                f"{key}: goes from {values.min()} to {values.max()}, beyond {bounds[0]}..{bounds[1]}"
            )
        return values.astype(np.int16)

    def integers(self, key: str, like: str, length: int) -> Int64Array:
        """Return a whole number for each of the `length` elements of the array `like`."""
        values = self._integers(key)
        _check_length(key, values, like, length)
        return values.astype(np.int64, copy=False)

    def numbers(self, key: str, like: str, length: int) -> FloatArray:
        """Return a number for each of the `length` elements of the array `like`."""
        values = self._array(key)
        if values.ndim != 1 or values.dtype.kind != "f":
            raise InputError(f"{key}: is not a list of numbers")
        _check_length(key, values, like, length)
        return values.astype(np.float64, copy=False)

    def _integers(self, key: str) -> NDArray[Any]:
        values = self._array(key)
        if values.ndim != 1 or values.dtype.kind != "i":
            raise InputError(f"{key}: is not a list of whole numbers")
        return values

    def _array(self, key: str) -> NDArray[Any]:
        if key not in self._stored:
            raise InputError(f"{key}: is missing")
        with prefixed(f"{key}: "):
            return self._stored.array(key)


def _check_length(key: str, values: NDArray[Any], like: str, length: int) -> None:
    if values.size != length:
        raise ContradictionError(f"{key}: {values.size} values, but {like} has {length}")
