"""Read a recording that has no end: its board was killed, its disk was full, or its board still runs."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import (
    ARRAYS_BYTES_MAX,
    CSV_BYTES_MAX,
    MARK_CHARS_MAX,
    REPORT_BYTES_MAX,
    check_size,
)
from steptwin.host.common.own_files import only_files, read_text
from steptwin.host.common.tables import Table, json_table
from steptwin.host.record.folder.edges_file import ARRAY_TYPES, EDGE_TYPES, evidence_of, evidence_until, header_arrays
from steptwin.host.record.folder.layout import LIVE_JOB, RECORDING
from steptwin.host.record.folder.npz_file import Arrays
from steptwin.host.record.folder.recording_layout import HEADER, MARKS, PLAN, Header, Mark
from steptwin.host.verify import BusReport, Evidence, RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class UnfinishedRecording:
    """A recording as far as it goes: up to its last mark.

    Attributes:
        folder: the folder of the run.
        header: what was known from the beginning.
        mark: the last mark that is whole and whose files are as long as it says.
        sizes: bytes of each file in `recording.part` up to that mark.
    """

    folder: Path
    header: Header
    mark: Mark
    sizes: Mapping[str, int]

    @property
    def until_s(self) -> float:
        """Seconds since power-up up to which everything is recorded."""
        return self.mark.until_counts / COUNTS_PER_SECOND

    @property
    def interruption(self) -> str:
        """How far the recording goes, in words."""
        return f"the recording has no end: it goes to {self.until_s:.3f} s after power-up"

    def run_info(self) -> RunInfo:
        """Return what a report would say of the run."""
        mark, header = self.mark, self.header
        traffic = BusReport(header.bitrate, mark.frames, mark.load_percent)
        return RunInfo(header.robot, LIVE_JOB, self.until_s, traffic, self.until_s, max(mark.wall_s, 1e-6))

    def evidence(self) -> Evidence:
        """Return the evidence up to the last mark, without the outputs' names.

        Raises:
            InputError: a file cannot be read.
            ContradictionError: the files do not fit each other.
        """
        parts = self.folder / RECORDING
        with prefixed(f"{parts}: "):
            check_size(sum(self.sizes.values()), ARRAYS_BYTES_MAX)
            arrays = Arrays(_ArrayFiles(parts, self))
            return evidence_until(evidence_of(arrays), self.mark.until_counts)

    def plan_text(self) -> str:
        """Return trajectory.csv as far as it was recorded; raise InputError if it cannot be read."""
        path = self.folder / RECORDING / PLAN
        size = (self.mark.plan_to or self.sizes.get(PLAN, 0)) - self.mark.plan_from
        with prefixed(f"{path}: "):
            check_size(size, CSV_BYTES_MAX)
        try:
            with open(path, "rb", opener=only_files) as file:
                file.seek(self.mark.plan_from)
                return file.read(max(size, 0)).decode()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from error


class _ArrayFiles:
    """The arrays of edges.npz, by key: those of the header, and those that grow, each in its file."""

    def __init__(self, parts: Path, recording: UnfinishedRecording) -> None:
        self._parts = parts
        self._sizes = recording.sizes
        self._constant = header_arrays(recording.mark.start_counts, recording.header.axes)
        self._types = {
            f"{axis.name}_{column}": np.dtype(code)
            for axis in recording.header.axes
            for column, code in ARRAY_TYPES.items()
            if column in EDGE_TYPES or f"{axis.name}_{column}" in recording.sizes
        }

    def __contains__(self, key: str) -> bool:
        return key in self._constant or key in self._types

    def array(self, key: str) -> NDArray[Any]:
        """Return an array; raise InputError if its file cannot be read."""
        if key in self._constant:
            return np.asarray(self._constant[key])
        count = self._sizes.get(key, 0) // self._types[key].itemsize
        if not count:
            return np.empty(0, self._types[key])
        try:
            return np.fromfile(self._parts / key, self._types[key], count)
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}") from error


def read_unfinished(folder: Path) -> UnfinishedRecording:
    """Return the recording that a folder holds without its end.

    Raises:
        InputError: the header cannot be read, has another version, or a key is missing or has another kind.
    """
    parts = folder / RECORDING
    with prefixed(f"{parts / HEADER}: "):
        header = Header.of(json_table(read_text(str(parts / HEADER), REPORT_BYTES_MAX)))
    mark, sizes = Mark(), dict[str, int]()
    try:
        for line in _lines(parts / MARKS):
            grown = _grown(parts, line)
            mark = mark.after(line)
            sizes |= grown
    except InputError:  # the line was cut off, or what it tells of was: the recording goes to the mark before
        pass
    return UnfinishedRecording(folder, header, mark, sizes)


def _lines(path: Path) -> Iterator[Table]:
    """Yield each whole line."""
    if not path.is_file():
        return
    with open(path, encoding="utf-8", errors="replace", opener=only_files) as file:
        while (text := file.readline(MARK_CHARS_MAX)).endswith("\n"):
            yield json_table(text)


def _grown(parts: Path, line: Table) -> dict[str, int]:
    """Return the sizes that a line tells; raise InputError if a file is not that long."""
    if "sizes" not in line:
        return {}
    with line.section("sizes") as table:
        sizes = {name: table.integer(name, float(1 << 62)) for name in table}
    for name, size in sizes.items():
        path = parts / name
        if Path(name).name != name or not path.is_file() or not 0 <= size <= path.stat().st_size:
            raise InputError(f"{name}: is shorter than {size} bytes")
    return sizes
