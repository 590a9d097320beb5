"""Files that are there whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write, which takes its place, and that of an older one, when the block ends without an exception.

    Until then it stands beside that place as NAME.part, and whatever breaks the block off removes it. What is there and
    is no file, such as a pipe or a device, is written to directly.

    Raises:
        OSError: the file cannot be written; it has `path` as its file name.
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
