"""Poses of tools: tasks of tools, notations of orientations, and rotations."""

from steptwin.host.robots.poses.rotations import (
    COLUMNS,
    DIRECTION,
    ORIENTATIONS,
    Orientation,
    have_right_length,
    orientations_of,
)
from steptwin.host.robots.poses.task import (
    DIRECTION_TASK,
    NO_TOOL,
    PLACE,
    POSE,
    POSITION,
    SCARA,
    STEP_NAMES,
    TASKS,
    TURNS,
    Pose,
    PoseDocument,
    Task,
    Turning,
    turn_of,
)

__all__ = [
    "COLUMNS",
    "DIRECTION",
    "DIRECTION_TASK",
    "NO_TOOL",
    "ORIENTATIONS",
    "PLACE",
    "POSE",
    "POSITION",
    "SCARA",
    "STEP_NAMES",
    "TASKS",
    "TURNS",
    "Orientation",
    "Pose",
    "PoseDocument",
    "Task",
    "Turning",
    "have_right_length",
    "orientations_of",
    "turn_of",
]
