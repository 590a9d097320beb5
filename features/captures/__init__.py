"""Captures of a logic analyser: read the files, wire channels to axes, and judge the controller that made them."""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from steptwin.features.captures.command import CaptureOptions


def _verify_options() -> "type[CaptureOptions]":
    from steptwin.features.captures.command import CaptureOptions

    return CaptureOptions


FEATURE: Final = Feature(
    name="captures",
    verify_options=_verify_options,
    commands=(
        CommandRow(
            "capture",
            COMMAND_GROUPS[1],
            "Tell what a logic analyser has recorded: channels, shortest pulses, and which look like STEP and DIR.",
            "steptwin.features.captures.command",
        ),
    ),
)
