"""ROS 2: files for ros2_canopen, and a served board behind a rosbridge server."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="ros2",
    needs=("urdf",),
    commands=(
        CommandRow(
            "ros2",
            COMMAND_GROUPS[0],
            "Write what ros2_canopen needs: bus.yml with scales and settings, the EDS, ros2_control's tag, the URDF.",
            "steptwin.features.ros2.command",
            usual=False,
        ),
        CommandRow(
            "ros2-bridge",
            COMMAND_GROUPS[2],
            "Offer a live machine to ROS 2 through a rosbridge server, until Ctrl-C.",
            "steptwin.features.ros2.bridge_command",
            usual=False,
        ),
    ),
)
