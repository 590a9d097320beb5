"""Writing a waveform's file in one of the formats that there are."""

from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from host.waveforms.mcap_file import write_mcap
from host.waveforms.signal import Signal
from host.waveforms.table import arrays, csv
from host.waveforms.timebase import TimeScale, Window
from host.waveforms.vcd import vcd


class Format(StrEnum):
    """What a waveform can be written as."""

    VCD = "vcd"
    VCD_FULL = "vcd-full"
    CSV = "csv"
    NPZ = "npz"
    MCAP = "mcap"

    @property
    def file_name(self) -> str:
        """Of a file in a run's folder."""
        return "trace-full.vcd" if self is Format.VCD_FULL else f"trace.{self}"

    @property
    def wires_only(self) -> bool:
        """Whether it has STEP, DIR, ENABLE, RESET and outputs only; the others have all that there is."""
        return self not in (Format.VCD_FULL, Format.MCAP)


def write_waveform(
    path: Path, signals: Sequence[Signal], window: Window, form: Format, scale: TimeScale, title: str
) -> None:
    """Write the file.

    Raises:
        InputError: a pulse is too short for the time scale of a VCD file, and nothing is left of the file then; or the
            library for MCAP files is not installed.
    """
    if form is Format.MCAP:
        write_mcap(path, signals, window)
    elif form is Format.NPZ:
        made: dict[str, Any] = arrays(signals, window)
        np.savez_compressed(path, **made)
    elif form is Format.CSV:
        _write(path, csv(signals, window))
    else:
        _write(path, vcd(signals, window, scale, title))


def _write(path: Path, pieces: Iterator[bytes]) -> None:
    try:
        with path.open("wb") as file:
            file.writelines(pieces)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
