"""The result of one run of a campaign, a row in plain values, and a Parquet file of rows, written and read.

A folder of results may come from anywhere. What a file takes in memory is bounded by what its own tables say before
anything is read, and every value is checked before a row is made of it.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from stat import S_ISREG
from typing import TYPE_CHECKING, Any, BinaryIO, Final, get_origin, get_type_hints

from steptwin.features.campaigns.sources import source_version
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MIB, size_text
from steptwin.host.common.whole_file import whole_file

if TYPE_CHECKING:
    import pyarrow as pa

ROW_FILE_ROWS_MAX: Final = 10_000
"""Rows in a Parquet file of a campaign, which has 1 000 and those of the tasks that end meanwhile."""
ROW_FILE_GROUPS_MAX: Final = 16
"""Groups of rows in it: it is written as one."""
ROW_FILE_VALUES_MAX: Final = 1_000_000
"""Values in one of its columns: a row has some ten parameters, and 1 000 for a scenario of 250 faults."""
ROW_FILE_TEXTS_MAX: Final = 100_000
"""Different texts in a column, which a report counts: 1 000 rows of as many scenarios have some 10 000 parameters."""
ROW_FILE_BYTES_MAX: Final = 64 * MIB
"""Its size, and what it takes unpacked: a row has some 2 KiB."""
ROW_TEXT_CHARS_MAX: Final = 10_000
"""Characters of a text in a row: longer ones are cut before they are written."""


class Ended(StrEnum):
    """How a run ended."""

    DONE = "done"
    """The host came to the end of the motion, and no drive failed."""
    STOPPED = "stopped"
    """A drive failed, or the host gave up, and said so."""
    REFUSED = "refused"
    """The run was not made: the robot, as drawn, cannot make the motion, or lacks what a fault concerns."""
    CRASHED = "crashed"
    """A program of StepTwin itself failed."""


@dataclass(frozen=True, slots=True)
class Breach:
    """An invariant that did not hold.

    Attributes:
        invariant: its name in `invariants.INVARIANTS`.
        what: what was found, without numbers and names of joints, so that like runs have like words.
        detail: the joint and the numbers; may be empty.
    """

    invariant: str
    what: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.invariant}: {self.what}{f' ({self.detail})' if self.detail else ''}"


@dataclass(frozen=True, slots=True)
class Row:
    """One run; the same seed gives the same row, except for the time that it took.

    Attributes:
        seed: the run's seed.
        robot: the robot's name in the campaign.
        motion: the motion's name.
        scenario: the scenario's name.
        ended: how it ended.
        message: why it ended before the motion's end; empty otherwise.
        codes: all error codes that the nodes sent (EMCY), each once, sorted.
        faults: the scenario's faults by name.
        struck: how often each has struck, 0 for one that did not.
        met: what the faults were that struck, in the words of docs/faults.md, each once, sorted.
        asked: names of the invariants (`invariants.INVARIANTS`) that the run was asked for.
        breaches: those that did not hold, the gravest first.
        parameters: every number that was drawn, by name.
        choices: every other value that was drawn, by name.
        margins: what was left to each limit, 1 all of it and 0 nothing, by the names in `margins.all_margins`.
        duration_s: duration of the planned motion.
        simulated_s: simulated time of the whole run.
        wall_s: time that it took.
        version: the version of StepTwin that made the run, with a digest of its sources.
    """

    seed: int
    robot: str
    motion: str
    scenario: str
    ended: Ended
    message: str = ""
    codes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    struck: tuple[int, ...] = ()
    met: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    breaches: tuple[Breach, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    choices: Mapping[str, str] = field(default_factory=dict)
    margins: Mapping[str, float] = field(default_factory=dict)
    duration_s: float = 0.0
    simulated_s: float = 0.0
    wall_s: float = field(default=0.0, compare=False)
    version: str = field(default_factory=source_version, compare=False)

    @property
    def passed(self) -> bool:
        """True if every invariant held."""
        return not self.breaches

    @property
    def cause(self) -> str:
        """What failed, for grouping: the gravest breach, and the faults that had struck; empty if none."""
        if not self.breaches:
            return ""
        first = self.breaches[0]
        return f"{first.invariant}: {first.what}, after {' and '.join(self.met) or 'no fault'}"


def split_parameters(drawn: Mapping[str, object]) -> tuple[dict[str, float], dict[str, str]]:
    """Return drawn values as numbers and as texts."""
    numbers = {
        name: float(value)
        for name, value in drawn.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    return numbers, {name: str(value) for name, value in drawn.items() if name not in numbers}


_ROWS_AT_ONCE: Final = 100
"""Rows that are Python objects at the same time."""
_HINTS: Final = get_type_hints(Row)
_MAPS: Final = [name for name, hint in _HINTS.items() if get_origin(hint) is Mapping]
_LISTS: Final = [name for name, hint in _HINTS.items() if get_origin(hint) is tuple]


def schema() -> "pa.Schema":
    """Return the columns of the Parquet files: one for each field of a row, and the cause."""
    import pyarrow as pa

    text, number, whole = pa.string(), pa.float64(), pa.int64()
    types = {
        str: text,
        Ended: text,
        int: whole,
        float: number,
        tuple[str, ...]: pa.list_(text),
        tuple[int, ...]: pa.list_(whole),
        tuple[Breach, ...]: pa.list_(pa.struct([("invariant", text), ("what", text), ("detail", text)])),
        Mapping[str, float]: pa.map_(text, number),
        Mapping[str, str]: pa.map_(text, text),
    }
    fields = [pa.field(name, types[hint], nullable=name != "seed") for name, hint in _HINTS.items()]
    return pa.schema([*fields, pa.field("cause", text)])


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as a file that appears whole or not at all; OSError names it if it cannot be written."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pylist([_document(row) for row in rows], schema=schema())
    with whole_file(path) as file:
        pq.write_table(table, file, compression="zstd")


def _document(row: Row) -> dict[str, Any]:
    document = asdict(row)
    for name in _MAPS:
        document[name] = list(document[name].items())
    shortened: dict[str, Any] = _short(document | {"ended": row.ended.value, "cause": row.cause})
    return shortened


def _short(value: Any) -> Any:
    """Return a value with its texts cut to what is read again, such as the message of a program that failed."""
    if isinstance(value, str):
        return value[:ROW_TEXT_CHARS_MAX]
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    return type(value)(map(_short, value)) if isinstance(value, list | tuple) else value


def read_table(path: Path) -> "pa.Table":
    """Return the checked table of a file's rows.

    Raises:
        InputError: it is no regular file, takes more memory than rows need, or has other columns or impossible values.
    """
    import pyarrow as pa

    with prefixed(f"{path}: "):
        try:
            with _opened(path) as file:
                table = _bounded(file)
            table.validate(full=True)
        except (pa.ArrowException, OSError, KeyError, ValueError, MemoryError) as error:
            raise InputError(f"is no file of a campaign's rows: {(str(error) or 'damaged').splitlines()[0]}") from error
        _check_values(table)
    return table


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file, no link and no pipe, of no more than it may have."""
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not S_ISREG(status.st_mode):
            raise InputError("is no regular file")
        if status.st_size > ROW_FILE_BYTES_MAX:
            raise InputError(f"has {size_text(status.st_size)}: rows have at most {size_text(ROW_FILE_BYTES_MAX)}")
        yield file


def _bounded(file: BinaryIO) -> "pa.Table":
    """Return the table in a file; its texts stay in dictionaries, so that it takes as much memory as it says."""
    import pyarrow.parquet as pq

    parquet = pq.ParquetFile(file)
    if not parquet.schema_arrow.equals(schema()):
        raise InputError("is no file of a campaign's rows: its columns are others")
    groups = parquet.metadata
    if groups.num_rows > ROW_FILE_ROWS_MAX or groups.num_row_groups > ROW_FILE_GROUPS_MAX:
        raise InputError(f"has {groups.num_rows} rows in {groups.num_row_groups} groups, which no campaign writes")
    chunks = [
        groups.row_group(group).column(column)
        for group in range(groups.num_row_groups)
        for column in range(groups.num_columns)
    ]
    if max((chunk.num_values for chunk in chunks), default=0) > ROW_FILE_VALUES_MAX:
        raise InputError(f"has a column of more than {ROW_FILE_VALUES_MAX} values")
    _check_bytes(sum(chunk.total_uncompressed_size for chunk in chunks))
    texts = [chunk.path_in_schema for chunk in chunks if chunk.physical_type == "BYTE_ARRAY"]
    file.seek(0)
    return pq.ParquetFile(file, read_dictionary=list(dict.fromkeys(texts))).read(use_threads=False)


def _check_bytes(size_bytes: int) -> None:
    if size_bytes > ROW_FILE_BYTES_MAX:
        raise InputError(f"takes {size_text(size_bytes)} of memory: rows take at most {size_text(ROW_FILE_BYTES_MAX)}")


def _check_values(table: "pa.Table") -> None:
    """Raise InputError for a value that no run has: null, an endless number, a way to end that there is none of."""
    import pyarrow as pa
    import pyarrow.compute as pc

    texts_bytes = 0
    for name in table.column_names:
        for chunk in table.column(name).chunks:
            for leaf in _arrays(chunk):
                if leaf.null_count:
                    raise InputError(f"{name}: has {leaf.null_count} values that are null")
                if pa.types.is_dictionary(leaf.type):
                    texts_bytes += _text_bytes(name, leaf)
                elif pa.types.is_floating(leaf.type) and not pc.all(pc.is_finite(leaf)).as_py() and len(leaf):
                    raise InputError(f"{name}: has a number that is not finite")
    _check_bytes(texts_bytes)
    for ended in table.column("ended").unique().to_pylist():
        if ended not in list(Ended):
            raise InputError(f"ended: {ended!r} is none of {', '.join(Ended)}")
    for name in ("duration_s", "simulated_s", "wall_s", "seed"):
        if len(table) and pc.min(table.column(name)).as_py() < 0:
            raise InputError(f"{name}: {pc.min(table.column(name)).as_py():g} is below 0")
    if table.column("seed").length() != len(table.column("seed").unique()):
        raise InputError("seed: one is there twice")
    lengths = [pc.list_value_length(table.column(name)) for name in ("faults", "struck")]
    if not lengths[0].equals(lengths[1]):
        raise InputError("struck: tells of other faults than there are")


def _arrays(array: Any) -> Iterator[Any]:
    """Yield an array and all arrays in it: of lists, maps and structures their values."""
    import pyarrow as pa

    yield array
    if pa.types.is_map(array.type):
        yield from _arrays(array.keys)
        yield from _arrays(array.items)
    elif pa.types.is_list(array.type):
        yield from _arrays(array.flatten())
    elif pa.types.is_struct(array.type):
        for number in range(array.type.num_fields):
            yield from _arrays(array.field(number))


def _text_bytes(name: str, texts: Any) -> int:
    """Return the bytes of texts that a dictionary holds once each; raise InputError for one that is too long."""
    import pyarrow.compute as pc

    if not len(texts):
        return 0
    if len(texts.dictionary) > ROW_FILE_TEXTS_MAX:
        raise InputError(f"{name}: has {len(texts.dictionary)} different texts")
    lengths = pc.binary_length(texts.dictionary.cast("binary")).take(texts.indices)
    if (longest := pc.max(lengths).as_py()) > 4 * ROW_TEXT_CHARS_MAX:
        raise InputError(f"{name}: has a text of {longest} bytes")
    return int(pc.sum(lengths).as_py())


def rows_of(table: "pa.Table") -> Iterator[Row]:
    """Yield the rows of a checked table."""
    for first in range(0, len(table), _ROWS_AT_ONCE):
        yield from map(_row, table.slice(first, _ROWS_AT_ONCE).to_pylist())


def _row(document: dict[str, Any]) -> Row:
    del document["cause"]
    document["ended"] = Ended(document["ended"])
    document["breaches"] = [Breach(**breach) for breach in document["breaches"]]
    made = {name: dict(document[name]) for name in _MAPS} | {name: tuple(document[name]) for name in _LISTS}
    return Row(**document | made)
