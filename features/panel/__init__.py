"""The panel: a live machine in a browser, watched by many pages and operated from one."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="panel",
    commands=(
        CommandRow(
            "panel",
            COMMAND_GROUPS[2],
            "Show a live machine in a browser, and operate it there, until Ctrl-C.",
            "steptwin.features.panel.command",
        ),
    ),
)
