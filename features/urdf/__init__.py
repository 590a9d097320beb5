"""URDF files of ROS: robots of the kind chain are made of them and written as them."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="urdf",
    needs=("arms",),
    commands=(
        CommandRow(
            "urdf",
            COMMAND_GROUPS[0],
            "Print a robot of the kind chain as a URDF: frames, axes, limits and speeds of its joints, in m and rad.",
            "steptwin.features.urdf.command",
        ),
    ),
)
