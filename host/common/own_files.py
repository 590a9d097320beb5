"""Open only files that a user has named: a folder from another person may contain links and pipes.

Writing never follows a symbolic link, because it may lead out of the folder. Reading accepts files only: a pipe could
block the program for ever, and a device has no end. In /dev, whose links and pipes belong to the system, both are
allowed, so /dev/stdout and a shell's <(...) work.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO, Final, TextIO

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import size_text

_NEVER_THROUGH: Final = getattr(os, "O_NOFOLLOW", 0)
_AT_ONCE: Final = getattr(os, "O_NONBLOCK", 0)
"""Flags that Windows does not have: there only an administrator makes links, and pipes are no files."""
_LINK: Final = "is a symbolic link, through which nothing is written: remove it, or take another name"
_NO_FILE: Final = "is no file but a pipe or a device, which is not read"


def only_files(path: str, flags: int) -> int:
    """Open a file for reading, as `opener` of `open`; raise OSError for a pipe or a device, without waiting for it."""
    opened = os.open(path, flags | _AT_ONCE)
    mode = os.fstat(opened).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or (stat.S_ISFIFO(mode) and _of_the_system(path))):
        os.close(opened)
        raise OSError(errno.EINVAL, _NO_FILE, path)
    if _AT_ONCE:
        os.set_blocking(opened, True)
    return opened


def no_links(path: str, flags: int) -> int:
    """Open a file for writing, as `opener` of `open`; raise OSError for a link, or for a pipe that nothing reads."""
    if _of_the_system(path):
        return os.open(path, flags, 0o666)
    refuse_link(Path(path))
    opened = os.open(path, flags | _NEVER_THROUGH | _AT_ONCE, 0o666)
    if _AT_ONCE:
        os.set_blocking(opened, True)
    return opened


def refuse_link(path: Path) -> None:
    """Raise OSError if a path is a symbolic link."""
    if path.is_symlink() and not _of_the_system(str(path)):
        raise OSError(errno.ELOOP, _LINK, str(path))


def made_folder(path: Path) -> Path:
    """Create a folder if it does not exist, and return it; raise OSError if it is a link or not a folder."""
    refuse_link(path)
    path.mkdir(parents=True, exist_ok=True)
    return path


def growing_file(path: Path, mode: str = "wb") -> BinaryIO:
    """Open a file, a pipe or a device for writing or appending, without a buffer; raise OSError for a link."""
    return open(path, mode, buffering=0, opener=no_links)  # type: ignore[return-value]


def _of_the_system(path: str) -> bool:
    return os.path.abspath(path).startswith("/dev/")


_ENCODING: Final = "utf-8-sig"
"""UTF-8, with or without the byte order mark that Excel and Notepad write."""


def read_text(path: Path | str, bytes_max: int) -> str:
    """Return a file's text; raise InputError, without the path, if it cannot be read, is too long or is not UTF-8."""
    with opened_text(path, bytes_max) as file:
        text = file.read(bytes_max + 1)
    if len(text) > bytes_max:  # a pipe, whose length is not known before
        raise _too_long("more", bytes_max)
    return text


def read_old_text(path: Path | str, bytes_max: int) -> str:
    """Return a file's text as `read_text` does; a text that is not UTF-8 is read in the encoding of old Windows."""
    with opened_text(path, bytes_max, "surrogateescape") as file:
        text = file.read(bytes_max + 1)
    if len(text) > bytes_max:
        raise _too_long("more", bytes_max)
    data = text.encode(errors="surrogateescape")
    for encoding in ("utf-8", "cp1252"):
        with suppress(UnicodeDecodeError):
            return data.decode(encoding)
    return data.decode("latin-1")


def is_file(path: Path) -> bool:
    """Return whether a path is a file; False for an impossible name, such as a very long one."""
    try:
        return path.is_file()
    except OSError:
        return False


@contextmanager
def opened_text(path: Path | str, bytes_max: int, errors: str = "strict") -> Iterator[TextIO]:
    """Open a text file for the block; refuse a regular file that is too long before reading it.

    A byte order mark at its beginning, as of Windows programs, is skipped. `errors` is as for `open`.

    Raises:
        InputError: the file cannot be read, also by the block, is too long or is not UTF-8. The message has no path.
    """
    try:
        with open(path, encoding=_ENCODING, errors=errors, opener=only_files) as file:
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
