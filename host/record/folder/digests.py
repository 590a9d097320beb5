"""Detect mixed files of two runs: report.json has a digest of each other file."""

from collections.abc import Mapping
from hashlib import file_digest
from pathlib import Path
from typing import Any

from steptwin.host.common.own_files import only_files
from steptwin.host.record.folder.layout import BUS_LOG, EDGES, FILES, ROBOT, TRAJECTORY, feature_files


def digests(folder: Path) -> dict[str, Any]:
    """Return the digests of a folder's files under their key of report.json."""
    return {FILES: {name: _digest(folder / name) for name in _digested(folder)}}


def of_other_runs(folder: Path, document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the files that differ from a report's digests; empty if the report has none."""
    told = document.get(FILES)
    if not isinstance(told, Mapping):
        return ()
    return tuple(name for name in _digested(folder) if _digest(folder / name) != told.get(name))


def _digested(folder: Path) -> list[str]:
    """Return the files of a folder that determine its verdict."""
    names = (ROBOT, TRAJECTORY, EDGES, *feature_files(), BUS_LOG)
    return [name for name in names if (folder / name).is_file()]


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with open(path, "rb", opener=only_files) as file:
        return file_digest(file, "sha256").hexdigest()
