"""Record a live board piece by piece: the recording is readable however the board ends.

Memory does not grow with the recording: it is on disk, in the files of `unfinished`, and edges.npz is made from them
at the end.
"""

import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from steptwin.host.common.errors import InputError, RecordingError
from steptwin.host.common.own_files import refuse_link
from steptwin.host.common.whole_file import append, whole_file, write_json, write_whole
from steptwin.host.record.folder.digests import digests
from steptwin.host.record.folder.edges_file import (
    ANGLE_TYPES,
    ARRAY_TYPES,
    EDGE_TYPES,
    RARE_TYPES,
    angle_column,
    edge_arrays,
    header_arrays,
)
from steptwin.host.record.folder.layout import (
    BUS_LOG,
    EDGES,
    FOLDER_VERSION,
    RECORDING,
    REPLAY_JOB,
    REPORT,
    ROBOT,
    TEST_JOB,
    TRAJECTORY,
    VERSION_KEY,
)
from steptwin.host.record.folder.report_file import read_report
from steptwin.host.record.folder.unfinished import HEADER, MARKS, PLAN, Header, Mark, unfinished
from steptwin.host.record.folder.writing import older_files
from steptwin.host.verify import AxisEvidence
from steptwin.protocol.timer import COUNTS_PER_SECOND

_OR_REPLACE = ", or replace=True"


def keep_recording(out: Path | str, or_else: str = "") -> None:
    """Raise InputError if a folder has the recording of a live board, with or without an end, or others' files."""
    folder = Path(out)
    others = [name for name in (ROBOT, TRAJECTORY) if (folder / name).exists()]
    if others and not any((folder / name).exists() for name in (REPORT, EDGES, RECORDING)):
        raise _kept(out, f"{others[0]}, which no run has written", or_else)
    if unfinished(folder):
        raise _kept(out, "the recording of a live board that was interrupted, or still runs", or_else)
    if (folder / EDGES).exists() and _live(folder):
        raise _kept(out, "the recording of a live board", or_else)


def keep_any_run(out: Path | str) -> None:
    """Raise InputError if a folder has the recording of a live board, or any other run."""
    keep_recording(out, _OR_REPLACE)
    if (Path(out) / EDGES).exists():
        raise _kept(out, "a run", _OR_REPLACE)


def keep_log(log: Path | str) -> None:
    """Raise InputError if a file has any content; pipes and devices have none."""
    path = Path(log)
    if path.is_file() and path.stat().st_size:
        raise InputError(f"log={log}: exists: take another file, such as {quote(str(_free(path)))}{_OR_REPLACE}")


def _live(folder: Path) -> bool:
    """Return whether edges may be a live board's; without a readable report they may (docs/run-folder.md)."""
    try:
        report = read_report(folder)
        return report.passed is None and report.run.job not in (TEST_JOB, REPLAY_JOB)
    except InputError:
        return True


def _kept(out: Path | str, what: str, or_else: str) -> InputError:
    return InputError(f"out={out}: holds {what}: take another folder, such as {quote(str(_free(Path(out))))}{or_else}")


def _free(path: Path) -> Path:
    """Return the first of NAME-2, NAME-3, ... that does not exist."""
    names = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(2))
    return next(name for name in names if not name.exists())


_CHUNK_BYTES = 1 << 20


class PlanRows(NamedTuple):
    """New rows of a plan's trajectory.csv; the very first one is the file's head."""

    number: int
    rows: Sequence[str]


@dataclass(frozen=True, slots=True)
class Piece:
    """Everything since the last piece.

    Attributes:
        axes: edges of each axis.
        log: lines of the bus log.
        plans: new rows of each plan.
        mark: end of the recording with this piece; the recording sets `frames`, `plan_from` and `plan_to`.
        plan_number: number of the plan of the mark's motion; 0 without one.
    """

    axes: Sequence[AxisEvidence]
    log: Sequence[str]
    plans: Sequence[PlanRows]
    mark: Mark
    plan_number: int = 0


class Recording:
    """A recording in progress in the folder of a run.

    An error of writing ends the recording without an exception: `failure` has it, and what was recorded before remains.

    Attributes:
        failure: why the recording has ended early; None if it has not.
    """

    def __init__(self, folder: Path, header: Header, robot_toml: str) -> None:
        """Begin a recording in place of the folder's content.

        Raises:
            OSError: a file cannot be written.
        """
        self.failure: RecordingError | None = None
        self._folder = folder
        self._header = header
        self._parts = folder / RECORDING
        self._mark = Mark()
        self._sizes: dict[str, int] = {}
        """Size of each file in `recording.part` at the last mark, in bytes."""
        self._plans_from: dict[int, int] = {}
        """Place of each plan's first row in the plans' file, by number."""
        refuse_link(self._parts)
        (self._parts / HEADER).unlink(missing_ok=True)
        if self._parts.exists():
            shutil.rmtree(self._parts)
        self._parts.mkdir()
        try:
            write_json(self._parts / HEADER, header.document())  # from here on the folder has a recording
        except OSError:
            shutil.rmtree(self._parts)
            raise
        for name in older_files():
            (folder / name).unlink(missing_ok=True)
        (folder / BUS_LOG).touch()
        write_whole(folder / ROBOT, robot_toml)

    @property
    def until_s(self) -> float:
        """Seconds since power-up that are recorded completely."""
        return self._mark.until_counts / COUNTS_PER_SECOND

    def append(self, piece: Piece) -> None:
        """Record a piece; do nothing once the recording has ended."""
        if self.failure:
            return
        try:
            self._append(piece)
        except OSError as error:
            self._fail(error)

    def finish(self, document: Mapping[str, Any]) -> None:
        """Complete the folder, with `document` as report.json; do nothing once the recording has ended.

        `recording.part` remains until the folder is complete.
        """
        if self.failure:
            return
        try:
            if self._mark.no_plan is None and not self._mark.in_motion:
                self._write_plan()
            self._write_edges()
            report = {**document, VERSION_KEY: FOLDER_VERSION, **digests(self._folder)}
            write_json(self._folder / REPORT, report)
            (self._parts / HEADER).unlink()
            shutil.rmtree(self._parts, ignore_errors=True)  # on Windows, a file that another program reads may stay
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        self.failure = RecordingError(
            f"{error.filename}: {error.strerror}: the recording in {self._folder} ends at {self.until_s:.3f} s"
        )
        self.failure.__cause__ = error

    def _know_limits(self, axes: Sequence[AxisEvidence]) -> None:
        """Write the header again if a driver has further limits, before their violations are recorded."""
        known = tuple(
            total._replace(limits=axis.violations.limits) for total, axis in zip(self._header.axes, axes, strict=True)
        )
        if known != self._header.axes:
            self._header = replace(self._header, axes=known)
            write_json(self._parts / HEADER, self._header.document())

    def _append(self, piece: Piece) -> None:
        if piece.axes:
            self._know_limits(piece.axes)
        if piece.log:
            append(self._folder / BUS_LOG, "".join(piece.log).encode())
        grown: dict[str, int] = {}
        for key, data in self._data(piece):
            append(self._parts / key, data)
            grown[key] = grown.get(key, self._sizes.get(key, 0)) + len(data)
        mark = replace(
            piece.mark,
            frames=self._mark.frames + len(piece.log),
            plan_from=self._plans_from.get(piece.plan_number, 0),
            plan_to=self._plans_from.get(piece.plan_number + 1, 0),
        )
        append(self._parts / MARKS, mark.line(self._mark, grown).encode())
        self._mark = mark
        self._sizes |= grown

    def _write_plan(self) -> None:
        with (self._parts / PLAN).open("rb") as plans, whole_file(self._folder / TRAJECTORY) as file:
            plans.seek(self._mark.plan_from)
            left = (self._mark.plan_to or self._sizes.get(PLAN, 0)) - self._mark.plan_from
            while left > 0 and (rows := plans.read(min(left, _CHUNK_BYTES))):
                file.write(rows)
                left -= len(rows)

    def _write_edges(self) -> None:
        with whole_file(self._folder / EDGES) as file, ZipFile(file, "w") as archive:
            for key, value in header_arrays(self._mark.start_counts, self._header.axes).items():
                with archive.open(_member(key), "w") as member:
                    np.lib.format.write_array(member, np.asarray(value))
            for axis in self._header.axes:
                angles = angle_column(axis.per_full_step)
                for column, code in {**EDGE_TYPES, angles: ANGLE_TYPES[angles]}.items():
                    self._write_array(archive, f"{axis.name}_{column}", np.dtype(code))
                for column, code in RARE_TYPES.items():
                    if f"{axis.name}_{column}" in self._sizes:
                        self._write_array(archive, f"{axis.name}_{column}", np.dtype(code))

    def _write_array(self, archive: ZipFile, key: str, value_type: np.dtype[Any]) -> None:
        shape = (self._sizes.get(key, 0) // value_type.itemsize,)
        description = {"descr": value_type.str, "fortran_order": False, "shape": shape}
        with archive.open(_member(key), "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, description)
            if key in self._sizes:
                with (self._parts / key).open("rb") as values:
                    shutil.copyfileobj(values, member, _CHUNK_BYTES)

    def _data(self, piece: Piece) -> Iterable[tuple[str, bytes]]:
        """Yield the new bytes of each growing file; note where a plan begins."""
        for axis in piece.axes:
            for key, values in edge_arrays(axis).items():
                if values.size:
                    code = ARRAY_TYPES[key.removeprefix(f"{axis.name}_")]
                    yield key, values.astype(code, copy=False).tobytes()
        size = self._sizes.get(PLAN, 0)
        for number, rows in piece.plans:
            self._plans_from.setdefault(number, size)
            data = "".join(rows).encode()
            size += len(data)
            yield PLAN, data


def _member(key: str) -> ZipInfo:
    """Return an archive member without a time of day, as numpy does; equal arrays give equal files."""
    info = ZipInfo(f"{key}.npy")
    info.compress_type = ZIP_DEFLATED
    return info
