"""Campaigns: thousands of runs with random motions, faults and settings, and what they found."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="campaigns",
    commands=(
        CommandRow(
            "campaign",
            COMMAND_GROUPS[1],
            "Make many runs with random motions, faults and settings, and tell which failed in silence, and why.",
            "steptwin.features.campaigns.command",
        ),
    ),
)
