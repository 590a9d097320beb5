"""Replay stored runs in a browser: arm, joints, pins, currents and marks at any instant."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="view",
    needs=("panel",),
    commands=(
        CommandRow(
            "view",
            COMMAND_GROUPS[3],
            "Replay a stored run in a browser, until Ctrl-C: arm, joints, pins, currents and marks at any instant.",
            "steptwin.features.view.command",
        ),
    ),
)
