"""report.json: what was said of a run: its names and traffic, the planned switching, the figures, a fault."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as short
from typing import Any, TypeVar

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file
from steptwin.host.planning.trajectory import Switching
from steptwin.host.record.folder.layout import REPORT, VERSION_KEY, check_version, existing
from steptwin.host.verify import BusReport, RunInfo

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class StoredReport:
    """A report as it was written.

    Attributes:
        run: what the verifier cannot know.
        switchings: the outputs that were to change, in order of time.
        passed: the verdict; None where the board did not know the plan.
        driver_profile: which drivers the board had.
        axes: each axis' figures by name.
        fault: what ended the run, None if it came to its end.
        document: all of it.
    """

    run: RunInfo
    switchings: tuple[Switching, ...]
    passed: bool | None
    driver_profile: str
    axes: tuple[Mapping[str, Any], ...]
    fault: Mapping[str, Any] | None
    document: Mapping[str, Any]


def write_report(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document as `run --json` prints it."""
    with whole_file(path) as file:
        file.write((json.dumps(document, indent=2) + "\n").encode())


def read_report(folder: Path) -> StoredReport:
    """A folder's report.

    Raises:
        InputError: no such file, not JSON, another version, a key that is missing or of the wrong kind.
    """
    path = existing(folder, REPORT)
    with prefixed(f"{path}: "):
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"is not JSON: {error}") from error
        return _report(_Table(document))


class _Table:
    """A JSON object whose values are asked for by key and kind."""

    def __init__(self, value: object) -> None:
        if not isinstance(value, dict):
            raise InputError(f"{short(value)} is not a JSON object")
        self.values = value

    def text(self, key: str) -> str:
        return str(self._of(key, str, "a text"))

    def number(self, key: str) -> float:
        return float(self._of(key, int | float, "a number"))

    def integer(self, key: str) -> int:
        return int(self._of(key, int, "a whole number"))

    def truth(self, key: str) -> bool:
        value = self._take(key)
        if not isinstance(value, bool):
            raise InputError(f"{key}: {short(value)} is neither true nor false")
        return value

    def says_none(self, key: str) -> bool:
        return self._take(key) is None

    @contextmanager
    def table(self, key: str) -> Iterator["_Table"]:
        value = self._take(key)
        with prefixed(f"{key}: "):
            table = _Table(value)
        with prefixed(f"{key}."):
            yield table

    def each(self, key: str, make: Callable[["_Table"], Made]) -> tuple[Made, ...]:
        """What is made of every table in a list."""
        values = self._take(key)
        if not isinstance(values, list):
            raise InputError(f"{key}: {short(values)} is not a list")
        made = []
        for i, value in enumerate(values):
            with prefixed(f"{key}[{i}]: "):
                made.append(make(_Table(value)))
        return tuple(made)

    def _of(self, key: str, kind: Any, what: str) -> Any:
        value = self._take(key)
        if isinstance(value, bool) or not isinstance(value, kind):
            raise InputError(f"{key}: {short(value)} is not {what}")
        return value

    def _take(self, key: str) -> object:
        if key not in self.values:
            raise InputError(f"{key}: is missing")
        return self.values[key]


def _report(table: _Table) -> StoredReport:
    check_version(table.values.get(VERSION_KEY))
    return StoredReport(
        run=_run(table),
        switchings=table.each("outputs", _switching),
        passed=None if table.says_none("passed") else table.truth("passed"),
        driver_profile=table.text("driver_profile"),
        axes=table.each("axes", lambda axis: axis.values),
        fault=_fault(table),
        document=table.values,
    )


def _run(table: _Table) -> RunInfo:
    with table.table("bus") as bus:
        traffic = BusReport(bus.integer("bitrate"), bus.integer("frames"), bus.number("load_percent"))
    return RunInfo(
        robot=table.text("robot"),
        job=table.text("job"),
        duration_s=table.number("duration_s"),
        bus=traffic,
        simulated_s=table.number("simulated_s"),
        wall_s=table.number("wall_s"),
    )


def _switching(table: _Table) -> Switching:
    return Switching(table.text("name"), table.truth("on"), table.number("from_s"), table.number("until_s"))


def _fault(table: _Table) -> Mapping[str, Any] | None:
    """With all that is told of a fault."""
    if "fault" not in table.values:
        return None
    with table.table("fault") as fault:
        fault.text("message")
        fault.truth("positions_agree")
        with fault.table("joints") as joints:
            for name in joints.values:
                joints.number(name)
        return fault.values
