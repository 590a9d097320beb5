"""Write a waveform file in any of the formats."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.waveforms.mcap_file import write_mcap
from steptwin.host.record.waveforms.merging import TooFastForScaleError
from steptwin.host.record.waveforms.signal import Signal
from steptwin.host.record.waveforms.table import arrays, csv
from steptwin.host.record.waveforms.timebase import SCALES, TimeScale, Window
from steptwin.host.record.waveforms.vcd import vcd


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
