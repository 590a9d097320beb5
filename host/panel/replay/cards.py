"""Cards of stored runs: the bar that moves the cursor, the arms in three dimensions, pins and currents."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from nicegui import events, ui

from steptwin.host.panel.page.elements import card, choice, heading, icon_button, line
from steptwin.host.panel.page.scene import Arm, ArmScene, camera_buttons, drawing_switch, legend, mark_switches
from steptwin.host.panel.replay.markup import currents_picture, pins_picture
from steptwin.host.panel.replay.model import Edge, Instant, Replay, Span
from steptwin.host.panel.replay.player import Player
from steptwin.host.record.animation import SPEEDS
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.protocol.timer import COUNTS_PER_SECOND

_ANY: Final = "any axis"


class Transport:
    """The bar; `changed` is called when it has moved the cursor.

    Attributes:
        run: the run whose edges and marks the steps go to, 0 or 1.
    """

    def __init__(self, player: Player, replays: tuple[Replay, ...], strip: str, changed: Callable[[], None]) -> None:
        self._player, self._changed = player, changed
        self.run = 0
        self._axis: str | None = None
        names = replays[0].run.robot.axis_names
        with card(classes="transport"):
            ui.html(strip, sanitize=False).classes("strip")
            self._slider = ui.slider(min=player.first_s, max=player.last_s, step=1e-6, value=player.t_s)
            self._slider.props("dense").props["aria-label"] = "time of the motion"
            self._slider.on("update:model-value", self._slid, throttle=0.05)
            with line("between"):
                with line("tight"):
                    icon_button("skip_previous", "mark before", lambda: self._mark(-1))
                    icon_button("chevron_left", "edge before", lambda: self._step(-1))
                    self._play = icon_button("play_arrow", "play", self._toggle)
                    icon_button("chevron_right", "edge after", lambda: self._step(1))
                    icon_button("skip_next", "mark after", lambda: self._mark(1))
                    speeds = ui.select({speed: f"{speed:g} x" for speed in SPEEDS}, value=1.0, label="speed")
                    speeds.props("outlined dense").classes("w-speed")
                    speeds.on_value_change(lambda event: setattr(player, "speed", event.value))
                    axes = ui.select([_ANY, *names], value=_ANY, label="edges of")
                    axes.props("outlined dense").classes("w-narrow").on_value_change(self._choose_axis)
                    if len(replays) == 2:
                        choice("run of the steps", {0: "first", 1: "second"}, 0, lambda run: setattr(self, "run", run))
                self._time = ui.label().classes("clock number")
            ui.keyboard(self._pressed)
            self._edges = ui.label().classes("muted small number left")

    def show(self, shown: Instant) -> None:
        """Show the cursor's time, and the edges before and after it."""
        self._slider.set_value(self._player.t_s)
        self._time.set_text(f"t = {self._player.t_s:.6f} s")
        self._edges.set_text(f"before: {_words(shown.before, shown)} · after: {_words(shown.after, shown)}")
        self._play.set_icon("pause" if self._player.playing else "play_arrow")

    def _slid(self, event: Any) -> None:
        self._player.seek(float(event.args))
        self._changed()

    def _toggle(self) -> None:
        if self._player.playing:
            self._player.pause()
        else:
            self._player.play()
        self._changed()

    def _pressed(self, event: events.KeyEventArguments) -> None:
        """Take the keys of a player: space, and the arrows for edges, with the shift key for marks."""
        if not event.action.keydown:
            return
        ways = {"ArrowLeft": -1, "ArrowRight": 1}
        name = event.key.name
        if name == " " and not event.action.repeat:
            self._toggle()
        elif name in ways:
            (self._mark if event.modifiers.shift else self._step)(ways[name])

    def _step(self, way: int) -> None:
        self._player.step(way, self.run, self._axis)
        self._changed()

    def _mark(self, way: int) -> None:
        self._player.step_to_mark(way, self.run)
        self._changed()

    def _choose_axis(self, event: Any) -> None:
        self._axis = None if event.value == _ANY else event.value


def _words(edge: Edge | None, shown: Instant) -> str:
    """Return an edge and how far away it is."""
    if edge is None:
        return "no edge"
    away_us = abs(edge.counts - shown.counts) / 72
    away = f"{away_us:.3f} us" if away_us < 1e3 else f"{away_us / 1e3:.3f} ms"
    return f"{edge.axis} {edge.pin.upper()} {'rises' if edge.level else 'falls'} {away} away"


SPANS_MS: Final = (0.2, 1.0, 5.0, 20.0, 100.0, 500.0)
_ALL: Final = "all"


class PinsCard:
    """The windows of one run; `changed` is called when the user chooses another one."""

    def __init__(self, replays: tuple[Replay, ...], changed: Callable[[], None]) -> None:
        self._replays = replays
        names = replays[0].run.robot.axis_names
        with card("Pins"):
            with line("between"):
                spans = {ms: f"{ms:g} ms" for ms in SPANS_MS}
                self._span_ms = choice("width of the window", spans, 20.0, lambda _: changed())
                self._run: ui.toggle | None = None
                if len(replays) == 2:
                    self._run = choice("run", {0: "first", 1: "second"}, 0, lambda _: changed())
                self._axis = ui.select({_ALL: "all axes"} | dict.fromkeys(names), value=_ALL, label="pins of")
                self._axis.props("outlined dense").classes("w-narrow").on_value_change(lambda _: changed())
            self._pins = ui.html("", sanitize=False)
        with card():
            with line("between"):
                heading("Phase currents")
                axes, busiest = {name: name for name in names}, replays[0].busiest_axis
                self._currents_of = choice("axis of the currents", axes, busiest, lambda _: changed())
            self._currents = ui.html("", sanitize=False)

    def show(self, t_s: float) -> None:
        """Show the windows around a time."""
        replay = self._replays[self._run.value if self._run else 0]
        counts = replay.counts_at(t_s)
        half = int(self._span_ms.value * COUNTS_PER_SECOND / 2000)
        span = Span(counts - half, counts + half)
        axes = None if self._axis.value == _ALL else [self._axis.value]
        self._pins.set_content(pins_picture(replay.lanes(span, axes), span, counts))
        self._currents.set_content(currents_picture(replay.currents(span, self._currents_of.value), span, counts))


_ARMS: Final[tuple[Arm, ...]] = ("arm", "other")
_POINTS: Final = 800
"""Points of a path: as fine as a screen."""


class ReplayScene:
    """The scene; the first run's arm is in the arm's colour, the second's in another."""

    def __init__(self, replays: tuple[Replay, ...]) -> None:
        self._replays, self._skeletons = replays, [Skeleton(each.run.robot) for each in replays]
        path = replays[0].path
        gain = path.gain
        with card(classes="flush"):
            with line("between scene-bar"):
                with line("tight"):
                    camera_buttons(lambda: self._scene)
                    mark_switches(lambda: self._scene)
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
        for arm, replay, skeleton in zip(_ARMS, self._replays, self._skeletons, strict=False):
            links = skeleton.whole(replay.machine.counted_joints(np.array([t_s])))
            if all(np.isfinite(link.points_mm).all() for link in links):  # else its counts have pulled it apart
                self._scene.show_arm(arm, [link.points_mm[0] for link in links])
            else:
                self._scene.clear_shape(arm)
        if self._boxes_move:
            shifts_mm = self._replays[0].machine.box_shifts_mm(np.array([t_s]))
            self._scene.move_boxes(shift_mm[0] for shift_mm in shifts_mm.values())
