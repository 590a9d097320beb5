"""Write files atomically, or append to them; an error names the file, and no symbolic link is followed.

Files that belong together appear together, so none is beside a file of an older set.
"""

import json
import os
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final

from steptwin.host.common.own_files import no_links, refuse_link

_STEM_CHARS: Final = 100
"""Characters of a file's name in the name of its temporary file, so this name is not too long for the system."""


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file for writing that appears under its name, or replaces an older one, when the block ends normally.

    Until then it is in the same folder under an unpredictable name; an exception in the block deletes it. Pipes with a
    reader and devices are written directly. If the file cannot be written, or its name is a symbolic link, OSError
    names `path`.
    """
    try:
        if path.exists() and not path.is_file():
            with open(path, "wb", opener=no_links) as stream:
                yield stream
        else:
            with replacement(path) as part, part.open("wb") as file:
                yield file
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def replacement(path: Path) -> Iterator[Path]:
    """Yield an empty file that becomes `path` when the block ends normally; an exception in the block deletes it.

    Raises:
        OSError: `path` is a symbolic link, or cannot be written.
    """
    refuse_link(path)
    part = path.with_name(f"{path.name[:_STEM_CHARS]}.{secrets.token_hex(8)}.part")
    os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    try:
        yield part
        _put(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


@contextmanager
def files_together(folder: Path, first: str = "", stale: Iterable[str] = ()) -> Iterator[Path]:
    """Yield an empty folder for files that are moved to `folder` when the block ends normally.

    An exception in the block, such as for a full disk, does not change `folder`. An OSError names the final path of the
    file.

    Args:
        folder: an existing folder.
        first: name of the file that is moved before the others.
        stale: names of files in `folder` that are then removed, unless the block has written them.
    """
    new = folder / f"new.{secrets.token_hex(8)}.part"
    try:
        new.mkdir()
        yield new
        written = sorted((path.name for path in new.iterdir()), key=lambda name: (name != first, name))
        for name in written:
            refuse_link(folder / name)
        for name in written:
            _put(new / name, folder / name)
        for name in {*stale} - {*written}:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        if error.filename and Path(error.filename).parent == new:
            raise OSError(error.errno, error.strerror, str(folder / Path(error.filename).name)) from error
        raise
    finally:
        shutil.rmtree(new, ignore_errors=True)


_TRIES: Final = 20
_PAUSE_S: Final = 0.1
"""Number of tries, and pause between them, for a file that another program has open on Windows."""


def _put(part: Path, path: Path) -> None:
    """Rename a temporary file. Only Windows refuses that while another program has the older file open."""
    for left in reversed(range(_TRIES)):
        try:
            part.replace(path)
            return
        except PermissionError as error:
            if getattr(error, "winerror", None) not in (_ACCESS_DENIED, _SHARING_VIOLATION):
                raise
            if not left:
                raise PermissionError(error.errno, "another program has it open: close it there") from error
        time.sleep(_PAUSE_S)


_ACCESS_DENIED: Final = 5
_SHARING_VIOLATION: Final = 32
"""Windows' error codes for a file that another program has open (winerror.h)."""


def append(path: Path, data: bytes) -> None:
    """Append to a file, which is created if missing; if that fails, or it is a link, OSError names `path`."""
    try:
        with open(path, "ab", opener=no_links) as file:
            file.write(data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_whole(path: Path, text: str) -> None:
    """Write a text as a whole file."""
    with whole_file(path) as file:
        file.write(text.encode())


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON document as a whole file."""
    write_whole(path, json.dumps(document, indent=2) + "\n")
