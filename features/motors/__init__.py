"""Motors in the loop: rotors that may slip, sizing, and limits of fastest motions by what motors manage."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="motors",
    commands=(
        CommandRow(
            "motors",
            COMMAND_GROUPS[3],
            "Turn the rotors of a stored run by its phase currents, with the arm's masses; exit code 1 if one slips.",
            "steptwin.features.motors.command",
        ),
    ),
)
