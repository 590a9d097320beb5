"""The arm in three dimensions, with its camera's buttons and what its colours mean."""

from collections.abc import Callable
from functools import partial
from typing import Final

from nicegui import ui

from steptwin.host.panel.desk import Drawing, Snapshot
from steptwin.host.panel.page.elements import card, icon_button, line, plain
from steptwin.host.panel.page.scene import ArmScene, View
from steptwin.host.robots.robot import Robot

_VIEWS: Final[dict[View, str]] = {"iso": "3D", "front": "Front", "side": "Side", "top": "Top"}
_LEGEND: Final = (("--plan", "planned path"), ("--trace", "where the tool was"), ("--ghost", "where it will go"))


class SceneCard:
    """The card; it draws the desk's path and trace, the same in every browser and after a reload.

    Attributes:
        scene: the view in it.
    """

    def __init__(self, robot: Robot, drawing: Drawing) -> None:
        self._drawing = drawing
        self._drawn: tuple[int, int] | None = None
        with card(classes="flush place-scene"):
            with line("tight scene-bar"):
                camera_buttons(lambda: self.scene)
                plain("Path", self._look_at_path).props["aria-label"] = "look at the path"
                plain("Clear trace", drawing.clear_trace)
                drawing_switch(lambda: self.scene)
            with ui.element("div").classes("scene-place"):
                self.scene: ArmScene = ArmScene(robot)
                with line("scene-legend"):
                    for colour, text in _LEGEND:
                        legend(colour, text)

    def refresh(self, _snapshot: Snapshot) -> None:
        """Draw what has changed; the points by which the trace grows come with each tick."""
        version, before = self._drawing.version, self._drawn
        self._drawn = version
        if before is None or before[0] != version[0]:
            self.scene.show_line("plan", self._drawing.path_mm)
        if before is None or before[1] != version[1]:
            self.scene.show_line("trace", self._drawing.trace_mm)

    def arrive(self) -> None:
        """Draw everything in a browser that has just opened the page."""
        self._drawn = None

    def _look_at_path(self) -> None:
        self.scene.look("path")


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
