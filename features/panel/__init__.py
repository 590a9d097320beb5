"""The panel: a live machine in a browser, watched by many pages and operated from one."""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

if TYPE_CHECKING:
    from steptwin.features.panel.options import PanelOptions


def _serve_options() -> "type[PanelOptions]":
    from steptwin.features.panel.options import PanelOptions

    return PanelOptions


FEATURE: Final = Feature(
    name="panel",
    serve_options=_serve_options,
    commands=(
        CommandRow(
            "panel",
            COMMAND_GROUPS[2],
            "Show a live machine in a browser, and operate it there, until Ctrl-C.",
            "steptwin.features.panel.command",
        ),
    ),
)
