"""Beside a running machine: a twin hears the hosts' frames, and what the real board says otherwise is told.

`shadow` plays the frames to the twin by their time stamps, `discrepancy` compares what nodes say once, `axes` what
drives tell again and again: states, positions, homing. `asking` asks a machine how it stands, and `standing` lets the
twin stand so.
"""

from steptwin.host.twin.shadow.asking import NodeValues, Questions
from steptwin.host.twin.shadow.discrepancy import Discrepancy, DiscrepancyKind
from steptwin.host.twin.shadow.shadow import Shadow
from steptwin.host.twin.shadow.standing import joints_told

__all__ = ["Discrepancy", "DiscrepancyKind", "NodeValues", "Questions", "Shadow", "joints_told"]
