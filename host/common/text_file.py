"""Read a text file that a user named, up to a limit."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISREG
from typing import TextIO

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import size_text


def read_text(path: str, bytes_max: int, encoding: str = "utf-8") -> str:
    """Return a file's text; raise InputError, without the path, if it cannot be read, is too long or is not UTF-8."""
    with opened_text(path, bytes_max, encoding) as file:
        text = file.read(bytes_max + 1)
    if len(text) > bytes_max:  # a pipe or a device, whose length nothing tells
        raise _too_long("more", bytes_max)
    return text


@contextmanager
def opened_text(path: str, bytes_max: int, encoding: str = "utf-8") -> Iterator[TextIO]:
    """Open a text for the block. A regular file that is too long is refused before anything is read.

    Raises:
        InputError: the file cannot be read, by the block either, is too long or is not UTF-8; without the path.
    """
    try:
        with Path(path).open(encoding=encoding) as file:
            status = os.fstat(file.fileno())
            if S_ISREG(status.st_mode) and status.st_size > bytes_max:
                raise _too_long(size_text(status.st_size), bytes_max)
            yield file
    except OSError as error:
        raise InputError(error.strerror or "cannot be read") from error
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text") from error
    except ValueError as error:  # the name contains a NUL character
        raise InputError(f"is not a file name: {error}") from error


def _too_long(has: str, bytes_max: int) -> InputError:
    return InputError(f"has {has}: at most {size_text(bytes_max)} are read")
