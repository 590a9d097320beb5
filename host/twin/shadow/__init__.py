"""Beside a running machine: a twin hears the hosts' frames, and what the real board says otherwise is told.

`shadow` plays the frames to the twin by their time stamps, `discrepancy` compares what nodes say once, `axes` what
drives tell again and again: states, positions, homing. `asking` asks a machine how it stands, and `standing` lets the
twin stand so. `stamps` makes a time that never steps of the stamps.
"""

from steptwin.host.twin.shadow.asking import NodeValues, Questions
from steptwin.host.twin.shadow.discrepancy import Discrepancy, DiscrepancyKind, grouped, time_text
from steptwin.host.twin.shadow.shadow import ClockStep, Shadow
from steptwin.host.twin.shadow.standing import joints_told

__all__ = [
    "ClockStep",
    "Discrepancy",
    "DiscrepancyKind",
    "NodeValues",
    "Questions",
    "Shadow",
    "grouped",
    "joints_told",
    "time_text",
]
