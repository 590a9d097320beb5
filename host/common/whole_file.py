"""Write files so that they appear whole or not at all, or grow; an error names the file."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file for writing that appears under its name, or replaces an older one, when the block ends normally.

    Until then it is NAME.part in the same folder; an exception in the block deletes it. A pipe or a device is written
    to directly. If the file cannot be written, OSError names `path`.
    """
    directly = path.exists() and not path.is_file()
    try:
        with path.open("wb") if directly else _replacement(Path(os.path.realpath(path))) as file:
            yield file
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def _replacement(path: Path) -> Iterator[BinaryIO]:
    part = path.with_name(f"{path.name}.part")
    file = part.open("wb")
    try:
        with file:
            yield file
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def append(path: Path, data: bytes) -> None:
    """Append to a file, made if missing; if not all can be written, OSError names `path`."""
    try:
        with path.open("ab") as file:
            file.write(data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
