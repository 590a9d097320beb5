"""Wear: how often each motor has turned in a run, of the turns that `[wear] life_turns` says it lasts."""

from importlib import import_module
from typing import Any

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

WEAR = "steptwin_wear.wear"  # imported when it is needed: `steptwin --help` stays quick


def _report_lines(document: Any) -> list[str]:
    return ["wear: turns " + ", ".join(f"{axis} {each['turns']:.3f}" for axis, each in document["axes"].items())]


FEATURE = Feature(
    name="wear",
    section=lambda: import_module(WEAR).WearSection,
    part=lambda robot, *_: import_module(WEAR).WearPart(robot) if "wear" in robot.sections else None,
    judge=lambda: import_module(WEAR),
    report_lines=_report_lines,
    commands=(CommandRow("wear", COMMAND_GROUPS[3], "Tell how worn a run leaves the axes.", WEAR),),
)
