"""The columns of a CSV trajectory that follow from its positions and velocities: they are for people and their plots.

Between two points with velocities the motion is a cubic, so it is known without its accelerations and tool poses.
"""

from collections.abc import Iterable, Sequence
from typing import Final

VELOCITY: Final = "v_"
"""Prefix of a joint's name in the header of its velocities."""

ACCELERATION: Final = "a_"
"""Prefix of a joint's name in the header of its accelerations, in mm/s^2 and deg/s^2."""

TOOL_POSE: Final = ("tool_x", "tool_y", "tool_z", "tool_phi")
"""The tool's position in mm and its attitude in degrees."""

TOOL_AXES: Final = ("tool_nx", "tool_ny", "tool_nz", "tool_ox", "tool_oy", "tool_oz")
"""Direction cosines of the tool's x axis n and y axis o; its z axis is n x o."""


def derived_columns(joints: Iterable[str]) -> tuple[str, ...]:
    """Return the headers of all of them, in the order in which `run` writes them."""
    return (*(ACCELERATION + name for name in joints), *TOOL_POSE, *TOOL_AXES)


def derived_in(header: Sequence[str]) -> frozenset[int]:
    """Return the indexes of a header's derived columns; a column with velocities of its own is a joint's position."""
    joints = [name for name in header if VELOCITY + name in header]
    names = set(derived_columns(joints)) - set(joints) if joints else set()
    return frozenset(i for i, name in enumerate(header) if name in names)
