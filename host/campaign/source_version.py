"""The version of StepTwin with a digest of the sources that make a run: rows of different code are told apart."""

from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Final

import steptwin

_FOLDERS: Final = ("controller", "emulator", "host", "protocol")
_SUFFIXES: Final = (".py", ".toml")
_DIGITS: Final = 8
"""Digits of the digest: of a thousand versions, two have the same with a chance of 1 in 8600."""


@cache
def source_version() -> str:
    """Return the version and a digest of the sources and robot files as they are now, such as `0.1.0+1f3a09bc`.

    A wheel has the same as the checkout that it was built from, also if some of its modules are compiled.
    """
    return f"{steptwin.__version__}+{digest_of(Path(next(iter(steptwin.__path__))))}"


def digest_of(package: Path) -> str:
    """Return the digest of a package's sources and robot files: of their names and contents."""
    digest = sha256()
    for folder in _FOLDERS:
        root = (package / folder).resolve()  # in a checkout it is a link, which rglob does not follow
        for path in sorted(path for path in root.rglob("*") if path.suffix in _SUFFIXES):
            content = path.read_bytes()
            digest.update(f"{folder}/{path.relative_to(root).as_posix()} {len(content)}\n".encode())
            digest.update(content)
    return digest.hexdigest()[:_DIGITS]
