"""The Result tab: the last runs, the verdict on each, and its pictures: planned and reported positions."""

import time
from typing import Any, Final

import numpy as np
from nicegui import ui

from steptwin.features.panel.page.elements import Chip, cell, heading, line, note, plain, table
from steptwin.features.panel.page.visitor import Visitor
from steptwin.features.panel.service.results import Result
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.common.arrays import FloatArray
from steptwin.host.operate.running import LiveOutcome
from steptwin.host.robots.robot import Robot

_COLOURS: Final = ("#2f7de1", "#d9652b", "#2f9e63", "#a45fd6", "#b98a17", "#1797a8", "#d6478a", "#7b8794")
_MUTED: Final = "#7d8894"
_LINE: Final = "#7d889440"
"""Colours that can be read on light and on dark."""
_POINTS: Final = 800
"""Points of a curve: as fine as a screen."""
_Curves = list[list[list[float]]]
"""The points of each joint's or axis' curve, (s, value)."""


class ResultTab:
    """The runs, the newest first, and one of them in detail."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._shown: int | None = None
        self._newest = 0
        heading("Runs")
        self._runs = ui.element("div")
        self._detail = ui.element("div").classes("stack")
        self._list(())

    def refresh(self, _snapshot: Snapshot) -> None:
        """Show a run when it has ended."""
        results = self._visitor.service.results
        newest = results[-1].number if results else 0
        if newest != self._newest:
            self._newest = newest
            self._list(results)
            self._show(results[-1])

    def _list(self, results: tuple[Result, ...]) -> None:
        self._runs.clear()
        with self._runs:
            if not results:
                note("No run has ended yet.")
                return
            with table([("ended", ""), ("motion", ""), ("verdict", ""), ("", "")]):
                for result in reversed(results):
                    self._row(result)

    def _row(self, result: Result) -> None:
        with ui.element("tr"):
            cell(time.strftime("%H:%M:%S", time.localtime(result.wall_s)), "muted")
            cell(result.name)
            with cell():
                _verdict_chip(result)
            with cell():
                plain("Show", lambda: self._show(result), label=f"show run {result.number}")

    def _show(self, result: Result) -> None:
        self._detail.clear()
        with self._detail:
            with line():
                heading(f"{result.name}, run {result.number}")
                _verdict_chip(result)
            if result.why:
                note(result.why, "bad")
            if result.outcome is not None:
                _ends_table(result.outcome)
                if result.placed:
                    _pictures(result, result.outcome)


def verdict_words(result: Result) -> str:
    """Return the verdict on a run in words."""
    if result.passed is None:
        return "did not end"
    return "ended where planned" if result.passed else "ended elsewhere"


def _verdict_chip(result: Result) -> None:
    Chip(verdict_words(result), "warn" if result.passed is None else "good" if result.passed else "bad")


def _ends_table(outcome: LiveOutcome) -> None:
    with (
        ui.element("div").classes("scroll-x"),
        table([("axis", ""), ("end", "number"), ("unit", ""), ("error, steps", "number")]),
    ):
        robot = outcome.plan.robot
        for i, (axis, joint) in enumerate(zip(outcome.axes, robot.axes, strict=True)):
            with ui.element("tr"):
                cell(axis.name)
                cell(f"{outcome.end[robot.coupling.joint_of(i)]:.4f}", "number")
                cell(str(joint.unit), "muted")
                cell(f"{axis.error_steps:.4f}", "number")


def _pictures(result: Result, outcome: LiveOutcome) -> None:
    """Show what was planned, with what was reported over it, and their difference."""
    trajectory, robot = outcome.plan.trajectory, outcome.plan.robot
    t_s = np.linspace(0.0, trajectory.duration_s, _POINTS)
    planned = [_points(t_s, joint) for joint in trajectory.positions(t_s).T]
    names = list(robot.joint_names)
    _chart("positions: planned (line) and reported (dots), mm and deg", names, planned, _joint_points(result, robot))
    errors = [_points(axis.t_s, axis.error_steps) for axis in result.placed]
    _chart("reported minus planned, steps", list(robot.axis_names), errors, None)
    note("Over the motion's own time: while the machine is paused it stands. Each report's time is known to 20 ms.")


def _joint_points(result: Result, robot: Robot) -> list[list[list[float]]]:
    """Return the joints' positions as they were reported; coupled joints need those of all axes at the same time."""
    points = []
    for i, own in enumerate(result.placed[: len(robot.joints)]):
        units = np.column_stack([np.interp(own.t_s, axis.t_s, axis.units) for axis in result.placed])
        units[:, i] = own.units
        points.append(_points(own.t_s, robot.to_positions(units)[:, i]))
    return points


def _points(t_s: FloatArray, values: FloatArray) -> list[list[float]]:
    return np.column_stack([t_s, values]).round(4).tolist()  # type: ignore[no-any-return]


def _chart(title: str, names: list[str], lines: _Curves, dots: _Curves | None) -> None:
    series: list[dict[str, Any]] = []
    for i, name in enumerate(names):
        series.append({"type": "line", "name": name, "showSymbol": False, "data": lines[i]})
        if dots is not None:
            dot = {"type": "scatter", "name": name, "symbolSize": 4, "data": dots[i]}
            series.append(dot)
    ui.label(title).classes("muted small")
    muted = {"color": _MUTED}
    options = {
        "animation": False,
        "color": list(_COLOURS),
        "grid": {"left": 56, "right": 16, "top": 30, "bottom": 26},
        "legend": {
            "top": 0,
            "data": names,
            "textStyle": muted,
            "icon": "roundRect",
            "itemWidth": 14,
            "itemHeight": 4,
        },
        "tooltip": {"trigger": "axis", "confine": True},
        "xAxis": {
            "type": "value",
            "min": 0,
            "max": "dataMax",
            "splitLine": {"lineStyle": {"color": _LINE}},
            "axisLabel": muted | {"formatter": "{value} s"},
        },
        "yAxis": {"type": "value", "scale": True, "axisLabel": muted, "splitLine": {"lineStyle": {"color": _LINE}}},
        "series": series,
    }
    chart = ui.echart(options).classes("result-chart")
    chart.props.update({"role": "img", "aria-label": title})
