"""Files of a recording in progress, and reading of one without an end.

`recording.part` is a folder. Its files only grow, and each piece ends with a mark: everything up to the last mark can
be read, however the recording ends. It has no end if its board was killed, its disk was full, or its board still runs.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

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
from steptwin.host.record.folder.edges_file import (
    ARRAY_TYPES,
    EDGE_TYPES,
    AxisTotals,
    angle_column,
    evidence_of,
    evidence_until,
    header_arrays,
)
from steptwin.host.record.folder.layout import (
    FOLDER_VERSION,
    LIVE_JOB,
    RECORDING,
    VERSION_KEY,
    MachineStop,
    check_version,
)
from steptwin.host.record.folder.npz_file import Arrays
from steptwin.host.verify import SIXTEENTHS, BusReport, DriverLimit, Evidence, RunInfo
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND

HEADER: Final = "header.json"
"""File that exists, complete, from the beginning of a recording to its end."""
MARKS: Final = "marks.jsonl"
"""File with a line for each piece: changed values of the mark, and sizes of grown files."""
PLAN: Final = "plan.csv"
"""File with the rows of trajectory.csv of all motions."""
NOTHING: Final = "nothing was recorded"

_COUNTS_MAX: Final = float(1 << 62)
_WHOLE: Final = ("until_counts", "start_counts", "frames", "plan_from", "plan_to", "next_counts", "stopped_counts")
"""Keys of a mark with whole numbers."""


def unfinished(folder: Path) -> bool:
    """Return whether a folder has a recording without an end."""
    return (folder / RECORDING / HEADER).is_file()


@dataclass(frozen=True, slots=True)
class Header:
    """Facts of a recording that are known from its beginning.

    Attributes:
        robot: the robot's name.
        driver_profile: name of the drivers.
        bitrate: of the bus, in bit/s.
        axes: in the order of the joints.
    """

    robot: str
    driver_profile: str
    bitrate: int
    axes: tuple[AxisTotals, ...]

    def document(self) -> dict[str, Any]:
        """Return the header as JSON."""
        axes = [axis._asdict() | {"limits": [asdict(limit) for limit in axis.limits]} for axis in self.axes]
        own = {"robot": self.robot, "driver_profile": self.driver_profile, "bitrate": self.bitrate}
        return {VERSION_KEY: FOLDER_VERSION, **own, "axes": axes}

    @staticmethod
    def of(table: Table) -> "Header":
        """Return the header from a JSON object; raise InputError for a missing key, invalid value or other version."""
        check_version(table.values.get(VERSION_KEY))
        return Header(
            table.text("robot"), table.text("driver_profile"), table.integer("bitrate"), table.each("axes", _totals)
        )


def _totals(axis: Table) -> AxisTotals:
    edge = axis.choice("active_edge", ActiveEdge)
    per_full_step = axis.integer("per_full_step") if "per_full_step" in axis else SIXTEENTHS
    return AxisTotals(axis.text("name"), axis.integer("start_steps"), edge, axis.each("limits", _limit), per_full_step)


def _limit(limit: Table) -> DriverLimit:
    texts = (limit.text(key) for key in ("rule", "broken", "unit", "source"))
    rule, broken, unit, source = texts
    return DriverLimit(rule, broken, limit.number("limit"), unit, source)


@dataclass(frozen=True, slots=True)
class Mark:
    """End of a recording so far.

    Attributes:
        until_counts: instant up to which all edges are recorded.
        start_counts: t = 0 of the displayed motion: the last one with a SYNC and a plan, else the last one; 0 if there
            was none.
        frames: number of frames in the bus log.
        no_plan: why there is no plan of that motion; None if its rows so far are recorded.
        in_motion: True if that motion has not ended.
        plan_from: place of that motion's first row in the plans' file, in bytes.
        plan_to: place after its last row; 0 if that is the end of the file.
        next_counts: instant when a later motion began that is not in the plan; 0 if there was none.
        stopped_counts: instant when the machine was stopped since that motion began; 0 if it was not.
        stopped_by: cause of the stop, as text.
        stopped_in_motion: True if the machine was moving.
        load_percent: load of the bus since power-up.
        wall_s: seconds on the wall clock since power-up.
    """

    until_counts: int = 0
    start_counts: int = 0
    frames: int = 0
    no_plan: str | None = NOTHING
    in_motion: bool = False
    plan_from: int = 0
    plan_to: int = 0
    next_counts: int = 0
    stopped_counts: int = 0
    stopped_by: str = ""
    stopped_in_motion: bool = False
    load_percent: float = 0.0
    wall_s: float = 0.0

    @property
    def stop(self) -> MachineStop | None:
        """Stop of the machine since that motion began; None without one."""
        return MachineStop(self.stopped_counts, self.stopped_by, self.stopped_in_motion) if self.stopped_by else None

    def with_stop(self, stop: MachineStop | None) -> "Mark":
        """Return a copy of the mark with `stop` as the machine's stop."""
        if stop is None:
            return self
        return replace(self, stopped_counts=stop.counts, stopped_by=stop.by, stopped_in_motion=stop.in_motion)

    def line(self, before: "Mark", sizes: Mapping[str, int]) -> str:
        """Return the changes since the last mark as a line, with the sizes in bytes of grown files."""
        old = asdict(before)
        new: dict[str, Any] = {key: value for key, value in asdict(self).items() if value != old[key]}
        return json.dumps(new | ({"sizes": dict(sizes)} if sizes else {})) + "\n"

    def after(self, line: Table) -> "Mark":
        """Return the next mark from its line; raise InputError for an invalid value."""
        values: dict[str, Any] = asdict(self)
        for key in _WHOLE:
            if key in line:
                values[key] = line.integer(key, _COUNTS_MAX)
        for key in ("load_percent", "wall_s"):
            if key in line:
                values[key] = line.number(key)
        for key in ("in_motion", "stopped_in_motion"):
            if key in line:
                values[key] = line.truth(key)
        if "stopped_by" in line:
            values["stopped_by"] = line.text("stopped_by")
        if "no_plan" in line:
            values["no_plan"] = None if line.is_null("no_plan") else line.text("no_plan")
        return Mark(**values)


@dataclass(frozen=True, slots=True)
class UnfinishedRecording:
    """A recording up to its last mark.

    Attributes:
        folder: the folder of the run.
        header: facts from its beginning.
        mark: last mark that is whole and whose files have its sizes.
        sizes: size of each file in `recording.part` at that mark, in bytes.
    """

    folder: Path
    header: Header
    mark: Mark
    sizes: Mapping[str, int]

    @property
    def until_s(self) -> float:
        """Seconds since power-up that are recorded completely."""
        return self.mark.until_counts / COUNTS_PER_SECOND

    @property
    def interruption(self) -> str:
        """End of the recording so far, as text."""
        return f"the recording has no end: it goes to {self.until_s:.3f} s after power-up"

    def run_info(self) -> RunInfo:
        """Return a report's facts of the run."""
        mark, header = self.mark, self.header
        traffic = BusReport(header.bitrate, mark.frames, mark.load_percent)
        return RunInfo(header.robot, LIVE_JOB, self.until_s, traffic, self.until_s, max(mark.wall_s, 1e-6))

    def evidence(self) -> Evidence:
        """Return the evidence up to the last mark, without the outputs' names.

        Raises:
            InputError: a file is unreadable.
            ContradictionError: the files contradict each other.
        """
        parts = self.folder / RECORDING
        with prefixed(f"{parts}: "):
            check_size(sum(self.sizes.values()), ARRAYS_BYTES_MAX)
            arrays = Arrays(_ArrayFiles(parts, self))
            return evidence_until(evidence_of(arrays), self.mark.until_counts)

    def plan_text(self) -> str:
        """Return the recorded part of trajectory.csv; raise InputError if it is unreadable."""
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
    """Arrays of edges.npz, by key: those of the header, and growing ones, each in its file."""

    def __init__(self, parts: Path, recording: UnfinishedRecording) -> None:
        self._parts = parts
        self._sizes = recording.sizes
        self._constant = header_arrays(recording.mark.start_counts, recording.header.axes)
        self._types = {
            f"{axis.name}_{column}": np.dtype(code)
            for axis in recording.header.axes
            for column, code in ARRAY_TYPES.items()
            if column in (*EDGE_TYPES, angle_column(axis.per_full_step)) or f"{axis.name}_{column}" in recording.sizes
        }

    def __contains__(self, key: str) -> bool:
        return key in self._constant or key in self._types

    def array(self, key: str) -> NDArray[Any]:
        """Return an array; raise InputError if its file is unreadable."""
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
    """Read a folder's recording without an end.

    Raises:
        InputError: the header is unreadable, has another version, or a key is missing or has another kind.
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
    except InputError:  # the line, or its data, was cut off: the recording ends at the last mark before
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
    """Return the sizes in a line; raise InputError if a file is shorter."""
    if "sizes" not in line:
        return {}
    with line.section("sizes") as table:
        sizes = {name: table.integer(name, float(1 << 62)) for name in table}
    for name, size in sizes.items():
        path = parts / name
        if Path(name).name != name or not path.is_file() or not 0 <= size <= path.stat().st_size:
            raise InputError(f"{name}: is shorter than {size} bytes")
    return sizes
