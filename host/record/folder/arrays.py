"""The arrays of an .npz file by key, each checked for kind, shape and order before anybody uses it."""

import zlib
from enum import StrEnum
from typing import Any, Final, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder.layout import ContradictionError
from steptwin.host.verify.evidence import Int8Array, Int16Array, Int64Array

Choice = TypeVar("Choice", bound=StrEnum)

UNREADABLE: Final = (BadZipFile, EOFError, OSError, ValueError, zlib.error)
"""What numpy raises for a file that is none of its own, or is damaged."""


class Arrays:
    """The file's arrays by key, each checked for kind and shape; what is wrong is said with the key in front."""

    def __init__(self, stored: Any) -> None:  # NpzFile, whose type numpy gives no name for its values
        self._stored = stored

    def integer(self, key: str) -> int:
        value = self._array(key)
        if value.ndim != 0 or value.dtype.kind != "i":
            raise InputError(f"{key}: is not one whole number")
        return int(value)

    def names(self, key: str) -> tuple[str, ...]:
        value = self._array(key)
        if value.ndim != 1 or value.dtype.kind != "U":
            raise InputError(f"{key}: is not a list of names")
        return tuple(value.tolist())

    def choice(self, key: str, choices: type[Choice]) -> Choice:
        value = self._array(key)
        if value.ndim != 0 or value.dtype.kind != "U":
            raise InputError(f"{key}: is not one text")
        if str(value) not in list(choices):
            raise InputError(f"{key}: {str(value)!r} is none of {', '.join(choices)}")
        return choices(str(value))

    def counts(self, key: str) -> Int64Array:
        """Instants: sorted, none before power-up."""
        values = self._integers(key).astype(np.int64, copy=False)
        if values.size and (values[0] < 0 or (np.diff(values) < 0).any()):
            raise ContradictionError(f"{key}: the instants are not in order of time")
        return values

    def signs(self, key: str, choices: tuple[int, int], like: str, length: int) -> Int8Array:
        """One of two numbers for each element of another array."""
        values = self.small(key, choices, like, length).astype(np.int8)
        if not np.isin(values, choices).all():
            raise ContradictionError(f"{key}: holds other numbers than {choices[0]} and {choices[1]}")
        return values

    def small(self, key: str, bounds: tuple[int, int], like: str, length: int) -> Int16Array:
        """A whole number within bounds for each element of another array."""
        values = self._integers(key)
        _check_length(key, values, like, length)
        if values.size and not bounds[0] <= values.min() <= values.max() <= bounds[1]:
            raise ContradictionError(
                f"{key}: goes from {values.min()} to {values.max()}, beyond {bounds[0]}..{bounds[1]}"
            )
        return values.astype(np.int16)

    def numbers(self, key: str, like: str, length: int) -> FloatArray:
        """A number for each element of another array."""
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
            try:
                return np.asarray(self._stored[key])
            except UNREADABLE as error:
                raise InputError(f"cannot be read: {error}") from error


def _check_length(key: str, values: NDArray[Any], like: str, length: int) -> None:
    if values.size != length:
        raise ContradictionError(f"{key}: {values.size} of them, but {length} {like}")
