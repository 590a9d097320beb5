"""Shadow a running machine: a twin follows the hosts' frames and reports where the real board differs."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="shadow",
    needs=("replay",),
    commands=(
        CommandRow(
            "shadow",
            COMMAND_GROUPS[2],
            "Let a twin hear what the hosts tell a running machine, and say where the real board does otherwise.",
            "steptwin.features.shadow.command",
            usual=False,
        ),
    ),
)
