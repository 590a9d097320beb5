"""The Result tab: the last runs, the verdict on each, and its pictures: planned and reported positions."""

import time
from typing import Any, Final

import numpy as np
from nicegui import ui

from steptwin.host.operate.running import LiveOutcome
from steptwin.host.panel.desk import Result, Snapshot
from steptwin.host.panel.page.elements import Chip, cell, heading, line, note, plain, table
from steptwin.host.panel.page.visitor import Visitor

_COLOURS: Final = ("#2f7de1", "#d9652b", "#2f9e63", "#a45fd6", "#b98a17", "#1797a8", "#d6478a", "#7b8794")
_MUTED: Final = "#7d8894"
_LINE: Final = "#7d889440"
"""Colours that can be read on light and on dark."""
_POINTS: Final = 800
"""Points of a curve: as fine as a screen."""


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
        results = self._visitor.desk.results
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
            with cell("muted"):
                ui.label(time.strftime("%H:%M:%S", time.localtime(result.wall_s)))
            with cell():
                ui.label(result.name)
            with cell():
                _verdict_chip(result)
            with cell():
                show = plain("Show", lambda: self._show(result))
                show.props["aria-label"] = f"show run {result.number}"

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
                if result.started_s is not None and result.samples.t_s.size > 1:
                    _pictures(result, result.outcome, result.started_s)


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
        for axis, joint, end in zip(outcome.axes, outcome.plan.robot.joints, outcome.end, strict=True):
            with ui.element("tr"):
                with cell():
                    ui.label(axis.name)
                with cell("number"):
                    ui.label(f"{end:.4f}")
                with cell("muted"):
                    ui.label(str(joint.unit))
                with cell("number"):
                    ui.label(f"{axis.error_steps:.4f}")


def _pictures(result: Result, outcome: LiveOutcome, started_s: float) -> None:
    """Show what was planned, with what was reported over it, and their difference."""
    trajectory = outcome.plan.trajectory
    t_s = result.samples.t_s - started_s
    inside = (t_s >= 0) & (t_s <= trajectory.duration_s)
    if not inside.any():
        return
    every = -(-int(inside.sum()) // _POINTS)
    t_s, reported = t_s[inside][::every], result.samples.positions[inside][::every]
    planned = trajectory.positions(t_s)
    names = list(outcome.plan.robot.joint_names)
    _chart("positions: planned (line) and reported (dots), mm and deg", t_s, names, planned, reported)
    _chart("reported minus planned, mm and deg", t_s, names, reported - planned, None)


def _chart(title: str, t_s: Any, names: list[str], lines: Any, dots: Any) -> None:
    def points(values: Any) -> list[list[float]]:
        return np.column_stack([t_s, values]).round(4).tolist()  # type: ignore[no-any-return]

    series: list[dict[str, Any]] = []
    for i, name in enumerate(names):
        series.append({"type": "line", "name": name, "showSymbol": False, "data": points(lines[:, i])})
        if dots is not None:
            dot = {"type": "scatter", "name": name, "symbolSize": 4, "data": points(dots[:, i])}
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
