"""Write a waveform file in any of the formats; the same run gives the same bytes.

The changes of all signals are sorted by time, stretch by stretch. Texts for millions of lines are columns of
characters: uint8 matrices with a row for each line; 0 means no character.

Times of MCAP are nanoseconds since power-up. VCD files are value change dumps (IEEE 1364-2005, clause 18) for logic
analysers and waveform viewers. For sigrok a VCD file has only wires of one bit, since sigrok's import stops at a wire
of several bits. It also drops scopes, so names differ without them. Numbers and texts are variables of type `real` and
`string`; GTKWave defines the latter.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain, groupby
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.waveforms.signal import (
    COUNTS,
    NANOSECONDS,
    SCALES,
    Signal,
    SignalKind,
    TimeScale,
    Values,
    Window,
    stretches,
)
from steptwin.protocol.timer import COUNTS_PER_SECOND

Text = NDArray[np.uint8]

NS_PER_S = 1_000_000_000

_DIGITS = 4
_ZERO = ord("0")


def _four_digits() -> Text:
    numbers = np.arange(10**_DIGITS)
    return np.stack([numbers // 10**i % 10 + _ZERO for i in reversed(range(_DIGITS))], axis=1).astype(np.uint8)


_FOUR_DIGITS = _four_digits()


def decimals(values: Int64Array) -> Text:
    """Return whole numbers, not negative, as texts of shape (n, width) without leading zeros."""
    width = len(str(values.max(initial=0)))
    digits = padded_decimals(values, width)
    if values.size and values.min() >= 10 ** (width - 1):
        return digits
    written = np.maximum.accumulate(digits != _ZERO, axis=1)
    written[:, -1] = True
    return digits * written


def padded_decimals(values: Int64Array, width: int) -> Text:
    """Return the last `width` digits of whole numbers, shape (n, width), with leading zeros."""
    groups = []
    for _ in range(-(-width // _DIGITS)):
        higher = values // 10**_DIGITS
        groups.append(_FOUR_DIGITS[values - higher * 10**_DIGITS])
        values = higher
    return np.concatenate(groups[::-1], axis=1)[:, -width:]


def seconds(ns: Int64Array) -> Text:
    """Return times in seconds with nine decimals, and with a sign if negative."""
    whole, rest = np.divmod(np.abs(ns), NS_PER_S)
    sign = np.where(ns < 0, np.uint8(ord("-")), np.uint8(0))[:, np.newaxis]
    return np.concatenate([sign, decimals(whole), constant(".", ns.size), padded_decimals(rest, 9)], axis=1)


def constant(text: str, rows: int) -> Text:
    """Return `rows` rows of the same text."""
    return np.tile(np.frombuffer(text.encode(), np.uint8), (rows, 1))


def chosen(texts: Sequence[str], index: NDArray[np.integer]) -> Text:
    """Return the text of each index, a row each."""
    rows: Text = matrix(texts)[index]
    return rows


def matrix(texts: Sequence[str]) -> Text:
    """Return a row for each text."""
    rows = np.array([text.encode() for text in texts], dtype=np.bytes_)
    return rows.view(np.uint8).reshape(len(texts), rows.itemsize)


def stacked(texts: Sequence[Text]) -> Text:
    """Return the rows of all matrices below each other."""
    rows = np.zeros((sum(len(text) for text in texts), max(text.shape[1] for text in texts)), np.uint8)
    end = 0
    for text in texts:
        rows[end : end + len(text), : text.shape[1]] = text
        end += len(text)
    return rows


def spelt(values: NDArray[np.generic], spell: Callable[[object], str]) -> Text:
    """Return each value as text; call `spell` once for each distinct value."""
    different, index = np.unique(values, return_inverse=True)
    return chosen([spell(value) for value in different.tolist()], index)


def lines(*columns: Text) -> bytes:
    """Return the bytes of adjacent columns, row after row."""
    return np.concatenate(columns, axis=1).tobytes().translate(None, b"\0")


class TooFastForScaleError(InputError):
    """Two changes of a wire have the same instant of a time scale."""


@dataclass(frozen=True, slots=True)
class Merged:
    """Changes in order of time; changes at one instant are in the order of the signals.

    Attributes:
        instants: shape (n,), instant of each change, in units of the scale.
        which: shape (n,), index of the signal.
        values: shape (n, width), text of each new value.
    """

    instants: Int64Array
    which: NDArray[np.intp]
    values: Text


def merged(signals: Sequence[Signal], window: Window, scale: TimeScale) -> Iterator[Merged]:
    """Yield all changes after the window's start up to and including its end; empty stretches are left out.

    Raises:
        TooFastForScaleError: both ends of a wire's pulse or pause have the same instant of the scale.
    """
    for after, until in stretches(signals, window, scale):
        parts = [_part(signal, window, scale, after, until) for signal in signals]
        if any(instants.size for instants, _ in parts):
            yield _merged(parts)


def initial_values(signals: Sequence[Signal], window: Window) -> Text:
    """Return the value of each signal at the start of the window, a row each."""
    return stacked([_text(signal, np.array([signal.changes.at(window.from_counts)])) for signal in signals])


def _text(signal: Signal, values: Values) -> Text:
    """Return values of one signal as text: 0 or 1, a number with all its digits, or one of the signal's texts."""
    if signal.kind is SignalKind.WIRE:
        return chosen(("0", "1"), values)
    if signal.kind is SignalKind.TEXT:
        return chosen(signal.texts, values)
    return spelt(values, repr)


def _part(signal: Signal, window: Window, scale: TimeScale, after: int, until: int) -> tuple[Int64Array, Text]:
    """Return one signal's changes; the last one at an instant counts, but a wire must not have several."""
    counts, values = signal.changes.between(after, until)
    instants = scale.rounded(counts)
    again = np.flatnonzero(instants[1:] == instants[:-1])
    if again.size and signal.kind is SignalKind.WIRE:
        first, second = counts[again[0] : again[0] + 2].tolist()
        raise TooFastForScaleError(
            f"{signal.name}: changes twice within {(second - first) / COUNTS_PER_SECOND * 1e6:.3g} us at"
            f" t = {window.time_s(first):.6f} s, too fast for a time scale of {scale.vcd}: choose a finer one"
        )
    return np.delete(instants, again), _text(signal, np.delete(values, again))


def _merged(parts: list[tuple[Int64Array, Text]]) -> Merged:
    instants = np.concatenate([instants for instants, _ in parts])
    which = np.repeat(np.arange(len(parts)), [instants.size for instants, _ in parts])
    order = np.argsort(instants, kind="stable")
    return Merged(instants[order], which[order], stacked([text for _, text in parts])[order])


HEADER: Final = "counts,t_s,signal,value\n"


def csv(signals: Sequence[Signal], window: Window) -> Iterator[bytes]:
    """Yield a CSV file in pieces; columns: counts since power-up, motion time in seconds, signal, new value.

    The first rows are the values of all signals at the start of the window.
    """
    every = np.arange(len(signals))
    yield HEADER.encode()
    yield _rows(signals, window, np.full(every.size, window.from_counts), every, initial_values(signals, window))
    for part in merged(signals, window, COUNTS):
        yield _rows(signals, window, part.instants, part.which, part.values)


def arrays(signals: Sequence[Signal], window: Window) -> dict[str, Values]:
    """Return NAME_change_counts, NAME_values and NAME_initial for each signal; also the window and t = 0, in counts."""
    made: dict[str, Any] = {
        "from_counts": np.int64(window.from_counts),
        "to_counts": np.int64(window.to_counts),
        "start_counts": np.int64(window.start_counts),
    }
    for signal in signals:
        counts, values = signal.changes.between(window.from_counts, window.to_counts)
        made[f"{signal.name}_initial"] = np.asarray(signal.changes.at(window.from_counts), values.dtype)
        made[f"{signal.name}_change_counts"] = counts
        made[f"{signal.name}_values"] = values
    return made


def _rows(
    signals: Sequence[Signal], window: Window, counts: Int64Array, which: NDArray[np.intp], values: Text
) -> bytes:
    ns = NANOSECONDS.rounded(counts - window.start_counts)
    comma = constant(",", counts.size)
    names = matrix([f",{signal.name}," for signal in signals])[which]
    return lines(decimals(counts), comma, seconds(ns), names, values, constant("\n", counts.size))


_TYPES: Final = {SignalKind.WIRE: "wire 1", SignalKind.REAL: "real 64", SignalKind.TEXT: "string 1"}
_BEFORE: Final = {SignalKind.WIRE: "", SignalKind.REAL: "r", SignalKind.TEXT: "s"}
_BEHIND: Final = {SignalKind.WIRE: "", SignalKind.REAL: " ", SignalKind.TEXT: " "}
"""Characters before a value, and between the value and the signal's code."""

_FIRST_CODE: Final = ord("!")
_CODES: Final = 94
"""Number of printable ASCII characters in codes."""


def vcd(signals: Sequence[Signal], window: Window, scale: TimeScale, title: str) -> Iterator[bytes]:
    """Yield a file in pieces; its instants count from power-up, as in edges.npz and bus.log.

    Raises:
        InputError: a pulse is too short for the scale (see `merged`).
    """
    yield _header(signals, window, scale, title)
    last, end = scale.unit(window.from_counts), scale.unit(window.to_counts)
    initial = _assignments(signals, np.arange(len(signals)), initial_values(signals, window))
    yield f"#{last}\n$dumpvars\n".encode() + lines(*initial) + b"$end\n"
    for part in merged(signals, window, scale):
        yield _lines(signals, part, last)
        last = int(part.instants[-1])
    if end != last:
        yield f"#{end}\n".encode()


def _header(signals: Sequence[Signal], window: Window, scale: TimeScale, title: str) -> bytes:
    words = [
        f"$version StepTwin, SIMULATED: {title.replace('$', '')} $end",
        f"$comment #0 is power-up, #{scale.unit(window.start_counts)} the motion's t = 0 $end",
        f"$timescale {scale.vcd} $end",
    ]
    for scope, group in groupby(enumerate(signals), key=lambda numbered: numbered[1].scope):
        words.append(f"$scope module {scope} $end")
        words += [f"$var {_TYPES[signal.kind]} {_code(i)} {signal.name} $end" for i, signal in group]
        words.append("$upscope $end")
    return ("\n".join(words) + "\n$enddefinitions $end\n").encode()


def _lines(signals: Sequence[Signal], part: Merged, last: int) -> bytes:
    """Return the changes as lines, with a line of the instant before the first change at each instant."""
    later = np.diff(part.instants, prepend=last) != 0
    instants = part.instants[later]
    stamps = np.concatenate([constant("#", instants.size), decimals(instants), constant("\n", instants.size)], axis=1)
    stamped = np.zeros((later.size, stamps.shape[1]), np.uint8)
    stamped[later] = stamps
    return lines(stamped, *_assignments(signals, part.which, part.values))


def _assignments(signals: Sequence[Signal], which: NDArray[np.intp], values: Text) -> tuple[Text, Text, Text]:
    before = matrix([_BEFORE[signal.kind] for signal in signals])
    behind = matrix([f"{_BEHIND[signal.kind]}{_code(i)}\n" for i, signal in enumerate(signals)])
    return before[which], values, behind[which]


def _code(i: int) -> str:
    """Return a signal's code: one character, two from the 95th signal on."""
    more, last = divmod(i, _CODES)
    return (_code(more - 1) if more else "") + chr(_FIRST_CODE + last)


_JSON_TYPES: Final = {SignalKind.WIRE: "integer", SignalKind.REAL: "number", SignalKind.TEXT: "string"}


def write_mcap(file: BinaryIO, signals: Sequence[Signal], window: Window) -> None:
    """Write the file; its first messages are the values of all signals at the start of the window.

    Raises:
        InputError: the library is not installed.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError as error:
        raise InputError(f"mcap: the library is not installed ({installing('mcap')})") from error
    every = np.arange(len(signals))
    begin = Merged(np.full(every.size, window.from_counts), every, initial_values(signals, window))
    writer: Any = Writer(file)  # the library is partly untyped
    writer.start(library="steptwin, SIMULATED")
    channels = _channels(writer, signals)
    for part in chain([begin], merged(signals, window, COUNTS)):
        _add(writer, signals, channels, part)
    writer.finish()


def _channels(writer: Any, signals: Sequence[Signal]) -> list[int]:
    """Register a channel for each signal and a schema for each kind of value; return the channels."""
    schemas = {kind: writer.register_schema(*_schema(kind)) for kind in SignalKind}
    return [
        writer.register_channel(f"/{signal.scope}/{signal.quantity}", "json", schemas[signal.kind])
        for signal in signals
    ]


def _schema(kind: SignalKind) -> tuple[str, str, bytes]:
    shape = {"type": "object", "properties": {"value": {"type": _JSON_TYPES[kind]}}}
    return f"steptwin.{kind.value}", "jsonschema", json.dumps(shape).encode()


def _add(writer: Any, signals: Sequence[Signal], channels: list[int], part: Merged) -> None:
    instants_ns: list[int] = NANOSECONDS.rounded(part.instants).tolist()
    texts = np.ascontiguousarray(part.values).view(f"S{part.values.shape[1]}").ravel().tolist()
    quotes = [b'"' if signal.kind is SignalKind.TEXT else b"" for signal in signals]
    for t_ns, which, text in zip(instants_ns, part.which.tolist(), texts, strict=True):
        quote = quotes[which]
        writer.add_message(channels[which], t_ns, b'{"value": ' + quote + text + quote + b"}", t_ns)


class Format(StrEnum):
    """Formats of waveform files."""

    VCD = "vcd"
    VCD_FULL = "vcd-full"
    CSV = "csv"
    NPZ = "npz"
    MCAP = "mcap"

    @property
    def file_name(self) -> str:
        """Name of the file in a run's folder with the whole waveform."""
        return "trace-full.vcd" if self is Format.VCD_FULL else f"trace.{self}"

    @property
    def part_file_name(self) -> str:
        """Name of the file in a run's folder with some axes or a window."""
        stem, suffix = self.file_name.split(".")
        return f"{stem}-part.{suffix}"

    @property
    def wires_only(self) -> bool:
        """True if the format has only STEP, DIR, ENABLE, RESET and outputs; other formats have every signal."""
        return self not in (Format.VCD_FULL, Format.MCAP)


def write_waveform(
    path: Path, signals: Sequence[Signal], window: Window, form: Format, title: str, scale: TimeScale | None = None
) -> None:
    """Write the file under its name; on an error an older file of that name is kept.

    Without a time scale, a VCD file has the coarsest one that separates all changes of each wire: usually 1 us, a finer
    one if a noisy wire has shorter pulses.

    Raises:
        InputError: a pulse is too short for the time scale, or the library for MCAP files is not installed.
        OSError: the file cannot be written.
    """
    *coarser, finest = SCALES.values() if scale is None else (scale,)
    for each in coarser:
        try:
            return _write(path, signals, window, form, title, each)
        except TooFastForScaleError:
            continue
    return _write(path, signals, window, form, title, finest)


def _write(path: Path, signals: Sequence[Signal], window: Window, form: Format, title: str, scale: TimeScale) -> None:
    with whole_file(path) as file:
        if form is Format.MCAP:
            write_mcap(file, signals, window)
        elif form is Format.NPZ:
            made: dict[str, Any] = arrays(signals, window)
            np.savez_compressed(file, **made)
        elif form is Format.CSV:
            file.writelines(csv(signals, window))
        else:
            file.writelines(vcd(signals, window, scale, title))
