"""Write waveforms of a run's evidence for logic analysers, viewers and tables.

`signal` makes signals from the evidence; `export` sorts their changes by time and writes them.
"""

from steptwin.host.record.waveforms.export import Format, write_waveform
from steptwin.host.record.waveforms.signal import (
    SCALES,
    Changes,
    HeldValues,
    Pulses,
    Signal,
    SignalKind,
    TimeScale,
    Window,
    drive_states,
    everything,
    phases,
    pins,
    whole_record,
    wires,
)

__all__ = [
    "SCALES",
    "Changes",
    "Format",
    "HeldValues",
    "Pulses",
    "Signal",
    "SignalKind",
    "TimeScale",
    "Window",
    "drive_states",
    "everything",
    "phases",
    "pins",
    "whole_record",
    "wires",
    "write_waveform",
]
