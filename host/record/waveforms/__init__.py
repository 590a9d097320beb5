"""Write waveforms of a run's evidence for logic analysers, viewers and tables.

`signals` makes signals of the evidence; `merging` puts their changes in order of time; `vcd`, `table` and `mcap_file`
write them.
"""

from steptwin.host.record.waveforms.export import Format, write_waveform
from steptwin.host.record.waveforms.signal import Changes, HeldValues, Pulses, Signal, SignalKind
from steptwin.host.record.waveforms.signals import drive_states, everything, phases, pins, whole_record, wires
from steptwin.host.record.waveforms.timebase import SCALES, TimeScale, Window

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
