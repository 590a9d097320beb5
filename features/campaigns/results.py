"""The folder of a campaign: the campaign itself, and its rows as Parquet files, each written whole or not at all.

Each file holds the rows of some runs and stays as it is. An interrupted campaign makes the missing runs later. Only
files with the names below count, and each run counts once. docs/faults.md describes the columns.
"""

import re
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.features.campaigns.campaign import RUNS_MAX
from steptwin.features.campaigns.row import Row, read_table, rows_of, write_rows
from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import growing_file, made_folder

if TYPE_CHECKING:
    import pyarrow as pa

_ROWS: Final = "rows"
"""Folder of the Parquet files."""
_PART: Final = re.compile(r"part-(\d{6,9})\.parquet")
"""Pattern of the names of files with rows; other files in the folder are left alone."""
_LOCK: Final = "running"
"""File that a running campaign locks."""
PART_ROWS: Final = 1000
"""Number of rows in a file."""
PART_S: Final = 30.0
"""Longest time between two files; rows of this time are lost in a power failure."""


class Results:
    """Rows in a campaign's folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._waiting: list[Row] = []
        self._written_s = time.monotonic()

    @property
    def parts(self) -> list[Path]:
        """Files with rows, in the order of writing."""
        return [path for _, path in sorted(self._numbered())]

    def _numbered(self) -> Iterator[tuple[int, Path]]:
        for path in (self.folder / _ROWS).glob("part-*.parquet"):
            if name := _PART.fullmatch(path.name):
                yield int(name[1]), path

    def done(self, seeds: range) -> NDArray[np.bool_]:
        """Return, for each seed, whether its row exists; all files are checked.

        Raises:
            InputError: a file is damaged or has impossible values, or a seed occurs twice.
        """
        done = np.zeros(len(seeds), np.bool_)
        for _ in self._tables(seeds, done):
            pass
        return done

    def rows(self, seeds: range) -> Iterator[Row]:
        """Yield the rows of seeds, file by file; raises as `done`."""
        for table in self._tables(seeds, np.zeros(len(seeds), np.bool_)):
            yield from rows_of(table)

    def row(self, seed: int) -> Row | None:
        """Return the row of a seed; None if it does not exist. Raises as `done`."""
        return next(self.rows(range(seed, seed + 1)), None)

    def runs_there(self, first_seed: int) -> int:
        """Return the number of runs up to the last one with a row; the campaign's file may now have fewer."""
        seeds = range(first_seed, first_seed + RUNS_MAX)
        last = max((int(each.column("seed").to_numpy().max()) for each in self._tables(seeds) if len(each)), default=-1)
        return max(last - first_seed + 1, 0)

    def _tables(self, seeds: range, done: NDArray[np.bool_] | None = None) -> "Iterator[pa.Table]":
        """Yield the rows of seeds in each file; with a mask of the seeds, mark them, and refuse a marked one."""
        for part in self.parts:
            table = read_table(part)
            found = np.asarray(table.column("seed").to_numpy()) - seeds.start
            ours = (found >= 0) & (found < len(seeds))
            if done is not None:
                if done[found[ours]].any():
                    seed = seeds.start + int(found[ours][done[found[ours]]][0])
                    raise InputError(f"{part}: has the run of seed {seed} once more: remove the file if it is a copy")
                done[found[ours]] = True
            yield table if ours.all() else table.filter(ours)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Lock the folder while the block runs; write waiting rows at its end, even after an error.

        Raises:
            InputError: another program runs this campaign.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        made_folder(self.folder / _ROWS)
        with _locked(self.folder / _LOCK):
            try:
                yield
            finally:
                self.flush()

    def add(self, rows: Iterable[Row]) -> None:
        """Add rows; write a file if there are enough, or if enough time has passed."""
        self._waiting += rows
        if len(self._waiting) >= PART_ROWS or time.monotonic() - self._written_s > PART_S:
            self.flush()

    def flush(self) -> None:
        """Write waiting rows."""
        if self._waiting:
            write_rows(self._next_part(), self._waiting)
            self._waiting = []
        self._written_s = time.monotonic()

    def _next_part(self) -> Path:
        number = max((number for number, _ in self._numbered()), default=0) + 1
        return self.folder / _ROWS / f"part-{number:06}.parquet"


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Lock a file for this program alone; the system unlocks it when the program ends."""
    with growing_file(path) as file:
        if sys.platform != "win32":  # a second program goes unnoticed there
            import fcntl

            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(f"{path.parent}: another program runs this campaign: wait for its end") from None
        yield
