"""The plots of position, rate and following error over the last seconds; the browser keeps their points."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal

import nicegui
from nicegui import ui

from steptwin.host.robots.joint import Joint

WINDOW_S: Final = 20.0
"""Time that a plot shows."""

Quantity = Literal["position", "rate", "error"]


class LivePlot(
    ui.element,
    component="static/live_plot.js",
    esm={"nicegui-echart": str(Path(nicegui.__file__).parent / "elements" / "echart" / "dist")},
):
    """A plot of every joint; joints in mm and in degrees have an axis each."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        super().__init__()
        names = [{"name": joint.name, "unit": str(joint.unit)} for joint in joints]
        self.props.update(label="plot of the joints over time", joints=names, seconds=WINDOW_S)

    def fill(self, rows: list[list[Any]]) -> None:
        """Add rows of the past, each (t_s, positions, rates, following errors)."""
        self.run_method("fill", rows)

    def show(self, quantity: Quantity) -> None:
        """Choose what is plotted."""
        self.run_method("show", quantity)

    def freeze(self, on: bool) -> None:
        """Let the picture stand, or run again."""
        self.run_method("freeze", on)
