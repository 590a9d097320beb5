"""edges.npz of a live board, which does not know how many edges there will be.

They are appended to one plain file for each array, in `edges.part`, of which edges.npz is made in the end: memory stays
bounded, and whatever kills the board leaves them there.
"""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.folder.edges import AxisTotals, edge_arrays, head
from steptwin.host.verify import AxisEvidence

_CHUNK_BYTES = 1 << 20


class EdgeSpool:
    """Edges of a run that goes on; raises OSError where they cannot be written."""

    def __init__(self, path: Path) -> None:
        """Begin; edges.npz comes to be at `path` in the end."""
        self._path = path
        self._parts = path.with_suffix(".part")
        self._types: dict[str, np.dtype[Any]] = {}
        """Of the values in each file, little-endian."""
        shutil.rmtree(self._parts, ignore_errors=True)
        path.unlink(missing_ok=True)
        self._parts.mkdir()

    def append(self, axis: AxisEvidence) -> None:
        """Add what has happened at an axis since the last call."""
        for key, values in edge_arrays(axis).items():
            if key not in self._types:
                self._types[key] = values.dtype.newbyteorder("<")
                (self._parts / key).touch()
            if values.size:
                with (self._parts / key).open("ab") as part:
                    part.write(values.astype(self._types[key]).data)

    def finish(self, start_counts: int, axes: Sequence[AxisTotals]) -> None:
        """Make edges.npz, with the axes in this order."""
        with whole_file(self._path) as file, ZipFile(file, "w") as archive:
            for key, value in head(start_counts, axes).items():
                with archive.open(_member(key), "w") as member:
                    np.lib.format.write_array(member, np.asarray(value))
            for key, value_type in self._types.items():
                part = self._parts / key
                shape = (part.stat().st_size // value_type.itemsize,)
                description = {"descr": value_type.str, "fortran_order": False, "shape": shape}
                with archive.open(_member(key), "w", force_zip64=True) as member, part.open("rb") as values:
                    np.lib.format.write_array_header_1_0(member, description)
                    shutil.copyfileobj(values, member, _CHUNK_BYTES)
        shutil.rmtree(self._parts)


def _member(key: str) -> ZipInfo:
    """Without the time of day, so that equal arrays make equal files, as numpy does it."""
    info = ZipInfo(f"{key}.npy")
    info.compress_type = ZIP_DEFLATED
    return info
