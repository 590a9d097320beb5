"""edges.npz: every edge and every step that a driver accepted, as arrays named JOINT_WHAT.

A live board does not know how many there will be: it appends them to one plain file for each array, in `edges.part`,
and makes edges.npz of these when it ends. Whatever kills it leaves them there.
"""

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib.npyio import NpzFile

from host.errors import InputError
from host.verify import COUNTS_PER_SECOND, AxisEvidence, Evidence

_ARRAYS: Final[dict[str, np.dtype[Any]]] = {
    "clk_rise_counts": np.dtype("<i8"),
    "clk_fall_counts": np.dtype("<i8"),
    "dir_edge_counts": np.dtype("<i8"),
    "dir_levels": np.dtype("<i1"),
    "step_counts": np.dtype("<i8"),
    "step_signs": np.dtype("<i1"),
}
"""The arrays of each axis, by the evidence's attributes."""
_FIRST_KEY: Final = "_start_steps"
"""Each axis has this one: so its name is found."""


class AxisTotals(NamedTuple):
    """What is known of an axis when its edges are complete."""

    name: str
    start_steps: int
    violations: int


class Edges(NamedTuple):
    """What is in the file; `start_counts` is t = 0 of the last motion that a SYNC has started, if there was one."""

    start_counts: int | None
    axes: tuple[AxisEvidence, ...]


def write_edges(path: Path, evidence: Evidence) -> None:
    """Write the edges of a run that is over."""
    totals = [AxisTotals(axis.name, axis.start_steps, axis.violations) for axis in evidence.axes]
    arrays: dict[str, Any] = _scalars(evidence.start_counts, totals)
    for axis in evidence.axes:
        arrays |= {f"{axis.name}_{what}": getattr(axis, what) for what in _ARRAYS}
    np.savez_compressed(path, **arrays)


def _scalars(start_counts: int | None, axes: Sequence[AxisTotals]) -> dict[str, np.int64]:
    scalars = {"counts_per_second": np.int64(COUNTS_PER_SECOND)}
    if start_counts is not None:
        scalars["start_counts"] = np.int64(start_counts)
    for axis in axes:
        scalars[f"{axis.name}{_FIRST_KEY}"] = np.int64(axis.start_steps)
        scalars[f"{axis.name}_violations"] = np.int64(axis.violations)
    return scalars


def read_edges(path: Path) -> Edges:
    """Read what `write_edges` or `EdgeSpool` has written.

    Raises:
        InputError: there is no such file, or it is not one of these.
    """
    try:
        with path.open("rb") as file, NpzFile(file) as arrays:
            return _edges({key: arrays[key] for key in arrays.files})
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except (BadZipFile, KeyError, ValueError) as error:
        raise InputError(f"{path}: is no edges.npz: {error}") from error


def _edges(arrays: dict[str, Any]) -> Edges:
    names = [key.removesuffix(_FIRST_KEY) for key in arrays if key.endswith(_FIRST_KEY)]
    axes = tuple(
        AxisEvidence(
            name=name,
            start_steps=int(arrays[f"{name}{_FIRST_KEY}"]),
            violations=int(arrays[f"{name}_violations"]),
            **{what: arrays[f"{name}_{what}"] for what in _ARRAYS},
        )
        for name in names
    )
    start_counts = arrays.get("start_counts")
    return Edges(None if start_counts is None else int(start_counts), axes)


class EdgeSpool:
    """Edges of a run that goes on: as many as the disk takes."""

    def __init__(self, path: Path, joint_names: tuple[str, ...]) -> None:
        """Begin; edges.npz comes to be at `path` in the end. Raises OSError."""
        self._path = path
        self._parts = path.with_suffix(".part")
        shutil.rmtree(self._parts, ignore_errors=True)
        path.unlink(missing_ok=True)
        self._parts.mkdir()
        self._open = ExitStack()
        self._files: dict[str, BinaryIO] = {
            f"{name}_{what}": self._open.enter_context((self._parts / f"{name}_{what}").open("wb", buffering=0))
            for name in joint_names
            for what in _ARRAYS
        }

    def append(self, axis: AxisEvidence) -> None:
        """Add what has happened at an axis since the last call."""
        for what, dtype in _ARRAYS.items():
            values = getattr(axis, what)
            if values.size:
                self._files[f"{axis.name}_{what}"].write(values.astype(dtype).data)

    def finish(self, start_counts: int | None, axes: Sequence[AxisTotals]) -> None:
        """Make edges.npz, in which the axes are in this order."""
        self._open.close()
        with ZipFile(self._path, "w") as archive:
            for name, value in _scalars(start_counts, axes).items():
                with archive.open(_member(name), "w") as member:
                    np.lib.format.write_array(member, np.asarray(value))
            for name in self._files:
                self._add(archive, name)
        shutil.rmtree(self._parts)

    def _add(self, archive: ZipFile, name: str) -> None:
        part = self._parts / name
        dtype = next(dtype for what, dtype in _ARRAYS.items() if name.endswith(f"_{what}"))
        header = {"descr": dtype.str, "fortran_order": False, "shape": (part.stat().st_size // dtype.itemsize,)}
        with archive.open(_member(name), "w", force_zip64=True) as member, part.open("rb") as values:
            np.lib.format.write_array_header_1_0(member, header)
            shutil.copyfileobj(values, member, 1 << 20)


def _member(name: str) -> ZipInfo:
    """Without the time of day, so that equal arrays make equal files, as numpy does it."""
    info = ZipInfo(f"{name}.npy")
    info.compress_type = ZIP_DEFLATED
    return info
