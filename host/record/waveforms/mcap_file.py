"""Write MCAP files, which Foxglove shows: a topic /AXIS/SIGNAL for each signal, messages {"value": ...} in JSON.

Times are nanoseconds since power-up. The same run gives the same bytes.
"""

import json
from collections.abc import Sequence
from itertools import chain
from typing import Any, BinaryIO, Final

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms.merging import Merged, initial_values, merged
from steptwin.host.record.waveforms.signal import Signal, SignalKind
from steptwin.host.record.waveforms.timebase import COUNTS, NANOSECONDS, Window

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
