"""What a run leaves in its folder, whether in virtual time or live, and how it is read again.

docs/run-folder.md says what is in which file.
"""

from host.recording.edges import AxisTotals, EdgeSpool, read_edges, write_edges
from host.recording.folder import BUS_LOG, EDGES, PINS, REPORT, TRAJECTORY, prepare_folder, read_evidence
from host.recording.pins import PinLog, read_outputs

__all__ = [
    "BUS_LOG",
    "EDGES",
    "PINS",
    "REPORT",
    "TRAJECTORY",
    "AxisTotals",
    "EdgeSpool",
    "PinLog",
    "prepare_folder",
    "read_edges",
    "read_evidence",
    "read_outputs",
    "write_edges",
]
