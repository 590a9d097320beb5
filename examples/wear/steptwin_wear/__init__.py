"""Wear: how often each motor has turned in a run, of the turns that `[wear] life_turns` says it lasts."""

from importlib import import_module

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

WEAR = "steptwin_wear.wear"  # imported when it is needed: `steptwin --help` stays quick

FEATURE = Feature(
    name="wear",
    section=lambda: import_module(WEAR).WearSection,
    part=lambda robot, *_: import_module(WEAR).WearPart(robot) if "wear" in robot.sections else None,
    judge=lambda: import_module(WEAR),
    figures=lambda: import_module(WEAR).FIGURES,
    commands=(CommandRow("wear", COMMAND_GROUPS[3], "Tell how worn a run leaves the axes.", WEAR),),
)
