"""Read the arrays of an untrusted .npz file: declared sizes are checked before memory is allocated.

An .npz file is a ZIP archive (PKWARE APPNOTE.TXT 6.3) of .npy files, one for each array; format 1.0 of .npy is
described in `numpy.lib.format`. Of both formats only the part is read that numpy writes for numbers and texts.
"""

import io
import re
import struct
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from math import prod
from pathlib import Path
from reprlib import repr as short
from typing import IO, Any, Final, Protocol, TypeVar
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import (
    ARRAYS_BYTES_FREE,
    ARRAYS_BYTES_MAX,
    ARRAYS_RATIO_MAX,
    MIB,
    size_text,
)
from steptwin.host.common.own_files import only_files
from steptwin.host.record.folder.layout import ContradictionError

Choice = TypeVar("Choice", bound=StrEnum)

INSTANT_MAX: Final = 1 << 53
"""Last instant that a recording may have, in counts: 4 years. Floats hold it exactly, and 10 times as many
nanoseconds are still int64."""


class ArrayStore(Protocol):
    """Arrays by key, such as those of an .npz file."""

    def __contains__(self, key: str) -> bool: ...

    def array(self, key: str) -> NDArray[Any]:
        """Return an array of numbers or texts; raise InputError if it is unreadable."""
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

    def bounded(self, key: str, bounds: tuple[int, int], like: str, length: int) -> NDArray[Any]:
        """Return a whole number within bounds for each of the `length` elements of the array `like`."""
        values = self._integers(key)
        _check_length(key, values, like, length)
        if values.size and not bounds[0] <= values.min() <= values.max() <= bounds[1]:
            raise ContradictionError(
                f"{key}: goes from {values.min()} to {values.max()}, beyond {bounds[0]}..{bounds[1]}"
            )
        return values

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


_DAMAGED: Final = (
    *(BadZipFile, EOFError, OSError, ValueError, zlib.error, struct.error),  # no archive, or a damaged one
    *(NotImplementedError, RuntimeError, OverflowError),  # features that zipfile does not have; absurd offsets
)
"""Exceptions of zipfile for a file that is no archive, is damaged or uses what zipfile cannot read."""

_NO_ARCHIVE: Final = "File is not a zip file"
"""Message of zipfile for a file without a directory."""

_FLAGS_READ: Final = 1 << 1 | 1 << 2 | 1 << 3 | 1 << 11
"""Allowed flags of a member: compression level, sizes after the data, name in UTF-8."""
_METHODS: Final = (ZIP_STORED, ZIP_DEFLATED)
_VERSION_MAX: Final = 45
"""Highest required version of ZIP: that of files above 4 GiB."""

_DIRECTORY_BYTES_MAX: Final = MIB
"""Largest directory of an archive: 8 axes with 40 arrays each take 35 KiB."""
_CHUNK_BYTES: Final = MIB

_HEAD: Final = struct.Struct("<6sBBH")
"""Begin of an .npy file: mark, version, length of the description."""
_MARK: Final = b"\x93NUMPY"
_DESCRIPTION_CHARS_MAX: Final = 1024
"""Longest description; numpy writes 118 characters for a one-dimensional array with a length of 20 digits."""
_DESCRIPTION: Final = re.compile(
    r"\{'descr': '(?P<type>[<>|](?:[iu][1248]|f[248]|b1)|[<>]U[1-9]\d{0,3})', 'fortran_order': (?:False|True),"
    r" 'shape': \((?P<shape>(?:\d{1,18}, ?)*(?:\d{1,18})?)\), ?\} *\n?",
    re.ASCII,
)
_CODE_MAX: Final = 0x10FFFF
"""Highest code of a character (Unicode, section 3.4, D9)."""
_SURROGATES: Final = 0xD800 >> 11
"""The upper bits of the codes D800 to DFFF, which no character has (D71 to D73)."""


@contextmanager
def opened_npz(path: Path) -> Iterator["NpzFile"]:
    """Open an .npz file for the block.

    Raises:
        InputError: the file is not an .npz file, or its arrays are too large, in all or for the size of the file.
    """
    with ExitStack() as opened:
        with _damage_as_input_error():
            archive = opened.enter_context(ZipFile(opened.enter_context(_BoundedFile(path, opener=only_files))))
        yield NpzFile(archive, path.stat().st_size)


@contextmanager
def _damage_as_input_error() -> Iterator[None]:
    try:
        yield
    except _DAMAGED as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        if reason == _NO_ARCHIVE:
            reason = "it is not an npz file"
        raise InputError(f"cannot be read: {reason or type(error).__name__}") from error


class NpzFile:
    """The arrays of an open archive, by key."""

    def __init__(self, archive: ZipFile, file_bytes: int) -> None:
        """Raise InputError if the declared sizes of all arrays together are above their limits."""
        self._archive = archive
        self._members = {member.filename: member for member in archive.infolist()}
        declared_bytes = sum(member.file_size for member in archive.infolist())
        if declared_bytes > ARRAYS_BYTES_MAX:
            raise InputError(f"its arrays have {size_text(declared_bytes)}, more than {size_text(ARRAYS_BYTES_MAX)}")
        if declared_bytes > max(ARRAYS_RATIO_MAX * file_bytes, ARRAYS_BYTES_FREE):
            raise InputError(
                f"its arrays have {size_text(declared_bytes)}, {declared_bytes / file_bytes:.0f} times the"
                f" {size_text(file_bytes)} of the file: no recording has more than {ARRAYS_RATIO_MAX} times"
            )

    def __contains__(self, key: str) -> bool:
        return f"{key}.npy" in self._members

    def array(self, key: str) -> NDArray[Any]:
        """Return an array of at most two dimensions, of integers, floats or texts.

        Raises:
            InputError: the array is not stored as numpy stores it, or is damaged.
        """
        member = self._members[f"{key}.npy"]
        _check_member(member)
        with _damage_as_input_error(), self._archive.open(member) as content:
            return _array(content, member.file_size)


class _BoundedFile(io.FileIO):
    """A file with bounded reads: zipfile reads directories whole."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _DIRECTORY_BYTES_MAX:
            raise BadZipFile(f"its directory has more than {size_text(_DIRECTORY_BYTES_MAX)}")
        return super().read(_DIRECTORY_BYTES_MAX if size is None or size < 0 else size) or b""


def _check_member(member: ZipInfo) -> None:
    """Raise InputError for a member that needs uncommon features of ZIP files."""
    if member.flag_bits & ~_FLAGS_READ:
        how = "is encrypted" if member.flag_bits & 1 else f"has the flags 0x{member.flag_bits:04X} of a ZIP file"
        raise InputError(f"cannot be read: {how}")
    if member.compress_type not in _METHODS:
        raise InputError(f"cannot be read: compression method {member.compress_type} is neither none nor deflate")
    if member.extract_version > _VERSION_MAX:
        raise InputError(f"cannot be read: needs version {member.extract_version / 10:g} of ZIP, not 4.5 or lower")


def _array(content: IO[bytes], file_bytes: int) -> NDArray[Any]:
    """Return the array of an .npy file with the length declared by the archive."""
    kind, shape, head_bytes = _header(content)
    count = prod(shape)
    if head_bytes + count * kind.itemsize != file_bytes:
        raise InputError(f"its shape {shape} of {kind.str} does not have the {file_bytes - head_bytes} bytes there")
    values = np.empty(count, kind)
    octets, filled = values.view(np.uint8), 0
    while filled < octets.size:
        chunk = content.read(min(_CHUNK_BYTES, octets.size - filled))
        if not chunk:
            raise EOFError(f"ends after {filled} of {octets.size} bytes")
        octets[filled : filled + len(chunk)] = np.frombuffer(chunk, np.uint8)
        filled += len(chunk)
    if content.read(1):  # reading to the end compares the checksum
        raise EOFError("is longer than declared")
    if kind.kind == "U":
        _check_text(values)
    return values.reshape(shape)


def _check_text(values: NDArray[Any]) -> None:
    """Raise InputError for texts with invalid character codes: numpy would make invalid strings from them."""
    codes = values.view(np.dtype(np.uint32).newbyteorder(values.dtype.byteorder))
    if ((codes > _CODE_MAX) | (codes >> 11 == _SURROGATES)).any():
        raise InputError("contains numbers that are no characters")


def _header(content: IO[bytes]) -> tuple[np.dtype[Any], tuple[int, ...], int]:
    """Return type, shape and the number of bytes before the values."""
    head = content.read(_HEAD.size)
    if len(head) < _HEAD.size or not head.startswith(_MARK):
        raise InputError("is not a numpy array")
    _, major, minor, length = _HEAD.unpack(head)
    if (major, minor) != (1, 0):
        raise InputError(f"has version {major}.{minor} of numpy's format, not 1.0")
    if length > _DESCRIPTION_CHARS_MAX:
        raise InputError(f"its description has {length} characters, more than {_DESCRIPTION_CHARS_MAX}")
    found = _DESCRIPTION.fullmatch(content.read(length).decode("latin-1"))
    if not found:
        raise InputError("is not an array of whole numbers, floats or texts")
    shape = tuple(int(size) for size in found["shape"].split(",") if size.strip())
    return np.dtype(found["type"]), shape, _HEAD.size + length
