"""Replay a recorded bus: send the hosts' frames to emulated boards and compare the boards' reactions."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="replay",
    needs=("faults",),
    commands=(
        CommandRow(
            "replay",
            COMMAND_GROUPS[3],
            "Play the hosts' frames of a recorded bus into the board again, in virtual time, and compare what it does.",
            "steptwin.features.replay.command",
            usual=False,
        ),
    ),
)
