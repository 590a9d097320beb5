"""Waveforms of a run's evidence: pins and what follows from them over time, for logic analysers and for tables."""

from host.waveforms.bus_states import drive_states
from host.waveforms.export import Format, write_waveform
from host.waveforms.signal import Kind, Pulses, Signal, Steps
from host.waveforms.signals import everything, whole_record, wires
from host.waveforms.timebase import DEFAULT_SCALE, SCALES, TimeScale, Window

__all__ = [
    "DEFAULT_SCALE",
    "SCALES",
    "Format",
    "Kind",
    "Pulses",
    "Signal",
    "Steps",
    "TimeScale",
    "Window",
    "drive_states",
    "everything",
    "whole_record",
    "wires",
    "write_waveform",
]
