"""G-code for tool paths: a reader of our own, the words that hold from line to line, and paths without a stop."""

from steptwin.host.planning.gcode.blocks import GROUPS, GcodeBlock, read_blocks
from steptwin.host.planning.gcode.modal import (
    CutMove,
    Dwell,
    GcodeAction,
    HomeMove,
    OutputWord,
    RapidMove,
    Spot,
    actions,
)
from steptwin.host.planning.gcode.tool_paths import CutRun, Placing, cut_runs

__all__ = [
    "GROUPS",
    "CutMove",
    "CutRun",
    "Dwell",
    "GcodeAction",
    "GcodeBlock",
    "HomeMove",
    "OutputWord",
    "Placing",
    "RapidMove",
    "Spot",
    "actions",
    "cut_runs",
    "read_blocks",
]
