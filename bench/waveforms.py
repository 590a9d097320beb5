"""Measure how fast edges become text, and how much memory that takes beside the edges themselves."""

import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from steptwin.host.record.waveforms import SCALES, HeldValues, Pulses, Signal, SignalKind, Window
from steptwin.host.record.waveforms.vcd import csv, vcd
from steptwin.host.studies.step_methods.loads import AXES
from steptwin.protocol.timer import COUNTS_PER_SECOND

RATE_HZ = 14_000
DURATION_S = 30
REPEATS = 3
_CLK_HIGH_COUNTS = 2_376


@dataclass(frozen=True)
class WaveformFigure:
    """One row of the table."""

    form: str
    edges: int
    edges_per_s: float
    copy_ratio: float
    """Time of making the text divided by the time of copying it."""
    peak_mb: float
    """Largest memory use beside the edges."""
    peak_mb_tenth: float
    """Largest memory use for a tenth of the edges."""


def figures() -> list[WaveformFigure]:
    """Measure STEP and DIR of all axes near the drivers' highest rate; the text is made in pieces and dropped."""
    return [_figure(form) for form in ("vcd 1us", "vcd 100ns", "csv")]


def _figure(form: str) -> WaveformFigure:
    signals, window = _record(DURATION_S)
    edges = sum(_changes(signal) for signal in signals)
    seconds, copy_s = min(_once(form, signals, window) for _ in range(REPEATS))
    peaks_mb = [_peak_mb(form, *_record(duration_s)) for duration_s in (DURATION_S, DURATION_S // 10)]
    return WaveformFigure(form, edges, edges / seconds, seconds / copy_s, *peaks_mb)


def _record(duration_s: int) -> tuple[list[Signal], Window]:
    """Make axes with slightly different rates, so that edges do not coincide, and a reversal every 1000 steps."""
    signals = []
    for axis in range(AXES):
        rises = np.arange(0, duration_s * COUNTS_PER_SECOND, COUNTS_PER_SECOND // RATE_HZ + 7 * axis)
        turns = rises[500::1000] - 1_200
        levels = (np.arange(turns.size) % 2).astype(np.int8)
        signals.append(Signal(f"axis{axis}", "step", SignalKind.WIRE, Pulses(rises, rises + _CLK_HIGH_COUNTS)))
        signals.append(Signal(f"axis{axis}", "dir", SignalKind.WIRE, HeldValues(turns, levels, 1)))
    return signals, Window(0, duration_s * COUNTS_PER_SECOND, 0)


def _changes(signal: Signal) -> int:
    return int(signal.changes.between(-1, 1 << 62)[0].size)


def _pieces(form: str, signals: list[Signal], window: Window) -> Iterator[bytes]:
    if form == "csv":
        return csv(signals, window)
    return vcd(signals, window, SCALES[form.removeprefix("vcd ")], "bench")


def _once(form: str, signals: list[Signal], window: Window) -> tuple[float, float]:
    started = time.process_time()
    copy_s = 0.0
    for piece in _pieces(form, signals, window):
        source = np.frombuffer(piece, np.uint8)
        before = time.process_time()
        source.copy()
        copy_s += time.process_time() - before
    return time.process_time() - started - copy_s, copy_s


def _peak_mb(form: str, signals: list[Signal], window: Window) -> float:
    tracemalloc.start()
    for _ in _pieces(form, signals, window):
        pass
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak_bytes / 1e6
