"""Read captures that are texts: CSV, and value change dumps, VCD.

CSV is sigrok's, with a row a sample, or Saleae Logic 2's and WaveForms', with a row a change. sigrok's times are cut to
whole units, 41 ns at 24 MHz: they count samples, the first of which is 1. Without times, or without their unit, rows
are counted. Its head is in comments, one of which has the rate and one the channels' names.

A VCD is one of sigrok, of PulseView, of simulators, or StepTwin's own. Source: IEEE 1364-2005, clause 18. sigrok writes
several changes in a line; a wire's code may be digits.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import gcd, isfinite
from typing import Final, TextIO

import numpy as np

from steptwin.features.captures.binary_files import rate_of
from steptwin.features.captures.capture import (
    CHANNELS_MAX,
    Capture,
    Channel,
    changes_of,
    check_changes,
    check_channels,
    check_lasts,
)
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import KIB, LINE_CHARS_MAX
from steptwin.protocol.timer import COUNTS_PER_SECOND

_ROWS: Final = 1 << 16
"""Rows that are read at once."""
_TICK_S: Final = 1e-10
"""Unit of the instants of files with times in seconds."""
_RATE: Final = re.compile(r"sample ?rate:? *([0-9.e+]+ ?[kMG]?(?:Hz)?)", re.IGNORECASE)
_NAMES: Final = re.compile(r"Channels \([0-9/]+\): (.*)")
_DATE: Final = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")
_SECONDS: Final = re.compile(r"time ?[\[(]s[\])]", re.IGNORECASE)
_COMMENTS_MAX: Final = 1000
_UNITS_S: Final = {
    "seconds": 1.0,
    "milliseconds": 1e-3,
    "microseconds": 1e-6,
    "nanoseconds": 1e-9,
    "picoseconds": 1e-12,
}
_SCALES_S: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15}
_LINE_CHARS_MAX: Final = 64 * KIB
_HEADER_WORDS_MAX: Final = 100_000
_LEVELS: Final = {"0": 0, "1": 1, "x": 0, "X": 0, "z": 0, "Z": 0}
"""A level that is unknown, as a simulator has it before the first change, is taken for low."""
_NO_WIRES: Final = ("event", "parameter", "real", "realtime", "string")
_AT_A_RATE: Final = re.compile(r"at ([0-9.]+ ?[kMG]?Hz)")


@dataclass
class _Head:
    """What stands before the rows."""

    columns: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    rate_hz: float | None = None


def read_csv(file: TextIO) -> Capture:
    """Read a table; raise InputError if it is none of these, or a row is not what its head says."""
    head = _head(file)
    if head.columns and _SECONDS.fullmatch(head.columns[0]):
        return _by_change(file, head)
    if not head.names or head.rate_hz is None:
        raise InputError(
            "is no capture: neither a column `Time [s]` nor sigrok's comments with channels and samplerate"
        )
    return _by_sample(file, head)


def _head(file: TextIO) -> _Head:
    head = _Head()
    for line in islice(file, _COMMENTS_MAX):
        text = line.strip()
        if text[:1] not in (";", "#"):
            head.columns = [word.strip().strip('"') for word in text.split(",")]
            break
        if found := _RATE.search(text):
            head.rate_hz = rate_of(found[1])
        if found := _NAMES.search(text):
            head.names = [name.strip() for name in found[1].split(",")]
    return head


def _by_change(file: TextIO, head: _Head) -> Capture:
    """Read rows of a time in seconds and the level of each channel from then on."""
    names = head.columns[1:]
    check_channels(len(names))
    times, values = _read(file, len(names) + 1, 1)
    if not times.size:
        raise InputError("has no rows")
    back = times[1:] < times[:-1]
    if back.any():
        row = int(np.argmax(back)) + 2
        raise InputError(f"row {row}: its time {times[row - 1]:g} s is before that of the row above")
    check_lasts(float(times[-1]) - float(times[0]))
    at = np.rint((times - times[0]) / _TICK_S).astype(np.int64)
    kind = "WaveForms' CSV" if head.columns[0].endswith(")") else "Saleae's CSV"
    return Capture(kind, changes_of(values, at, names), _TICK_S, int(at[-1]), head.rate_hz)


def _by_sample(file: TextIO, head: _Head) -> Capture:
    """Read rows of samples, perhaps behind a time; the row after sigrok's comments names the columns."""
    before = len(head.columns) - len(head.names)
    check_channels(len(head.names))
    if before not in (0, 1):
        raise InputError(f"has {len(head.columns)} columns for the {len(head.names)} channels that its comment names")
    if head.rate_hz is None:
        raise InputError("its comments tell no samplerate")
    per_unit = _UNITS_S.get(head.columns[0], 0.0) * head.rate_hz if before else 0.0
    at, values, rows, last = [], [], 0, None
    for times, levels in _chunks(file, len(head.columns), before):
        if per_unit:
            check_lasts(float(np.abs(times).max()) * _UNITS_S[head.columns[0]])
        samples = np.rint(times * per_unit).astype(np.int64) - 1 if per_unit else rows + np.arange(len(levels))
        changed = np.flatnonzero(levels[1:] != levels[:-1]) + 1
        if last is None or levels[0] != last:
            changed = np.concatenate(([0], changed))
        at.append(samples[changed])
        values.append(levels[changed])
        check_changes(sum(len(each) for each in at))
        rows, last = int(samples[-1]) + 1, levels[-1]
    if not at:
        raise InputError("has no rows")
    instants = np.concatenate(at)
    if (np.diff(instants) <= 0).any():
        raise InputError("its times do not rise from row to row")
    channels = changes_of(np.concatenate(values), instants, head.names)
    return Capture("sigrok's CSV", channels, 1.0 / head.rate_hz, rows, head.rate_hz, sampled=True)


def _read(file: TextIO, columns: int, before: int) -> tuple[FloatArray, Int64Array]:
    parts = []
    for part in _chunks(file, columns, before):
        parts.append(part)
        check_changes(_ROWS * len(parts))
    times, values = zip(*parts, strict=True) if parts else ((np.empty(0),), (np.empty(0, np.int64),))
    return np.concatenate(times), np.concatenate(values)


def _chunks(file: TextIO, columns: int, before: int) -> Iterator[tuple[FloatArray, Int64Array]]:
    """Yield the times, if rows begin with one, and the levels as one number a row, channel k in bit k."""
    weights = 1 << np.arange(min(columns - before, CHANNELS_MAX), dtype=np.int64)
    first = 1
    while lines := [line for line in islice(file, _ROWS) if line.strip()]:
        table = _table(lines, columns, first)
        levels = table[:, before:]
        if not np.isin(levels, (0.0, 1.0)).all():
            row = first + int(np.argmin(np.isin(levels, (0.0, 1.0)).all(axis=1)))
            raise InputError(f"row {row}: has a level that is not 0 or 1")
        yield table[:, 0], levels.astype(np.int64) @ weights
        first += len(lines)


def _table(lines: list[str], columns: int, first: int) -> FloatArray:
    loaded: Callable[..., FloatArray] = np.loadtxt
    if any(len(line) > LINE_CHARS_MAX for line in lines):
        raise InputError(f"from row {first} on: a row has more than {LINE_CHARS_MAX} characters")
    try:
        table = loaded(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError:
        raise InputError(_wrong_cell(lines, columns, first)) from None
    if table.shape[1] != columns or not np.isfinite(table).all():
        raise InputError(_wrong_cell(lines, columns, first))
    return table


def _wrong_cell(lines: Sequence[str], columns: int, first: int) -> str:
    """Say what is wrong in the first row that is not numbers, one for each column."""
    for row, line in enumerate(lines, first):
        cells = [cell.strip() for cell in line.split(",")]
        if len(cells) != columns:
            return f"from row {first} on: not each row has {columns} cells, row {row} has {len(cells)}"
        for number, cell in enumerate(cells, 1):
            if not _is_number(cell):
                return f"row {row}: {shortened(cell)!r} in column {number} is no number{_why(cell)}"
    return f"from row {first} on: not each row has {columns} numbers"


def _is_number(text: str) -> bool:
    """Return whether a text is a finite number."""
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def _why(cell: str) -> str:
    """Return what to do about a cell that is no number, if that is known."""
    if _DATE.match(cell):
        return ", but a date: export times in seconds (in Logic 2 without ISO8601 timestamps)"
    if cell.upper() in ("X", "Z"):
        return ": the channel was not recorded then; export the part in which all channels are"
    return ""


class _Wire:
    """One wire while it is read."""

    def __init__(self, name: str, number: int) -> None:
        self.name, self.number = name, number
        self.first: int | None = None
        self.level = 0
        self.edges: list[int] = []

    def change(self, time: int, level: int) -> None:
        if self.first is None:
            self.first = level
        elif level != self.level:
            self.edges.append(time)
        self.level = level


def read_vcd(file: TextIO) -> Capture:
    """Read a dump; raise InputError if it is none, or has no wires of one bit."""
    words = _words(file)
    header = _header(words)
    check_channels(sum(map(len, header.wires.values())))
    time = first = None
    changes, unread, floating = 0, Counter[str](), 0
    for word in words:
        kind = word[0]
        if kind == "#":
            time = _time(word[1:], time)
            first = time if first is None else first
            continue
        if kind == "$":
            if word in ("$comment", "$date", "$version"):
                _until_end(words)
            continue
        if kind in "bBrRsS":  # a vector, a real or a string; some write wires of one bit as vectors
            code, level = next(words, ""), word[-1] if kind in "bB" else ""
        else:
            code, level = word[1:], kind
        wires = header.wires.get(code)
        if wires is None or level not in _LEVELS:
            unread[_UNREAD_WIRE if wires else _UNREAD_CODE] += 1
            continue
        floating += level not in "01" and wires[0].first is not None
        for wire in wires:
            wire.change(time or 0, _LEVELS[level])
        changes += len(wires)
        check_changes(changes)
    if time is None or first is None:
        raise InputError("has no instant: nothing is recorded")
    all_wires = [wire for wires in header.wires.values() for wire in wires]
    all_wires.sort(key=lambda wire: wire.number)
    channels = tuple(Channel(wire.name, wire.first or 0, np.array(wire.edges, np.int64) - first) for wire in all_wires)
    check_lasts((time - first) * header.tick_s)
    told = [f"{count} {what}" for what, count in unread.items()]
    if header.left_out:
        told.append(f"{header.left_out} variables that are no wire of one bit are left out")
    if floating:
        told.append(f"{floating} changes to x or z are taken for low")
    return Capture(
        "VCD",
        channels,
        header.tick_s,
        time - first,
        header.rate_hz or _grid_hz(channels, header.tick_s),
        told=tuple(told),
    )


_UNREAD_CODE: Final = "changes of variables that are no wire of one bit are left out"
_UNREAD_WIRE: Final = "changes of wires to a level that is none of 0, 1, x and z are left out"


def _grid_hz(channels: Sequence[Channel], tick_s: float) -> float | None:
    """Return the rate of the grid on which all edges lie; None if it is the time scale itself, which tells nothing."""
    grid = 0
    for channel in channels:
        grid = gcd(grid, int(np.gcd.reduce(channel.edges, initial=0)))
    return 1.0 / (grid * tick_s) if grid > 1 else None


def _words(file: TextIO) -> Iterator[str]:
    number = 0
    while line := file.readline(_LINE_CHARS_MAX + 1):
        number += 1
        if len(line) > _LINE_CHARS_MAX:
            raise InputError(f"line {number}: has more than {_LINE_CHARS_MAX} characters")
        yield from line.split()


@dataclass
class _Header:
    """What a dump says of itself: wires of one bit by their codes, time scale, rate, number of other variables."""

    wires: dict[str, list[_Wire]]
    tick_s: float = 0.0
    rate_hz: float | None = None
    left_out: int = 0


def _header(words: Iterator[str]) -> _Header:
    header = _Header({})
    for word in words:
        if word == "$enddefinitions":
            _until_end(words)
            break
        if word[0] != "$":
            raise InputError(f"{shortened(word)!r} stands where a dump begins with $date, $timescale or $var")
        body = _until_end(words)
        if word == "$timescale":
            header.tick_s = _scale(" ".join(body))
        elif word == "$comment" and (found := _AT_A_RATE.search(" ".join(body))):
            header.rate_hz = rate_of(found[1])
        elif word == "$version" and body[:1] == ["StepTwin,"]:
            header.rate_hz = float(COUNTS_PER_SECOND)
        elif word == "$var":
            _take_variable(header, body)
    if not header.tick_s:
        raise InputError("has no $timescale")
    return header


def _take_variable(header: _Header, body: list[str]) -> None:
    """Take a variable: type, bits, code and name."""
    if len(body) < 4 or body[1] != "1" or body[0] in _NO_WIRES:
        header.left_out += 1
        return
    number = sum(map(len, header.wires.values()))
    check_channels(number + 1)
    header.wires.setdefault(body[2], []).append(_Wire(shortened(body[3]), number))


def _until_end(words: Iterator[str]) -> list[str]:
    body: list[str] = []
    for word in words:
        if word == "$end":
            return body
        body.append(word)
        if len(body) > _HEADER_WORDS_MAX:
            break
    raise InputError("a section has no $end")


def _scale(text: str) -> float:
    found = re.fullmatch(r"(1|10|100) ?([munpf]?s)", text)
    if not found:
        raise InputError(f"$timescale {shortened(text)}: is not 1, 10 or 100 of s, ms, us, ns, ps or fs")
    return int(found[1]) * _SCALES_S[found[2]]


def _time(text: str, before: int | None) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 18):
        raise InputError(f"#{shortened(text)}: is no instant")
    time = int(text)
    if before is not None and time < before:
        raise InputError(f"#{time}: comes after #{before}")
    return time
