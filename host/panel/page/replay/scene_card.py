"""The arm of a stored run in three dimensions, with its planned path and the counted one; of two runs both arms."""

from collections.abc import Callable
from typing import Final

import numpy as np
from nicegui import ui

from steptwin.host.panel.page.elements import card, choice, heading, line
from steptwin.host.panel.page.scene import Arm, ArmScene
from steptwin.host.panel.page.scene_card import camera_buttons, drawing_switch, legend
from steptwin.host.panel.replay import Replay, Span
from steptwin.host.panel.replay.markup import currents_picture, pins_picture
from steptwin.protocol.timer import COUNTS_PER_SECOND

SPANS_MS: Final = (0.2, 1.0, 5.0, 20.0, 100.0, 500.0)
_ALL: Final = "all"


class PinsCard:
    """The windows of one run; `changed` is called when the user chooses another one."""

    def __init__(self, replays: tuple[Replay, ...], changed: Callable[[], None]) -> None:
        self._replays, self._changed = replays, changed
        self._run, self._span_ms, self._axis = 0, 20.0, _ALL
        names = replays[0].run.robot.joint_names
        self._currents_axis = replays[0].busiest_axis
        with card("Pins"):
            with line("between"):
                choice("width of the window", {ms: f"{ms:g} ms" for ms in SPANS_MS}, self._span_ms, self._choose_span)
                if len(replays) == 2:
                    choice("run", {0: "first", 1: "second"}, 0, self._choose_run)
                axes = ui.select({_ALL: "all axes"} | dict.fromkeys(names), value=_ALL, label="pins of")
                axes.props("outlined dense").classes("w-narrow").on_value_change(
                    lambda event: self._choose_axis(event.value)
                )
            self._pins = ui.html("", sanitize=False)
        with card():
            with line("between"):
                heading("Phase currents")
                choice(
                    "axis of the currents",
                    dict(zip(names, names, strict=True)),
                    self._currents_axis,
                    self._choose_currents,
                )
            self._currents = ui.html("", sanitize=False)

    def show(self, t_s: float) -> None:
        """Show the windows around a time."""
        replay = self._replays[self._run]
        counts = replay.counts_at(t_s)
        half = int(self._span_ms * COUNTS_PER_SECOND / 2000)
        span = Span(counts - half, counts + half)
        axes = None if self._axis == _ALL else [self._axis]
        self._pins.set_content(pins_picture(replay.lanes(span, axes), span, counts))
        self._currents.set_content(currents_picture(replay.currents(span, self._currents_axis), span, counts))

    def _choose_span(self, span_ms: float) -> None:
        self._span_ms = span_ms
        self._changed()

    def _choose_run(self, run: int) -> None:
        self._run = run
        self._changed()

    def _choose_axis(self, axis: str) -> None:
        self._axis = axis
        self._changed()

    def _choose_currents(self, axis: str) -> None:
        self._currents_axis = axis
        self._changed()


_ARMS: Final[tuple[Arm, ...]] = ("arm", "other")
_POINTS: Final = 800
"""Points of a path: as fine as a screen."""


class ReplayScene:
    """The scene; the first run's arm is in the arm's colour, the second's in another."""

    def __init__(self, replays: tuple[Replay, ...]) -> None:
        self._replays = replays
        path = replays[0].path
        gain = path.gain
        with card(classes="flush"):
            with line("between scene-bar"):
                with line("tight"):
                    camera_buttons(lambda: self._scene)
                    drawing_switch(lambda: self._scene)
                with line():
                    if replays[0].run.no_plan is None:
                        legend("--plan", "planned path")
                    legend("--trace", f"counted path, error x {gain:g}" if gain > 1.0 else "counted path")
                    if len(replays) == 2:
                        legend("--other", "second run")
            self._scene = ArmScene(replays[0].run.robot, np.concatenate([each.extent_mm for each in replays]))
        self._boxes_move = any(box.held_by for box in replays[0].run.robot.boxes.values())
        chosen = np.linspace(0, len(path.planned_mm) - 1, _POINTS).astype(np.int64)
        if replays[0].run.no_plan is None:
            self._scene.show_line("plan", path.planned_mm[chosen])
        counted_mm = path.counted_mm(gain)[chosen]
        self._scene.show_line("trace", counted_mm[np.isfinite(counted_mm).all(axis=1)])

    def show(self, t_s: float) -> None:
        """Show every run's arm at a time."""
        for arm, replay in zip(_ARMS, self._replays, strict=False):
            links = replay.machine.links(np.array([t_s]))
            if all(np.isfinite(link.points_mm).all() for link in links):  # else its counts have pulled it apart
                self._scene.show_arm(arm, [link.points_mm[0] for link in links])
            else:
                self._scene.clear_shape(arm)
        if self._boxes_move:
            shifts_mm = self._replays[0].machine.box_shifts_mm(np.array([t_s]))
            self._scene.move_boxes(shift_mm[0] for shift_mm in shifts_mm.values())
