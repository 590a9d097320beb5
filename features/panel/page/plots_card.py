"""The plots of the joints over time, with freeze and export."""

import asyncio
import csv
import time
from collections.abc import Sequence
from io import StringIO
from math import isnan
from pathlib import Path
from typing import Final

import nicegui
import numpy as np
from nicegui import ui

from steptwin.features.panel.page.elements import card, choice, icon_button, line, live, plain
from steptwin.features.panel.page.visitor import Visitor
from steptwin.features.panel.service.history import HistorySamples
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.robots.joint import Joint

WINDOW_S: Final = 20.0
"""Time span of a plot."""


class LivePlot(
    ui.element,
    component="static/live_plot.js",
    esm={"nicegui-echart": str(Path(nicegui.__file__).parent / "elements" / "echart" / "dist")},
):
    """A plot of every joint; joints in mm and in degrees have an axis each.

    Methods for `run_method`: `fill` with past rows, `show` with a quantity, `freeze` with True to stop.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        super().__init__()
        names = [{"name": joint.name, "unit": str(joint.unit)} for joint in joints]
        self.props.update(label="plot of the joints over time", joints=names, seconds=WINDOW_S)


class PlotsCard:
    """One plot, with a choice of its quantity."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._frozen = False
        quantities = {"position": "position", "rate": "rate", "error": "following error"}
        figures = {"load": "bus load, %", "fill": "motion queue, %", "late": "board late, ms"}
        with card(classes="place-plots"):
            with line("between"):
                choice("what is plotted", quantities, "position", lambda name: self._plot.run_method("show", name))
                with line("tight"):
                    self._freeze = plain("Freeze", self._toggle, "pause")
                    icon_button("download", "save the last minutes as CSV", self._export)
            self._plot = LivePlot(visitor.service.robot.joints)
            with line("small muted"):
                for key, text in figures.items():
                    with line("tight"):
                        ui.label(text)
                        live(key)

    def refresh(self, _snapshot: Snapshot) -> None:
        """Do nothing: the numbers come with each tick."""

    def fill(self) -> None:
        """Fill the plot with the last seconds, in a browser that has just opened the page."""
        samples = self._visitor.service.history.since(time.monotonic() - WINDOW_S)
        columns = (samples.positions, samples.rates, samples.following_errors)
        known = [
            [[None if isnan(value) else round(value, 4) for value in row] for row in column.tolist()]
            for column in columns
        ]
        self._plot.run_method("fill", list(zip(samples.t_s.round(3).tolist(), *known, strict=True)))

    def _toggle(self) -> None:
        self._frozen = not self._frozen
        self._freeze.set_text("Go on" if self._frozen else "Freeze")
        self._freeze.set_icon("play_arrow" if self._frozen else "pause")
        self._plot.run_method("freeze", self._frozen)

    async def _export(self) -> None:
        robot, history = self._visitor.service.robot, self._visitor.service.history
        joints = [(joint.name, str(joint.unit)) for joint in robot.joints]
        text = await asyncio.to_thread(lambda: csv_of(history.since(), joints))  # others' beats would have to wait
        ui.download.content(text.encode(), f"{robot.name}-history.csv", "text/csv")


def csv_of(samples: HistorySamples, joints: list[tuple[str, str]]) -> str:
    """Return samples as CSV, the first at t = 0; values that the board did not report are empty."""
    file = StringIO()
    writer = csv.writer(file, lineterminator="\n")
    columns = (("", "", samples.positions), ("rate ", "/s", samples.rates), ("error ", "", samples.following_errors))
    writer.writerow(["t_s", *(f"{what}{name} [{unit}{per}]" for what, per, _ in columns for name, unit in joints)])
    t_s = samples.t_s - samples.t_s[:1]
    for i, instant_s in enumerate(t_s.tolist()):
        values = np.concatenate([column[i] for _, _, column in columns]).tolist()
        writer.writerow([f"{instant_s:.4f}", *("" if isnan(value) else f"{value:.5f}" for value in values)])
    return file.getvalue()
