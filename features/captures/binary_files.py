"""Read captures that are no text: sigrok's session files, `.sr`, and Saleae Logic 2's binary export.

A session is a zip of samples in parts of 4 MiB, read part by part. Its file `metadata` has the rate, the probes' names
and the bytes of a sample: as many as all probes need, 3 of 24. Source: sigrok's wiki, "File format:Sigrok/v2".

The export has a file `digital_N.bin` for each channel, with the instants of its changes. Source: Saleae's support page
"Binary Export Format - Logic 2", version 0; a file of a real Logic 2 was never at hand.
"""

import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from configparser import ConfigParser, SectionProxy
from configparser import Error as MetadataError
from os import SEEK_END
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.features.captures.capture import Capture, Channel, changes_of, check_changes, check_channels, check_lasts
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import GIB, MIB

_PART_BYTES_MAX: Final = 64 * MIB
"""sigrok writes parts of 4 MiB; a part is held in memory."""
_RECORD_BYTES_MAX: Final = 256 * GIB
"""Three hours of 8 probes at 24 MHz; it is known before a part is read."""
_METADATA_BYTES_MAX: Final = MIB
_UNITS: Final = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
_RATE: Final = re.compile(r"\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*([kmg]?)(?:hz)?\s*", re.IGNORECASE)
MAGIC: Final = b"<SALEAE>"
_HEAD: Final = struct.Struct("<8siiIddQ")
_VERSION, _DIGITAL = 0, 0
_TICK_S: Final = 1e-10


def rate_of(text: str) -> float:
    """Return the rate that a text such as `24 MHz`, `8MHz` or `500000` spells, in Hz; raise InputError for another."""
    found = _RATE.fullmatch(text)
    try:
        rate_hz = float(found[1]) * _UNITS[found[2].lower()] if found else 0.0
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 1e11:
        raise InputError(f"a sampling rate of {text!r} is none from 1 Hz to 100 GHz, such as 24MHz")
    return rate_hz


def read_session(file: IO[bytes]) -> Capture:
    """Read a session file; raise InputError if it is damaged, or holds no digital channels."""
    try:
        with zipfile.ZipFile(file) as session:
            return _read(session, file.seek(0, SEEK_END))
    except (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, zlib.error) as error:
        raise InputError(f"is no session of sigrok: {error}") from error


def _read(session: zipfile.ZipFile, file_bytes: int) -> Capture:
    device = _device(session)
    try:
        unit, rate = int(device["unitsize"]), rate_of(device["samplerate"])
        name = device["capturefile"]
    except (KeyError, ValueError) as error:
        raise InputError(f"metadata: {error} of the device is missing or wrong") from error
    probes = {int(key[5:]): text for key, text in device.items() if re.fullmatch(r"probe[0-9]{1,4}", key)}
    check_channels(max(probes, default=0))
    if not 1 <= unit <= 8 or unit * 8 < max(probes):
        raise InputError(f"metadata: unitsize {unit} is not what {max(probes)} probes need, 1 to 8 bytes")
    at, values, samples = _changes(session, _parts(session, name, file_bytes), unit)
    analog = int(device["total analog"]) if device.get("total analog", "").isdecimal() else 0
    told = (f"{analog} analog channels are left out",) if analog else ()
    names = [probes.get(number, f"D{number - 1}") for number in range(1, max(probes) + 1)]
    return Capture("sigrok session", changes_of(values, at, names), 1.0 / rate, samples, rate, sampled=True, told=told)


def _device(session: zipfile.ZipFile) -> SectionProxy:
    try:
        entry = session.getinfo("metadata")
    except KeyError:
        raise InputError("is no session of sigrok: it has no metadata") from None
    if entry.file_size > _METADATA_BYTES_MAX:
        raise InputError(f"metadata: has {entry.file_size} bytes, more than {_METADATA_BYTES_MAX}")
    metadata = ConfigParser(interpolation=None, strict=False)
    try:
        metadata.read_string(session.read(entry).decode("utf-8", "replace"))
    except MetadataError as error:
        raise InputError(f"metadata: {str(error).splitlines()[0]}") from error
    for section in metadata.sections():
        if section.startswith("device") and "capturefile" in metadata[section]:
            return metadata[section]
    raise InputError("metadata: no device has recorded digital channels")


def _parts(session: zipfile.ZipFile, name: str, file_bytes: int) -> list[zipfile.ZipInfo]:
    """Return the parts of the record in their order, which is by number: logic-1-2 comes before logic-1-10."""
    numbered = re.compile(rf"{re.escape(name)}(?:-([0-9]+))?")
    found = [(int(part[1] or 0), entry) for entry in session.infolist() if (part := numbered.fullmatch(entry.filename))]
    if not found:
        raise InputError(f"has no part {name}-1 of the record")
    if len({part for part, _ in found}) < len(found):
        raise InputError("its directory names a part of the record twice")
    for _, entry in found:
        if entry.file_size > _PART_BYTES_MAX:
            raise InputError(f"{entry.filename}: has {entry.file_size} bytes, more than {_PART_BYTES_MAX}")
    if sum(entry.compress_size for _, entry in found) > file_bytes:
        raise InputError("its directory names the same data for several parts of the record")
    whole = sum(entry.file_size for _, entry in found)
    if whole > _RECORD_BYTES_MAX:
        raise InputError(f"its record has {whole} bytes, more than {_RECORD_BYTES_MAX}: cut it")
    return [entry for _, entry in sorted(found, key=lambda each: each[0])]


def _changes(
    session: zipfile.ZipFile, parts: list[zipfile.ZipInfo], unit: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Return the first sample and all that differ from the one before, by number and value; and how many there are."""
    at, values, samples, found, last = [], [], 0, 0, None
    for words in _words(session, parts, unit):
        changed = np.flatnonzero(words[1:] != words[:-1]) + 1
        if last is None or words[0] != last:
            changed = np.concatenate(([0], changed))
        found += changed.size
        check_changes(found)
        at.append(samples + changed)
        values.append(words[changed])
        samples, last = samples + words.size, words[-1]
    if not at:
        raise InputError("has no samples")
    return np.concatenate(at), np.concatenate(values).astype(np.uint64).view(np.int64), samples


def _words(session: zipfile.ZipFile, parts: list[zipfile.ZipInfo], unit: int) -> Iterator[NDArray[Any]]:
    """Yield the samples of each part as whole numbers; a sample may begin in one part and end in the next."""
    size = 1 << (unit - 1).bit_length()
    left = b""
    for entry in parts:
        data = left + session.read(entry)
        whole = len(data) - len(data) % unit
        data, left = data[:whole], data[whole:]
        if whole and size == unit:
            yield np.frombuffer(data, f"<u{size}")
        elif whole:
            padded = np.zeros((whole // unit, size), np.uint8)
            padded[:, :unit] = np.frombuffer(data, np.uint8).reshape(-1, unit)
            yield padded.view(f"<u{size}")[:, 0]


def read_saleae(files: dict[str, BinaryIO]) -> Capture:
    """Read the files of one recording, by their names; raise InputError, with the name, if one is damaged."""
    check_channels(len(files))
    read = {name: _read_file(name, file) for name, file in files.items()}
    begin_s = min(times for _, times, _, _ in read.values())
    end_s = max(end for _, _, end, _ in read.values())
    check_changes(sum(changes.size for _, _, _, changes in read.values()))
    check_lasts(end_s - begin_s)
    channels = tuple(
        Channel(Path(name).stem, level, np.rint((changes - begin_s) / _TICK_S).astype(np.int64))
        for name, (level, _, _, changes) in read.items()
    )
    return Capture("Saleae's binary export", channels, _TICK_S, round((end_s - begin_s) / _TICK_S), None)


def _read_file(name: str, file: BinaryIO) -> tuple[int, float, float, FloatArray]:
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
    instants = np.concatenate(([begin_s], times, [end_s]))
    if not (instants[1:] >= instants[:-1]).all():
        raise InputError(f"{name}: its changes are not in order of time")
    return level & 1, begin_s, end_s, times.astype(np.float64)
