"""URDF files of ROS: create robots of the kind chain from them, and export such robots."""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from steptwin.features.urdf.command import UrdfOptions


def _new_options() -> "type[UrdfOptions]":
    from steptwin.features.urdf.command import UrdfOptions

    return UrdfOptions


FEATURE: Final = Feature(
    name="urdf",
    needs=("arms",),
    new_options=_new_options,
    commands=(
        CommandRow(
            "urdf",
            COMMAND_GROUPS[0],
            "Print a robot of the kind chain as a URDF: frames, axes, limits and speeds of its joints, in m and rad.",
            "steptwin.features.urdf.command",
            usual=False,
        ),
    ),
)
