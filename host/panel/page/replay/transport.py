"""The bar that moves the cursor: play and pause, speed, slider with the strip above it, steps to edges and marks."""

from collections.abc import Callable
from typing import Any, Final

from nicegui import events, ui

from steptwin.host.panel.page.elements import card, choice, icon_button, line
from steptwin.host.panel.replay import Instant, Replay
from steptwin.host.panel.replay.model import Edge
from steptwin.host.panel.replay.player import Player
from steptwin.host.record.animation.film_page import SPEEDS

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
        names = replays[0].run.robot.joint_names
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
