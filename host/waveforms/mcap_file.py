"""MCAP, the container that Foxglove shows: a topic for each signal, /AXIS/SIGNAL, with messages {"value": ...} in JSON.

Times are nanoseconds since power-up. The same run gives the same bytes.
"""

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import BinaryIO, Final

import numpy as np

from host.errors import InputError
from host.waveforms.mcap_container import McapWriter, Messages
from host.waveforms.merging import Merged, initial_values, merged
from host.waveforms.signal import Kind, Signal
from host.waveforms.text import matrix
from host.waveforms.timebase import COUNTS, NANOSECONDS, Window

_JSON_TYPES: Final = {Kind.WIRE: "integer", Kind.REAL: "number", Kind.TEXT: "string"}
_QUOTES: Final = {Kind.WIRE: "", Kind.REAL: "", Kind.TEXT: '"'}

MESSAGES_PER_CHUNK: Final = 1 << 16
"""Three megabytes: a viewer reads a whole chunk to show a part of it."""

_ZSTD_LEVEL: Final = 1
"""The quickest: two thirds of the file are the index of messages, which is not compressed."""


def write_mcap(file: BinaryIO, signals: Sequence[Signal], window: Window) -> None:
    """Write the file; its first messages are the values that all signals have where the window begins.

    Raises:
        InputError: the library that compresses is not installed.
    """
    try:
        from zstandard import ZstdCompressor
    except ModuleNotFoundError as error:
        raise InputError("mcap: zstandard is not installed (pip install 'steptwin[mcap]')") from error
    writer = McapWriter(file, "steptwin, SIMULATED", "zstd", ZstdCompressor(level=_ZSTD_LEVEL).compress)
    schemas = {kind: writer.add_schema(f"steptwin.{kind.value}", "jsonschema", _schema(kind)) for kind in Kind}
    for signal in signals:
        writer.add_channel(f"/{signal.scope}/{signal.what}", "json", schemas[signal.kind])
    for messages in _chunks(signals, window):
        writer.add_chunk(messages)
    writer.finish()


def _schema(kind: Kind) -> str:
    return json.dumps({"type": "object", "properties": {"value": {"type": _JSON_TYPES[kind]}}})


def _chunks(signals: Sequence[Signal], window: Window) -> Iterator[Messages]:
    """The changes as messages; channels are numbered from 1 on, as the signals are from 0."""
    before = matrix([f'{{"value": {_QUOTES[signal.kind]}' for signal in signals])
    behind = matrix([f"{_QUOTES[signal.kind]}}}" for signal in signals])
    every = np.arange(len(signals))
    begin = Merged(np.full(every.size, window.from_counts), every, initial_values(signals, window))
    for part in chain([begin], merged(signals, window, COUNTS)):
        for first in range(0, part.which.size, MESSAGES_PER_CHUNK):
            some = slice(first, first + MESSAGES_PER_CHUNK)
            which, values = part.which[some], part.values[some]
            data = np.concatenate([before[which], values, behind[which]], axis=1)
            yield Messages((which + 1).astype(np.uint16), NANOSECONDS.rounded(part.instants[some]), data)
