"""The arm in three dimensions, with its camera's buttons and what its colours mean."""

from collections.abc import Callable
from functools import partial
from typing import Final

from nicegui import ui

from steptwin.host.panel.page.elements import card, icon_button, line, plain
from steptwin.host.panel.page.scene import ArmScene, View
from steptwin.host.robots.robot import Robot

_VIEWS: Final[dict[View, str]] = {"iso": "3D", "front": "Front", "side": "Side", "top": "Top"}
_LEGEND: Final = (("--plan", "planned path"), ("--trace", "where the tool was"), ("--ghost", "where it will go"))


def scene_card(robot: Robot) -> ArmScene:
    """Make the card; return the view in it."""
    with card(classes="flush place-scene"):
        with line("between scene-bar"):
            with line("tight"):
                camera_buttons(lambda: scene)
                plain("Clear trace", lambda: scene.clear_shape("trace"))
                drawing_switch(lambda: scene)
            with line():
                for colour, text in _LEGEND:
                    legend(colour, text)
        scene: ArmScene = ArmScene(robot)
    return scene


def camera_buttons(scene: Callable[[], ArmScene]) -> None:
    """Make a button for each direction of the camera; the scene may be made later."""

    def look(view: View) -> None:
        scene().look(view)

    for view, text in _VIEWS.items():
        button = plain(text, partial(look, view))
        button.props["aria-label"] = f"look from: {text}"


def drawing_switch(scene: Callable[[], ArmScene]) -> None:
    """Make the button that switches the drawing off and on; the scene may be made later."""
    drawn = True

    def switch() -> None:
        nonlocal drawn
        drawn = not drawn
        scene().enable_drawing(drawn)

    icon_button("visibility_off", "switch the 3D view off or on", switch)


def legend(colour: str, text: str) -> None:
    """Say what is drawn in a colour, a variable of the style sheet."""
    with ui.element("span").classes("legend"):
        ui.element("i").style(f"background: var({colour})")
        ui.label(text)
