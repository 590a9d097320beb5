"""Personalities: the objects of other manufacturers' drives over StepTwin's own firmware.

A personality is a table of objects, and of what stands behind each: an object of the firmware with its unit, a
constant, a store or a refusal. The state machine, the modes and the services stay those of the firmware.
"""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.features.personalities.options import PersonalityOptions
    from steptwin.host.robots.robot import Robot
    from steptwin.protocol.object_view import ObjectView


def _machine_options() -> "type[PersonalityOptions]":
    from steptwin.features.personalities.options import PersonalityOptions

    return PersonalityOptions


def _read_options(options: "PersonalityOptions", _robot: "Robot", folder: "Path") -> "PersonalityOptions":
    return options.placed(folder)


def _object_view(robot: "Robot", options: "PersonalityOptions | None") -> "ObjectView | None":
    given = (options and options.personality) or robot.board.personality
    if given is None:
        return None
    from steptwin.features.personalities.personality import load_personality

    return load_personality(str(given))


FEATURE: Final = Feature(
    name="personalities",
    machine_options=_machine_options,
    read_options=_read_options,
    object_view=_object_view,
    commands=(
        CommandRow(
            "personality",
            COMMAND_GROUPS[3],
            "List the objects of another manufacturer's drive that a board can show, or print their EDS.",
            "steptwin.features.personalities.command",
            usual=False,
        ),
    ),
)
