"""The files of a campaign: its own text and those that it names, beside it or kept in its folder of results."""

from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Final
from urllib.parse import quote

import steptwin
from steptwin.features.campaigns import CAMPAIGN_BYTES_MAX
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MIB
from steptwin.host.common.own_files import made_folder, read_text
from steptwin.host.common.whole_file import write_whole

CAMPAIGN_FILE_BYTES_MAX: Final = 256 * MIB
"""A file that a campaign names is kept with its results: an hour of a trajectory with a point each 10 ms fits."""

_FOLDERS: Final = ("controller", "emulator", "host", "protocol")
_SUFFIXES: Final = (".py", ".toml")
_DIGITS: Final = 8
"""Digits of the digest: of a thousand versions, two have the same with a chance of 1 in 8600."""


@cache
def source_version() -> str:
    """Return the version and a digest of the sources and robot files as they are now, such as `1.0.0+1f3a09bc`.

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


NIGHTLY: Final = "nightly"
"""Name of the campaign over the robots of papers and all faults."""
_CAMPAIGN: Final = "campaign.toml"
_FILES: Final = "files"


@dataclass(frozen=True, slots=True)
class Sources:
    """A campaign's text, and where the files are that it names.

    Attributes:
        name: its file as the user named it, for messages.
        text: the text.
        folder: folder from which the names of files count; None for files kept under their quoted names.
        kept: folder of a campaign's results, where its files are kept; None for a campaign of its own file.
    """

    name: str
    text: str
    folder: Path | None = None
    kept: Path | None = None

    def path(self, name: str) -> str:
        """Return the path of a file that the campaign names."""
        if self.kept is not None:
            return str(self.kept / _FILES / quote(name, safe=""))
        return str((self.folder or Path()) / name)

    def keep(self, folder: Path, names: set[str]) -> None:
        """Keep the campaign and its files in a folder of results, unless they are there.

        Raises:
            InputError: the folder has the results of another campaign.
        """
        texts = {_CAMPAIGN: self.text}
        for name in names:
            with prefixed(f"{name}: "):
                texts[f"{_FILES}/{quote(name, safe='')}"] = read_text(self.path(name), CAMPAIGN_FILE_BYTES_MAX)
        if (folder / _CAMPAIGN).exists():
            for place, text in texts.items():
                path = folder / place
                if not path.is_file() or read_text(str(path), CAMPAIGN_FILE_BYTES_MAX) != text:
                    raise InputError(f"{folder}: has the results of another campaign, whose {place} differs")
            return
        folder.mkdir(parents=True, exist_ok=True)
        for place, text in reversed(texts.items()):  # the campaign comes last: with it the folder is whole
            if place.startswith(f"{_FILES}/"):
                made_folder(folder / _FILES)
            write_whole(folder / place, text)


def sources_of_file(path: str) -> Sources:
    """Read a campaign's file, or by its name the one that StepTwin brings; raise InputError if it cannot be read."""
    if path == NIGHTLY:
        return Sources(path, (files(__package__) / f"{NIGHTLY}.toml").read_text(encoding="utf-8"))
    with prefixed(f"{path}: "):
        return Sources(path, read_text(path, CAMPAIGN_BYTES_MAX), folder=Path(path).parent)


def sources_of_results(folder: Path) -> Sources:
    """Read the campaign in a folder of results; raise InputError for a folder without one."""
    path = folder / _CAMPAIGN
    if not path.is_file():
        raise InputError(f"{folder}: holds no campaign: there is no {_CAMPAIGN} in it")
    with prefixed(f"{path}: "):
        return Sources(str(path), read_text(str(path), CAMPAIGN_BYTES_MAX), kept=folder)
