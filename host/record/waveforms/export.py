"""Write a waveform file in any of the formats.

Times are nanoseconds since power-up. The same run gives the same bytes.
"""

import json
from collections.abc import Sequence
from enum import StrEnum
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.waveforms.merging import Merged, TooFastForScaleError, initial_values, merged
from steptwin.host.record.waveforms.signal import Signal, SignalKind
from steptwin.host.record.waveforms.timebase import COUNTS, NANOSECONDS, SCALES, TimeScale, Window
from steptwin.host.record.waveforms.vcd import arrays, csv, vcd

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
