"""The 3D view of an arm: its polylines, a ghost, the planned path, the tool's trace and the furniture around it.

The browser draws with three.js, which NiceGUI brings for its own scene, and only when something has changed.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Final, Literal, TypedDict

import nicegui
import numpy as np
from nicegui import ui

from steptwin.features.panel.page.elements import card, icon_button, line, plain
from steptwin.features.panel.service.history import Drawing
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.links import Role
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.host.robots.robot import Robot

_NEAR: Final = 0.06
"""Distance of two labels that are joined, as a fraction of the arm's size."""


class JointLabel(TypedDict):
    """A label and its point: index of the part in `Skeleton.whole`, and index of the point in it."""

    text: str
    part: int
    point: int


def joint_labels(robot: Robot) -> list[JointLabel]:
    """Return the joints' labels at the ends of their axes; labels that are close at home are joined."""
    skeleton, home = Skeleton(robot), np.array([robot.home])
    parts = skeleton.whole(home)
    first = next(i for i, part in enumerate(parts) if part.role is Role.AXIS)
    near_mm = _NEAR * skeleton.size_mm
    labels: list[JointLabel] = []
    for part, name in enumerate(robot.joint_names, start=first):
        place_mm = parts[part].points_mm[0, 1]
        for label in labels:
            if np.linalg.norm(parts[label["part"]].points_mm[0, label["point"]] - place_mm) < near_mm:
                label["text"] += f", {name}"
                break
        else:
            labels.append({"text": name, "part": part, "point": 1})
    return labels


Arm = Literal["arm", "ghost", "other"]
"""Arms that the view can show at once: the machine, a ghost at the target, and another run's arm."""
Line = Literal["plan", "trace"]
"""Lines that the view can show: planned path and trace of the tool."""
Mark = Literal["axes", "frames"]
"""Lines that a user shows or hides."""
View = Literal["top", "front", "side", "iso", "path"]
"""Viewpoint of the camera; `path` looks at the lines alone, from the present direction."""

_DECIMALS: Final = 2
"""Decimals of coordinates; hundredths of a mm are far below a pixel."""
_SAMPLES: Final = 400
"""Random joint positions that determine the space of the arm."""
_CLOSE: Final = 0.8
"""Size of the visible space, relative to the diagonal of the arm's space."""


def flat_lines(polylines: Iterable[FloatArray]) -> list[list[float]]:
    """Return polylines of shape (n, 3), in mm, for the browser: one flat list of coordinates each."""
    return [polyline.round(_DECIMALS).reshape(-1).tolist() for polyline in polylines]


def links_at(robot: Robot, joints: Sequence[float]) -> list[FloatArray]:
    """Return the parts, axes and frames of an arm at a joint position, each of shape (n, 3) in mm."""
    return [link.points_mm[0] for link in Skeleton(robot).whole(np.array([joints]))]


class ArmScene(
    ui.element,
    component="static/arm_scene.js",
    esm={"nicegui-scene": str(Path(nicegui.__file__).parent / "elements" / "scene" / "dist")},
):
    """View of a robot's arm and of the boxes around it, in mm, with z up.

    The camera shows all visible arms and the planned path until a user turns it.
    """

    def __init__(self, robot: Robot, holding_mm: FloatArray | None = None) -> None:
        """Create the view for arms and lines, and for points of shape (n, 3) if given."""
        super().__init__()
        skeleton = Skeleton(robot)
        held_mm = np.empty((0, 3)) if holding_mm is None else holding_mm[np.isfinite(holding_mm).all(axis=1)]
        taken_mm = _reached_mm(robot) if holding_mm is None else held_mm
        boxes_mm = [np.array([box.x_mm, box.y_mm, box.z_mm]) for box in robot.boxes.values()]
        self.props.update(
            label=f"the arm of {robot.name} in three dimensions",
            roles=[str(link.role) for link in skeleton.whole(np.array([robot.home]))],
            size=skeleton.size_mm,
            names=list(joint_labels(robot)),
            span=float(np.linalg.norm(np.ptp(taken_mm, axis=0))) * _CLOSE,  # line widths and the grid depend on it
            hold=[held_mm.min(axis=0).tolist(), held_mm.max(axis=0).tolist()] if len(held_mm) else [],
            boxes=[[*ends.mean(axis=1).tolist(), *np.ptp(ends, axis=1).tolist()] for ends in boxes_mm],
        )

    def show_arm(self, arm: Arm, parts: Iterable[FloatArray]) -> None:
        """Show an arm by its parts, each of shape (n, 3) in mm, in the order of `Skeleton.whole`."""
        self.run_method("show", arm, flat_lines(parts))

    def show_line(self, line: Line, points_mm: FloatArray) -> None:
        self.run_method("show", line, flat_lines([points_mm]))

    def clear_shape(self, shape: Arm | Line) -> None:
        self.run_method("clear", shape)

    def move_boxes(self, shifts_mm: Iterable[FloatArray]) -> None:
        """Move every box, in the order of the robot's file, by a vector of shape (3,) in mm."""
        self.run_method("moveBoxes", [shift_mm.round(_DECIMALS).tolist() for shift_mm in shifts_mm])

    def look(self, view: View) -> None:
        self.run_method("look", view)

    def show_marks(self, marks: Mark, on: bool) -> None:
        """Show or hide the joints' axes or the frames."""
        self.run_method("showMarks", marks, on)

    def enable_drawing(self, on: bool) -> None:
        """Switch drawing on or off; without a graphics card it takes a processor."""
        self.run_method("enable", on)


def _reached_mm(robot: Robot) -> FloatArray:
    """Return points of the space of the arm and its boxes, shape (n, 3)."""
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    places = np.vstack([robot.home, np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, len(lower)))])
    lines_mm = [link.points_mm for link in make_kinematics(robot).links(places)]
    lines_mm += [box.edges_mm for box in robot.boxes.values()]
    points_mm = np.vstack([line_mm.reshape(-1, 3) for line_mm in lines_mm])
    return points_mm[np.isfinite(points_mm).all(axis=1)]


_VIEWS: Final[dict[View, str]] = {"iso": "3D", "front": "Front", "side": "Side", "top": "Top"}
_MARKS: Final[tuple[tuple[Mark, str, str], ...]] = (
    ("axes", "Axes", "show the joints' axes and names"),
    ("frames", "Frames", "show the frames of base, joints and tool: x red, y green, z blue"),
)
_LEGEND: Final = (("--plan", "planned path"), ("--trace", "where the tool was"), ("--ghost", "where it will go"))


class SceneCard:
    """Card with the view, the service's path and the trace; the same in every browser and after a reload.

    Attributes:
        scene: the view in it.
    """

    def __init__(self, robot: Robot, drawing: Drawing) -> None:
        self._drawing = drawing
        self._drawn: tuple[int, int] | None = None
        has_tool = make_kinematics(robot).task.width > 0
        with card(classes="flush place-scene"):
            with line("tight scene-bar"):
                view_buttons(lambda: self.scene)
                if has_tool:
                    plain("Path", lambda: self.scene.look("path"), label="look at the path")
                    plain("Clear trace", drawing.clear_trace)
                drawing_switch(lambda: self.scene)
            with ui.element("div").classes("scene-place"):
                self.scene: ArmScene = ArmScene(robot)
                with line("scene-legend"):
                    for colour, text in _LEGEND if has_tool else _LEGEND[-1:]:
                        legend(colour, text)

    def refresh(self, _snapshot: Snapshot) -> None:  # new points of the trace come with each tick
        version, before = self._drawing.version, self._drawn
        self._drawn = version
        if before is None or before[0] != version[0]:
            self.scene.show_line("plan", self._drawing.path_mm)
        if before is None or before[1] != version[1]:
            self.scene.show_line("trace", self._drawing.trace_mm)

    def arrive(self) -> None:
        self._drawn = None


def view_buttons(scene: Callable[[], ArmScene]) -> None:
    """Add the buttons of a scene, which may be created later: viewpoints, axes and frames."""

    def look(view: View) -> None:
        scene().look(view)

    def switch(mark: Mark, button: ui.button) -> None:
        on = button.props["aria-pressed"] != "true"
        button.props["aria-pressed"] = "true" if on else "false"
        button.update()
        scene().show_marks(mark, on)

    for view, text in _VIEWS.items():
        plain(text, partial(look, view), label=f"look from: {text}")
    for mark, text, label in _MARKS:
        button = plain(text, None, label=label)
        button.props["aria-pressed"] = "true" if mark == "axes" else "false"  # visible at first
        button.on_click(partial(switch, mark, button))


def drawing_switch(scene: Callable[[], ArmScene]) -> None:
    """Add the button that switches drawing; the scene may be created later."""
    drawn = True

    def switch() -> None:
        nonlocal drawn
        drawn = not drawn
        scene().enable_drawing(drawn)

    icon_button("visibility_off", "switch the 3D view off or on", switch)


def legend(colour: str, text: str) -> None:
    """Add a legend for a colour, given as a variable of the style sheet."""
    with ui.element("span").classes("legend"):
        ui.element("i").style(f"background: var({colour})")
        ui.label(text)
