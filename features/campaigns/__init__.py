"""Campaigns: thousands of runs with random motions, faults and settings, and a report of their failures."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature, FileKind
from steptwin.host.common.file_limits import MIB

if TYPE_CHECKING:
    from steptwin.host.cli.arguments import CheckedFile
    from steptwin.host.common.findings import Findings

CAMPAIGN_BYTES_MAX: Final = 4 * MIB
"""A scenario of a campaign has some 200 bytes, so twenty thousand of them fit."""
_LISTS: Final = re.compile(r"^\s*\[\[(scenario|motion)\b", re.MULTILINE)
"""What only campaigns have, which may be longer than other files."""


def _check(path: str, text: str, robot: str | None, findings: "Findings") -> "CheckedFile":
    from steptwin.features.campaigns.check import check_campaign

    return check_campaign(path, text, robot, findings)


def _file_kinds() -> Sequence[FileKind]:
    return (FileKind("campaign", ("runs", "motion", "scenario"), _check, CAMPAIGN_BYTES_MAX, _LISTS),)


def _schemas() -> Mapping[str, Callable[[], type[Any]]]:
    from steptwin.features.campaigns.campaign import Campaign

    return {"campaign": lambda: Campaign}


FEATURE: Final = Feature(
    name="campaigns",
    needs=("faults", "motors"),
    file_kinds=_file_kinds,
    schemas=_schemas,
    commands=(
        CommandRow(
            "campaign",
            COMMAND_GROUPS[1],
            "Make many runs with random motions, faults and settings, and tell which failed in silence, and why.",
            "steptwin.features.campaigns.command",
        ),
    ),
)
