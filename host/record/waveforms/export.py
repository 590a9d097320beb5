"""Write a waveform file in any of the formats; the same run gives the same bytes.

Times of MCAP are nanoseconds since power-up. VCD files are value change dumps (IEEE 1364-2005, clause 18), which logic
analysers and waveform viewers read. For sigrok a VCD file holds wires of one bit only, since sigrok's import stops at a
wire of several bits. It also drops scopes, so names differ without them. Numbers and texts are variables of type `real`
and `string`; GTKWave defines the latter.
"""

import json
from collections.abc import Iterator, Sequence
from enum import StrEnum
from itertools import chain, groupby
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.waveforms.merging import (
    Merged,
    Text,
    TooFastForScaleError,
    constant,
    decimals,
    initial_values,
    lines,
    matrix,
    merged,
    seconds,
)
from steptwin.host.record.waveforms.signal import (
    COUNTS,
    NANOSECONDS,
    SCALES,
    Signal,
    SignalKind,
    TimeScale,
    Values,
    Window,
)

HEADER: Final = "counts,t_s,signal,value\n"


def csv(signals: Sequence[Signal], window: Window) -> Iterator[bytes]:
    """Yield a CSV file in pieces; columns: counts since power-up, motion time in seconds, signal, new value.

    The first rows are the values of all signals at the beginning of the window.
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
"""Number of printable ASCII characters: codes are made of these."""


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
    """Write the file; its first messages are the values of all signals at the beginning of the window.

    Raises:
        InputError: the library is not installed.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError as error:
        raise InputError("mcap: the library is not installed (pip install 'steptwin[mcap]')") from error
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
    instants_ns = _nanoseconds(part.instants)
    texts = np.ascontiguousarray(part.values).view(f"S{part.values.shape[1]}").ravel().tolist()
    quotes = [b'"' if signal.kind is SignalKind.TEXT else b"" for signal in signals]
    for t_ns, which, text in zip(instants_ns, part.which.tolist(), texts, strict=True):
        quote = quotes[which]
        writer.add_message(channels[which], t_ns, b'{"value": ' + quote + text + quote + b"}", t_ns)


def _nanoseconds(counts: Int64Array) -> list[int]:
    instants_ns: list[int] = NANOSECONDS.rounded(counts).tolist()
    return instants_ns


class Format(StrEnum):
    """Formats of waveform files."""

    VCD = "vcd"
    VCD_FULL = "vcd-full"
    CSV = "csv"
    NPZ = "npz"
    MCAP = "mcap"

    @property
    def file_name(self) -> str:
        """Name of the file in a run's folder that holds the whole waveform."""
        return "trace-full.vcd" if self is Format.VCD_FULL else f"trace.{self}"

    @property
    def part_file_name(self) -> str:
        """Name of the file in a run's folder that holds only some axes or a window."""
        stem, suffix = self.file_name.split(".")
        return f"{stem}-part.{suffix}"

    @property
    def wires_only(self) -> bool:
        """True if the format holds only STEP, DIR, ENABLE, RESET and outputs; the other formats hold every signal."""
        return self not in (Format.VCD_FULL, Format.MCAP)


def write_waveform(
    path: Path, signals: Sequence[Signal], window: Window, form: Format, title: str, scale: TimeScale | None = None
) -> None:
    """Write the file under the name given; on an error an older file of that name stays as it was.

    Without a time scale, a VCD file has the coarsest one that tells all changes of each wire apart: usually 1 us, a
    finer one where a noisy wire has shorter pulses.

    Raises:
        InputError: a pulse is too short for the time scale given, or the library for MCAP files is not installed.
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
