"""Write edges.npz for a live board, which does not know how many edges will come.

The spool appends edges to one plain file for each array, in the folder `edges.part`, and makes edges.npz of these files
at the end. So memory stays bounded, and the edges survive if the board is killed.
"""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.folder.edges import AxisTotals, edge_arrays, header_arrays
from steptwin.host.verify import AxisEvidence

_CHUNK_BYTES = 1 << 20


class EdgeSpool:
    """Edges of a run in progress; every method raises OSError if a file cannot be written."""

    def __init__(self, path: Path) -> None:
        """Begin a spool; `finish` will make edges.npz at `path`."""
        self._path = path
        self._parts = path.with_suffix(".part")
        self._types: dict[str, np.dtype[Any]] = {}
        """Type of the values in each file, little-endian."""
        shutil.rmtree(self._parts, ignore_errors=True)
        path.unlink(missing_ok=True)
        self._parts.mkdir()

    def append(self, axis: AxisEvidence) -> None:
        """Append the edges of an axis since the last call."""
        for key, values in edge_arrays(axis).items():
            if key not in self._types:
                self._types[key] = values.dtype.newbyteorder("<")
                (self._parts / key).touch()
            if values.size:
                with (self._parts / key).open("ab") as part:
                    part.write(values.astype(self._types[key]).data)

    def finish(self, start_counts: int, axes: Sequence[AxisTotals]) -> None:
        """Make edges.npz with the axes in the given order, and delete the spool's files."""
        with whole_file(self._path) as file, ZipFile(file, "w") as archive:
            for key, value in header_arrays(start_counts, axes).items():
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
    """Return an archive member without a time of day, as numpy does: equal arrays make equal files."""
    info = ZipInfo(f"{key}.npy")
    info.compress_type = ZIP_DEFLATED
    return info
