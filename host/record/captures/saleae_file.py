"""Read Saleae Logic 2's binary export: a file `digital_N.bin` for each channel, with the instants of its changes.

Source: Saleae's support page "Binary Export Format - Logic 2", version 0; a file of a real Logic 2 was never at hand.
"""

import struct
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.record.captures.capture import Capture, Channel, check_changes, check_channels

MAGIC: Final = b"<SALEAE>"
_HEAD: Final = struct.Struct("<8siiIddQ")
_VERSION, _DIGITAL = 0, 0
_TICK_S: Final = 1e-10


def read_saleae(files: dict[str, BinaryIO]) -> Capture:
    """Read the files of one recording, by their names; raise InputError, with the name, if one is damaged."""
    check_channels(len(files))
    read = {name: _read(name, file) for name, file in files.items()}
    begin_s = min(times for _, times, _, _ in read.values())
    end_s = max(end for _, _, end, _ in read.values())
    check_changes(sum(changes.size for _, _, _, changes in read.values()))
    channels = tuple(
        Channel(Path(name).stem, level, np.rint((changes - begin_s) / _TICK_S).astype(np.int64))
        for name, (level, _, _, changes) in read.items()
    )
    return Capture("Saleae's binary export", channels, _TICK_S, round((end_s - begin_s) / _TICK_S), None)


def _read(name: str, file: BinaryIO) -> tuple[int, float, float, FloatArray]:
    """Return the first level, the begin, the end and the changes of one channel."""
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size or head[:8] != MAGIC:
        raise InputError(f"{name}: is no binary export of Logic 2")
    _, version, kind, level, begin_s, end_s, count = _HEAD.unpack(head)
    if (version, kind) != (_VERSION, _DIGITAL):
        raise InputError(f"{name}: is version {version}, type {kind} of the export; version 0 of digital data is read")
    check_changes(count)
    data = file.read(8 * count + 1)
    times = np.frombuffer(data[: len(data) - len(data) % 8], "<f8")
    if len(data) != 8 * count or not np.isfinite([begin_s, end_s, *times[:1], *times[-1:]]).all():
        raise InputError(f"{name}: says {count} changes, but has {len(data) / 8:g}")
    if not (np.diff(np.concatenate(([begin_s], times, [end_s]))) >= 0.0).all():
        raise InputError(f"{name}: its changes are not in order of time")
    return level & 1, begin_s, end_s, times.astype(np.float64)
