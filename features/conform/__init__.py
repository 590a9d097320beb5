"""Conformance of a CANopen node: checks of CiA 301 and CiA 402 against any node on a bus.

Imports the core, and the reader of EDS files of `nodes`.
"""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="conform",
    needs=("nodes",),
    commands=(
        CommandRow(
            "conform",
            COMMAND_GROUPS[2],
            "Check a CANopen node against CiA 301 and CiA 402; exit code 1 if it fails.",
            "steptwin.features.conform.command",
            usual=False,
        ),
    ),
)
