"""Calibration: find the real DH parameters of a machine from measured positions of its tool."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="calibration",
    commands=(
        CommandRow(
            "calibrate",
            COMMAND_GROUPS[0],
            "Find the real DH parameters of a machine from where its tool was measured, and what that cannot tell.",
            "steptwin.features.calibration.command",
            usual=False,
        ),
    ),
)
