"""Captures of a logic analyser: read the files, wire channels to axes, find the plan's time in them.

A file is read whatever program wrote it: what its first bytes say decides, not its name.
"""

from contextlib import ExitStack
from dataclasses import replace
from io import TextIOWrapper
from os import fstat
from pathlib import Path
from typing import BinaryIO, Final, cast

from steptwin.features.captures.binary_files import MAGIC, rate_of, read_saleae, read_session
from steptwin.features.captures.capture import Capture, Channel
from steptwin.features.captures.channel_map import AxisSignals, ChannelMap, capture_facts, wired
from steptwin.features.captures.text_files import read_csv, read_vcd
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import GIB, check_size
from steptwin.host.common.own_files import only_files
from steptwin.host.verify.clock_fit import ClockFit, fit_clock

__all__ = [
    "AxisSignals",
    "Capture",
    "Channel",
    "ChannelMap",
    "ClockFit",
    "capture_facts",
    "fit_clock",
    "read_capture",
    "wired",
]
CAPTURE_BYTES_MAX: Final = 8 * GIB
"""sigrok's CSV of 24 channels at 24 MHz has 1.2 GB a second; no other format is nearly as large."""


def read_capture(path: str | Path, rate: str | None = None) -> Capture:
    """Read a capture: a sigrok session, a VCD, a CSV of sigrok, Logic 2 or WaveForms, or a folder of Logic 2's files.

    Args:
        path: the file, or the folder with Logic 2's files digital_N.bin.
        rate: sampling rate such as 24MHz, for a file that does not tell it.

    Raises:
        InputError: the file cannot be read or is none of these; the message names it.
    """
    stated_hz = None if rate is None else rate_of(rate)
    with prefixed(f"{path}: "):
        try:
            capture = _read(Path(path))
        except OSError as error:
            raise InputError(error.strerror or str(error)) from error
        except UnicodeDecodeError as error:
            raise InputError("is none of sigrok's, Saleae's and WaveForms' files, nor a VCD") from error
        told_hz = capture.rate_hz
        differs = stated_hz is not None and told_hz is not None and abs(stated_hz / told_hz - 1.0) > 1e-6
        if differs and capture.sampled:
            raise InputError(f"tells its sampling rate, {told_hz:g} Hz: leave out rate={rate}")
    return capture if stated_hz is None else replace(capture, rate_hz=stated_hz)


def _read(path: Path) -> Capture:
    if path.is_dir():
        names = sorted(path.glob("digital_*.bin"), key=lambda each: (len(each.name), each.name))
        if not names:
            raise InputError("is a folder without files digital_N.bin of Logic 2's binary export")
        with ExitStack() as opened:
            files = {each.name: opened.enter_context(_open(each)) for each in names}
            return read_saleae(files)
    with _open(path) as file:
        check_size(fstat(file.fileno()).st_size, CAPTURE_BYTES_MAX)
        begins = file.read(len(MAGIC))
        file.seek(0)
        if begins.startswith(b"PK"):
            return read_session(file)
        if begins == MAGIC:
            return read_saleae({path.name: file})
        text = TextIOWrapper(file, "utf-8-sig")
        return read_vcd(text) if begins.lstrip()[:1] == b"$" else read_csv(text)


def _open(path: Path) -> BinaryIO:
    return cast(BinaryIO, open(path, "rb", opener=only_files))
