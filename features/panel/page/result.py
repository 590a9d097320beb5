"""The Result tab: the last runs, the verdict on each, and pictures of planned and reported positions."""

import time
from functools import partial
from typing import Any, Final

import numpy as np
from nicegui import ui

from steptwin.features.panel.page.elements import Chip, Tone, cell, heading, line, note, plain, table
from steptwin.features.panel.page.visitor import Visitor
from steptwin.features.panel.service.results import Result
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.common.arrays import FloatArray
from steptwin.host.operate.running import LiveOutcome
from steptwin.host.robots.robot import Robot

_COLOURS: Final = ("#2f7de1", "#d9652b", "#2f9e63", "#a45fd6", "#b98a17", "#1797a8", "#d6478a", "#7b8794")
_MUTED: Final = {"color": "#7d8894"}
_LINE: Final = {"lineStyle": {"color": "#7d889440"}}
"""Colours that are readable on light and dark backgrounds."""
_POINTS: Final = 800
"""Points of a curve: enough for the resolution of a screen."""
_VERDICTS: Final[dict[bool | None, tuple[str, Tone]]] = {
    None: ("did not end", "warn"),
    True: ("ended where planned", "good"),
    False: ("ended elsewhere", "bad"),
}
_Curves = list[list[list[float]]]
"""Points (s, value) of each joint's or axis' curve."""


class ResultTab:
    """The runs, the newest first, and one of them in detail."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._newest = 0
        heading("Runs")
        self._runs = ui.element("div")
        self._detail = ui.element("div").classes("stack")
        with self._runs:
            note("No run has ended yet.")

    def refresh(self, _snapshot: Snapshot) -> None:
        results = self._visitor.service.results
        if not results or results[-1].number == self._newest:
            return
        self._newest = results[-1].number
        self._runs.clear()
        with self._runs, table("ended", "motion", "verdict", ""):
            for result in reversed(results):
                with ui.element("tr"):
                    cell(time.strftime("%H:%M:%S", time.localtime(result.wall_s)), "muted")
                    cell(result.name)
                    with cell():
                        Chip(*_VERDICTS[result.passed])
                    with cell():
                        plain("Show", partial(self._show, result), label=f"show run {result.number}")
        self._show(results[-1])

    def _show(self, result: Result) -> None:
        self._detail.clear()
        with self._detail:
            with line():
                heading(f"{result.name}, run {result.number}")
                Chip(*_VERDICTS[result.passed])
            if result.why:
                note(result.why, "bad")
            if result.outcome is not None:
                _ends_table(result.outcome)
                if result.placed:
                    _pictures(result, result.outcome)


def _ends_table(outcome: LiveOutcome) -> None:
    robot = outcome.plan.robot
    with ui.element("div").classes("scroll-x"), table("axis", "end|number", "unit", "error, steps|number"):
        for i, (axis, joint) in enumerate(zip(outcome.axes, robot.axes, strict=True)):
            with ui.element("tr"):
                cell(axis.name)
                cell(f"{outcome.end[robot.coupling.joint_of(i)]:.4f}", "number")
                cell(str(joint.unit), "muted")
                cell(f"{axis.error_steps:.4f}", "number")


def _pictures(result: Result, outcome: LiveOutcome) -> None:
    motion, robot = outcome.plan.motion, outcome.plan.robot
    t_s = np.linspace(0.0, motion.duration_s, _POINTS)
    planned = [_points(t_s, joint) for joint in motion.positions(t_s).T]
    names = list(robot.joint_names)
    _chart("positions: planned (line) and reported (dots), mm and deg", names, planned, _joint_points(result, robot))
    errors = [_points(axis.t_s, axis.error_steps) for axis in result.placed]
    _chart("reported minus planned, steps", list(robot.axis_names), errors)
    note("Over the motion's own time: while the machine is paused it stands. Each report's time is known to 20 ms.")


def _joint_points(result: Result, robot: Robot) -> _Curves:
    """Return the joints' reported positions; coupled joints need those of all axes at the same time."""
    points = []
    for i, own in enumerate(result.placed[: len(robot.joints)]):
        units = np.column_stack([np.interp(own.t_s, axis.t_s, axis.units) for axis in result.placed])
        units[:, i] = own.units
        points.append(_points(own.t_s, robot.to_positions(units)[:, i]))
    return points


def _points(t_s: FloatArray, values: FloatArray) -> list[list[float]]:
    return np.column_stack([t_s, values]).round(4).tolist()  # type: ignore[no-any-return]


def _chart(title: str, names: list[str], lines: _Curves, dots: _Curves | None = None) -> None:
    series: list[dict[str, Any]] = []
    for i, name in enumerate(names):
        series.append({"type": "line", "name": name, "showSymbol": False, "data": lines[i]})
        if dots is not None:
            series.append({"type": "scatter", "name": name, "symbolSize": 4, "data": dots[i]})
    ui.label(title).classes("muted small")
    bar = {"icon": "roundRect", "itemWidth": 14, "itemHeight": 4}
    t_axis = {"min": 0, "max": "dataMax", "axisLabel": _MUTED | {"formatter": "{value} s"}}
    options = {
        "animation": False,
        "color": list(_COLOURS),
        "grid": {"left": 56, "right": 16, "top": 30, "bottom": 26},
        "legend": {"top": 0, "data": names, "textStyle": _MUTED, **bar},
        "tooltip": {"trigger": "axis", "confine": True},
        "xAxis": {"type": "value", "splitLine": _LINE, **t_axis},
        "yAxis": {"type": "value", "splitLine": _LINE, "scale": True, "axisLabel": _MUTED},
        "series": series,
    }
    chart = ui.echart(options).classes("result-chart")
    chart.props.update({"role": "img", "aria-label": title})
