"""The operator's desk: one machine on one bus, which any number of pages watch and one operator moves.

Begin reading at `desk.py: Desk`. Nothing here knows of a page.
"""

from steptwin.host.panel.desk.desk import Desk
from steptwin.host.panel.desk.drives import Disable, Enable, ResetFaults, SwitchOutput, WriteSettings
from steptwin.host.panel.desk.history import Drawing, Event, EventLog, History, HistorySamples, Severity
from steptwin.host.panel.desk.jogs import Jog, JointJog, ToolJog
from steptwin.host.panel.desk.moves import (
    DeclareHere,
    HomeAll,
    HomeJoint,
    MoveJoints,
    MoveTool,
    RunMotion,
    StepJoint,
    StepTool,
)
from steptwin.host.panel.desk.requests import Command, Operators
from steptwin.host.panel.desk.results import Result
from steptwin.host.panel.desk.settings import Setting
from steptwin.host.panel.desk.state import Activity, JointView, Snapshot
from steptwin.host.panel.desk.words import AS_SLOW_AS_NEEDED, MOVE_TO_START, STANDS_THERE, RefusedError, told

__all__ = [
    "AS_SLOW_AS_NEEDED",
    "MOVE_TO_START",
    "STANDS_THERE",
    "Activity",
    "Command",
    "DeclareHere",
    "Desk",
    "Disable",
    "Drawing",
    "Enable",
    "Event",
    "EventLog",
    "History",
    "HistorySamples",
    "HomeAll",
    "HomeJoint",
    "Jog",
    "JointJog",
    "JointView",
    "MoveJoints",
    "MoveTool",
    "Operators",
    "RefusedError",
    "ResetFaults",
    "Result",
    "RunMotion",
    "Setting",
    "Severity",
    "Snapshot",
    "StepJoint",
    "StepTool",
    "SwitchOutput",
    "ToolJog",
    "WriteSettings",
    "told",
]
