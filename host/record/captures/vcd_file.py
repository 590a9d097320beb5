"""Read value change dumps, VCD: those of sigrok, of PulseView, of simulators, and StepTwin's own.

Source: IEEE 1364-2005, clause 18. sigrok writes several changes in a line; a wire's code may be digits.
"""

import re
from collections.abc import Iterator
from typing import Final, TextIO

import numpy as np

from steptwin.host.common.bad_input import shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import KIB
from steptwin.host.record.captures.binary_files import rate_of
from steptwin.host.record.captures.capture import Capture, Channel, check_changes, check_channels

_SCALES_S: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15}
_LINE_CHARS_MAX: Final = 64 * KIB
_HEADER_WORDS_MAX: Final = 100_000
_LEVELS: Final = {"0": 0, "1": 1, "x": 0, "X": 0, "z": 0, "Z": 0}
"""A level that is unknown, as a simulator has it before the first change, is taken for low."""
_AT_A_RATE: Final = re.compile(r"at ([0-9.]+ ?[kMG]?Hz)")


class _Wire:
    """One wire while it is read."""

    def __init__(self, name: str) -> None:
        self.name = name
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
    wires, tick_s, rate_hz = _header(words)
    check_channels(len(wires))
    by_code: dict[str, list[_Wire]] = {}
    for code, wire in wires:
        by_code.setdefault(code, []).append(wire)
    time = first = None
    changes = 0
    for word in words:
        kind = word[0]
        if kind == "#":
            time = _time(word[1:], time)
            first = time if first is None else first
        elif kind in _LEVELS:
            for wire in by_code.get(word[1:], ()):
                wire.change(time or 0, _LEVELS[kind])
            changes += 1
            check_changes(changes)
        elif kind in "bBrRsS":
            next(words, None)  # the code of a vector, a real or a string, which is no wire of one bit
        elif kind == "$" and word in ("$comment", "$date", "$version"):
            _until_end(words)
    if time is None or first is None:
        raise InputError("has no instant: nothing is recorded")
    channels = tuple(Channel(wire.name, wire.first or 0, np.array(wire.edges, np.int64) - first) for _, wire in wires)
    return Capture("VCD", channels, tick_s, time - first, rate_hz or 1.0 / tick_s)


def _words(file: TextIO) -> Iterator[str]:
    number = 0
    while line := file.readline(_LINE_CHARS_MAX + 1):
        number += 1
        if len(line) > _LINE_CHARS_MAX:
            raise InputError(f"line {number}: has more than {_LINE_CHARS_MAX} characters")
        yield from line.split()


def _header(words: Iterator[str]) -> tuple[list[tuple[str, _Wire]], float, float | None]:
    """Return the codes and the wires of one bit, the time scale, and the rate if a comment tells it."""
    wires: list[tuple[str, _Wire]] = []
    tick_s, rate_hz = None, None
    for word in words:
        if word == "$enddefinitions":
            _until_end(words)
            break
        if word[0] != "$":
            raise InputError(f"{shortened(word)!r} stands where a dump begins with $date, $timescale or $var")
        body = _until_end(words)
        if word == "$timescale":
            tick_s = _scale(" ".join(body))
        elif word == "$comment" and (found := _AT_A_RATE.search(" ".join(body))):
            rate_hz = rate_of(found[1])
        elif word == "$var" and len(body) >= 4 and body[1] == "1":
            wires.append((body[2], _Wire(shortened(body[3]))))
    if tick_s is None:
        raise InputError("has no $timescale")
    return wires, tick_s, rate_hz


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
