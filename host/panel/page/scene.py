"""The 3D view of an arm: its polylines, a ghost, the planned path, the tool's trace and the furniture around it.

The browser draws with three.js, which NiceGUI brings for its own scene, and only when something has changed.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, Literal

import nicegui
import numpy as np
from nicegui import ui

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.box import Box
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

Arm = Literal["arm", "ghost", "other"]
"""The arms that the view can show at once: the machine, a ghost of where it is to go, and another run's."""
Line = Literal["plan", "trace"]
"""The lines that the view can show: the planned path and the tool's trace."""
View = Literal["top", "front", "side", "iso"]

_DECIMALS: Final = 2
"""Hundredths of a mm are far below a pixel."""
_SAMPLES: Final = 400
"""Random joint positions by which the space that the arm takes is found."""
_CLOSE: Final = 0.8
"""Size of what is seen, over the diagonal of the space that the arm takes."""


def flat_lines(polylines: Iterable[FloatArray]) -> list[list[float]]:
    """Return polylines of shape (n, 3), in mm, as the browser takes them: one flat list of coordinates each."""
    return [polyline.round(_DECIMALS).reshape(-1).tolist() for polyline in polylines]


def links_at(robot: Robot, joints: Sequence[float]) -> list[FloatArray]:
    """Return the parts of an arm at a joint position, each of shape (n, 3) in mm."""
    return [link.points_mm[0] for link in make_kinematics(robot).links(np.array([joints]))]


class ArmScene(
    ui.element,
    component="static/arm_scene.js",
    esm={"nicegui-scene": str(Path(nicegui.__file__).parent / "elements" / "scene" / "dist")},
):
    """A view of a robot's arm and of the boxes around it, in mm, with z up."""

    def __init__(self, robot: Robot, holding_mm: FloatArray | None = None) -> None:
        """Make the view of all that the robot reaches, or of what holds points of shape (n, 3)."""
        super().__init__()
        center_mm, span_mm = _middle_and_size(_reached_mm(robot) if holding_mm is None else holding_mm)
        self.props.update(
            label=f"the arm of {robot.name} in three dimensions",
            roles=[str(link.role) for link in make_kinematics(robot).links(np.array([robot.home]))],
            center=center_mm.tolist(),
            span=span_mm,
            boxes=[_box(box) for box in robot.boxes.values()],
        )

    def show_arm(self, arm: Arm, parts: Iterable[FloatArray]) -> None:
        """Show an arm by its parts, each of shape (n, 3) in mm, in the order of `Kinematics.links`."""
        self.run_method("show", arm, flat_lines(parts))

    def show_line(self, line: Line, points_mm: FloatArray) -> None:
        """Show a line through points of shape (n, 3)."""
        self.run_method("show", line, flat_lines([points_mm]))

    def clear_shape(self, shape: Arm | Line) -> None:
        """Take an arm or a line away."""
        self.run_method("clear", shape)

    def move_boxes(self, shifts_mm: Iterable[FloatArray]) -> None:
        """Show every box, in the order of the robot's file, moved by a vector of shape (3,) in mm."""
        self.run_method("moveBoxes", [shift_mm.round(_DECIMALS).tolist() for shift_mm in shifts_mm])

    def look(self, view: View) -> None:
        """Turn the camera."""
        self.run_method("look", view)

    def enable_drawing(self, on: bool) -> None:
        """Switch the drawing off or on: without a graphics card it costs the browser a processor."""
        self.run_method("enable", on)


def _reached_mm(robot: Robot) -> FloatArray:
    """Return points of the space in which the arm moves and its boxes stand, shape (n, 3)."""
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    places = np.vstack([robot.home, np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, len(lower)))])
    links = make_kinematics(robot).links(places)
    return np.vstack(
        [link.points_mm.reshape(-1, 3) for link in links]
        + [box.edges_mm.reshape(-1, 3) for box in robot.boxes.values()]
    )


def _middle_and_size(points_mm: FloatArray) -> tuple[FloatArray, float]:
    points_mm = points_mm[np.isfinite(points_mm).all(axis=1)]
    lowest, highest = points_mm.min(axis=0), points_mm.max(axis=0)
    return (lowest + highest) / 2, float(np.linalg.norm(highest - lowest)) * _CLOSE


def _box(box: Box) -> list[float]:
    """Return a box as the browser takes it: its middle, then its sizes."""
    ends = np.array([box.x_mm, box.y_mm, box.z_mm])
    return [*ends.mean(axis=1).tolist(), *np.ptp(ends, axis=1).tolist()]
