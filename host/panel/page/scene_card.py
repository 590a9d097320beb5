"""The arm in three dimensions, with its camera's buttons and what its colours mean."""

from collections.abc import Callable
from typing import Final

from nicegui import ui

from steptwin.host.panel.page.elements import card, icon_button, line, plain
from steptwin.host.panel.page.scene import ArmScene, View
from steptwin.host.robots.robot import Robot

_VIEWS: Final[dict[View, str]] = {"iso": "3D", "front": "Front", "side": "Side", "top": "Top"}
_LEGEND: Final = (("--plan", "planned path"), ("--trace", "where the tool was"), ("--ghost", "where it will go"))


def scene_card(robot: Robot) -> ArmScene:
    """Make the card; return the view in it."""
    drawn = True

    def look(view: View) -> Callable[[], None]:
        return lambda: scene.look(view)

    def switch() -> None:
        nonlocal drawn
        drawn = not drawn
        scene.enable_drawing(drawn)

    with card(classes="flush place-scene"):
        with line("between scene-bar"):
            with line("tight"):
                for view, text in _VIEWS.items():
                    button = plain(text, look(view))
                    button.props["aria-label"] = f"look from: {text}"
                plain("Clear trace", lambda: scene.clear_shape("trace"))
                icon_button("visibility_off", "switch the 3D view off or on", switch)
            with line():
                for colour, text in _LEGEND:
                    with ui.element("span").classes("legend"):
                        ui.element("i").style(f"background: var({colour})")
                        ui.label(text)
        scene: ArmScene = ArmScene(robot)
    return scene
