"""The folder of a campaign: the campaign itself, and its rows as Parquet files that appear whole or not at all.

Each file holds the rows of some runs. What is written stays: a campaign that was interrupted makes the runs whose rows
are missing. docs/campaigns.md describes the columns.
"""

import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.campaign.row import Breach, Ended, Row
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file

if TYPE_CHECKING:
    import pyarrow as pa

_ROWS: Final = "rows"
"""Folder of the Parquet files."""
_LOCK: Final = "running"
"""File that a running campaign holds."""
PART_ROWS: Final = 1000
"""Rows after which a file is written."""
PART_S: Final = 30.0
"""Time after which a file is written with the rows that there are: so much is lost when the power fails."""


def schema() -> "pa.Schema":
    """Return the columns of the Parquet files."""
    import pyarrow as pa

    text, texts = pa.string(), pa.list_(pa.string())
    return pa.schema(
        [
            pa.field("seed", pa.int64(), nullable=False),
            pa.field("robot", text),
            pa.field("motion", text),
            pa.field("scenario", text),
            pa.field("ended", text),
            pa.field("message", text),
            pa.field("codes", texts),
            pa.field("faults", texts),
            pa.field("struck", pa.list_(pa.int64())),
            pa.field("met", texts),
            pa.field("asked", texts),
            pa.field("breaches", pa.list_(pa.struct([("invariant", text), ("what", text), ("detail", text)]))),
            pa.field("parameters", pa.map_(pa.string(), pa.float64())),
            pa.field("choices", pa.map_(pa.string(), pa.string())),
            pa.field("margins", pa.map_(pa.string(), pa.float64())),
            pa.field("duration_s", pa.float64()),
            pa.field("simulated_s", pa.float64()),
            pa.field("wall_s", pa.float64()),
            pa.field("version", text),
            pa.field("cause", text),
        ]
    )


class Results:
    """The rows in a campaign's folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._waiting: list[Row] = []
        self._written_s = time.monotonic()

    @property
    def parts(self) -> list[Path]:
        """The files with rows, in the order in which they were written."""
        return sorted((self.folder / _ROWS).glob("*.parquet"))

    def done(self, seeds: range) -> NDArray[np.bool_]:
        """Return for each of the seeds whether its row is there; raise InputError for a file that is damaged."""
        done = np.zeros(len(seeds), np.bool_)
        for part in self.parts:
            found = np.asarray(_read(part, ["seed"]).column("seed").to_numpy()) - seeds.start
            done[found[(found >= 0) & (found < len(seeds))]] = True
        return done

    def rows(self) -> Iterator[Row]:
        """Yield all rows, file by file; raise InputError for a file that is damaged."""
        for part in self.parts:
            for document in _read(part).to_pylist():
                yield _row(document)

    def row(self, seed: int) -> Row | None:
        """Return the row of a seed; None if it is not there."""
        for part in self.parts:
            if seed in _read(part, ["seed"]).column("seed").to_pylist():
                return next(_row(each) for each in _read(part).to_pylist() if each["seed"] == seed)
        return None

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Keep the folder for this program while the block runs; at its end, whatever ends it, write what waits.

        Raises:
            InputError: another program runs this campaign.
        """
        (self.folder / _ROWS).mkdir(parents=True, exist_ok=True)
        with _locked(self.folder / _LOCK):
            try:
                yield
            finally:
                self.flush()

    def add(self, rows: Iterable[Row]) -> None:
        """Keep rows; write a file when there are enough of them, or enough time has passed."""
        self._waiting += rows
        if len(self._waiting) >= PART_ROWS or time.monotonic() - self._written_s > PART_S:
            self.flush()

    def flush(self) -> None:
        """Write the rows that wait."""
        if self._waiting:
            import pyarrow as pa
            import pyarrow.parquet as pq

            table = pa.Table.from_pylist([_document(row) for row in self._waiting], schema=schema())
            with whole_file(self._next_part()) as file:
                pq.write_table(table, file, compression="zstd")
            self._waiting = []
        self._written_s = time.monotonic()

    def _next_part(self) -> Path:
        parts = self.parts
        number = int(parts[-1].stem.removeprefix("part-")) + 1 if parts else 1
        return self.folder / _ROWS / f"part-{number:06}.parquet"


def _document(row: Row) -> dict[str, Any]:
    document = asdict(row)
    for name in ("parameters", "choices", "margins"):
        document[name] = list(document[name].items())
    return document | {"ended": row.ended.value, "cause": row.cause}


def _row(document: dict[str, Any]) -> Row:
    values = {key: value for key, value in document.items() if key != "cause"}
    for name in ("parameters", "choices", "margins"):
        values[name] = dict(values[name])
    for name in ("codes", "faults", "struck", "met", "asked"):
        values[name] = tuple(values[name])
    values["breaches"] = tuple(Breach(**breach) for breach in values["breaches"])
    return Row(**values | {"ended": Ended(values["ended"])})


def _read(part: Path, columns: list[str] | None = None) -> "pa.Table":
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(part, columns=columns, schema=None if columns else schema())
    except (pa.ArrowException, OSError, KeyError) as error:
        raise InputError(f"{part}: is no file of a campaign's rows: {str(error).splitlines()[0]}") from error


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a file that only one program can hold; the system lets it go when the program ends."""
    with path.open("w") as file:
        if sys.platform != "win32":  # there a second program is not noticed
            import fcntl

            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(f"{path.parent}: another program runs this campaign: wait for its end") from None
        yield
