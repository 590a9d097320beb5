"""The motion kernel in C11, and the same kernel on an emulated Cortex-M3."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="kernel_c",
    commands=(
        CommandRow(
            "kernel-c",
            COMMAND_GROUPS[3],
            "Write the firmware's motion kernel as C11: header, source, an example and a README with units and limits.",
            "steptwin.features.kernel_c.command",
        ),
    ),
)
