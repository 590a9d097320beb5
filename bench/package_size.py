"""Measure what `pip install steptwin` brings and how long its first import takes."""

import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final
from zipfile import ZipFile

from rich.table import Table

_ROOT: Final = Path(__file__).resolve().parents[1]
_STARTS: Final = 9
_EMPTY: Final = ("-c", "pass")
_STARTED: Final = {
    "import steptwin": ("-c", "import steptwin"),
    "steptwin --help": ("-m", "steptwin", "--help"),
    "steptwin.load_robot, steptwin.plan": ("-c", "import steptwin; steptwin.load_robot, steptwin.plan"),
}


def package_tables() -> list[Table]:
    """Return a table of the wheel's contents, and one of start-up times beside Python's own."""
    return [_contents_table(), _start_table()]


def _contents_table() -> Table:
    table = Table("wheel", "files", "kB in it", "kB unpacked", title="The wheel", title_justify="left")
    with TemporaryDirectory() as folder:
        build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
        subprocess.run(build, cwd=_ROOT, check=True, capture_output=True)
        (wheel,) = Path(folder).iterdir()
        with ZipFile(wheel) as file:
            packed: dict[str, list[tuple[int, int]]] = {}
            for each in file.infolist():
                top, *below = each.filename.split("/")
                room = f"{top}/{below[0]}" if len(below) > 1 and top == "steptwin" else top
                packed.setdefault(room, []).append((each.compress_size, each.file_size))
        for room, sizes in packed.items():
            _add_sizes(table, room, sizes)
        _add_sizes(table, "all", [size for sizes in packed.values() for size in sizes])
    return table


def _add_sizes(table: Table, room: str, sizes: list[tuple[int, int]]) -> None:
    small, large = (sum(column) / 1000 for column in zip(*sizes, strict=True))
    table.add_row(room, str(len(sizes)), f"{small:.0f}", f"{large:.0f}")


def _start_table() -> Table:
    table = Table("start of a process", "ms", "beyond Python's own", title="Start-up", title_justify="left")
    times_ms: dict[str, list[float]] = {name: [] for name in ("python", *_STARTED)}
    for _ in range(_STARTS):  # in turn, so that a busy second meets all of them
        for name, words in {"python": _EMPTY, **_STARTED}.items():
            begin_s = time.perf_counter()
            subprocess.run([sys.executable, *words], check=True, capture_output=True)
            times_ms[name].append(1000 * (time.perf_counter() - begin_s))
    own_ms = median(times_ms["python"])
    for name, measured_ms in times_ms.items():
        table.add_row(name, f"{median(measured_ms):.0f}", f"{median(measured_ms) - own_ms:.0f}")
    return table
