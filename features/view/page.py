"""Serve stored runs in a browser, to this machine only: one run, or two side by side.

Its cards are a transport bar for the cursor, with playback at various speeds, a 3D scene of the arms, pins and
currents.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import Any, Final

import numpy as np
from nicegui import events, ui

from steptwin.features.panel.page.elements import Chip, Tone, card, choice, heading, icon_button, line, plain
from steptwin.features.panel.page.scene import Arm, ArmScene, drawing_switch, legend, view_buttons
from steptwin.features.panel.page.server import Address, open_port, serve_page
from steptwin.features.panel.page.visitor import apply_theme
from steptwin.features.view.marks import RunMark, time_words
from steptwin.features.view.markup import MARK_COLOURS, currents_picture, joint_table, pins_picture, strip_picture
from steptwin.features.view.model import PATH_INSTANTS, Edge, Instant, Replay, RunPair, Span
from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import run_name
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.protocol.timer import COUNTS_PER_SECOND

SPEEDS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
"""Playback speeds, as factors of real time."""


class Player:
    """Displayed time of one run, or of two side by side.

    Attributes:
        t_s: the time of the motion.
        playing: True while the time advances.
        speed: seconds of the motion per second.
    """

    def __init__(self, replays: Sequence[Replay]) -> None:
        self._replays = replays
        self.first_s: float = min(replay.time_s(replay.shown.from_counts) for replay in replays)
        self.last_s: float = max(replay.time_s(replay.shown.to_counts) for replay in replays)
        self.t_s: float = 0.0
        self.playing: bool = False
        self.speed: float = 1.0

    def play(self) -> None:
        """Start playback; at the motion's end from its start."""
        if self.t_s >= self.last_s:
            self.t_s = 0.0
        self.playing = True

    def pause(self) -> None:
        """Stop playback."""
        self.playing = False

    def advance(self, dt_s: float) -> bool:
        """Advance by a real time; return whether the displayed time has changed. It stops at the end."""
        if not self.playing:
            return False
        self.t_s = min(self.t_s + dt_s * self.speed, self.last_s)
        self.playing = self.t_s < self.last_s
        return True

    def seek(self, t_s: float) -> None:
        """Go to a time and stop; only steps reach times outside the slider's range."""
        self.pause()
        self.t_s = min(max(t_s, self.first_s), self.last_s)

    def step(self, way: int, run: int = 0, axis: str | None = None) -> Edge | None:
        """Go to the next edge of a run's pins, with way -1 to the previous one, and return it; None without one."""
        self.pause()
        replay = self._replays[run]
        find = replay.edge_before if way < 0 else replay.edge_after
        edge = find(replay.counts_at(self.t_s), axis)
        if edge is not None:
            self.t_s = replay.time_s(edge.counts)
        return edge

    def step_to_mark(self, way: int, run: int = 0) -> None:
        """Go to the next mark of a run, or with way -1 to the previous one, if there is one."""
        self.pause()
        replay = self._replays[run]
        now = replay.counts_at(self.t_s)
        instants = [mark.counts for mark in replay.marks if (mark.counts - now) * way > 0]
        if instants:
            self.t_s = replay.time_s(min(instants, key=lambda counts: abs(counts - now)))


_ANY: Final = "any axis"


class Transport:
    """The transport bar; `changed` is called when it has moved the cursor.

    Attributes:
        run: run with the edges and marks to step to, 0 or 1.
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
        """Handle the keys of a player: space, and arrows for edges, with shift for marks."""
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
    """Return an edge and its distance as text."""
    if edge is None:
        return "no edge"
    away_us = abs(edge.counts - shown.counts) / 72
    away = f"{away_us:.3f} us" if away_us < 1e3 else f"{away_us / 1e3:.3f} ms"
    return f"{edge.axis} {edge.pin.upper()} {'rises' if edge.level else 'falls'} {away} away"


SPANS_MS: Final = (0.2, 1.0, 5.0, 20.0, 100.0, 500.0)
_ALL: Final = "all"


class PinsCard:
    """Windows of one run; `changed` is called when the user selects another one."""

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
"""Points of a path: enough for the resolution of a screen."""


class ReplayScene:
    """3D scene; the second run's arm has another colour."""

    def __init__(self, replays: tuple[Replay, ...]) -> None:
        self._replays, self._skeletons = replays, [Skeleton(each.run.robot) for each in replays]
        path = replays[0].path
        gain = path.gain
        with card(classes="flush"):
            with line("between scene-bar"):
                with line("tight"):
                    view_buttons(lambda: self._scene)
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
            if all(np.isfinite(link.points_mm).all() for link in links):  # the counts have pulled the mechanism apart
                self._scene.show_arm(arm, [link.points_mm[0] for link in links])
            else:
                self._scene.clear_shape(arm)
        if self._boxes_move:
            shifts_mm = self._replays[0].machine.box_shifts_mm(np.array([t_s]))
            self._scene.move_boxes(shift_mm[0] for shift_mm in shifts_mm.values())


STYLE: Final = """
body.body--dark { color-scheme: dark; }
.transport { margin: 12px 16px 0; width: auto; max-width: 1768px; }
@media (min-width: 1800px) { .transport { margin: 12px auto 0; } }
.transport .strip svg { display: block; }
.transport .q-slider { margin: 0; }
.clock { font-size: 20px; font-weight: 600; min-width: 11em; }
.number.left { text-align: left; }
.w-speed { width: 96px; }
.lanes { display: flex; gap: 10px; font-size: 13px; margin-top: 8px; }
.lane-names { flex: 0 0 auto; min-width: 72px; }
.lane-names div { display: flex; align-items: center; white-space: nowrap; }
.lane-picture { flex: 1 1 auto; min-width: 0; }
.lane-picture svg { display: block; }
.mark.q-btn.plain { font-weight: 400; width: 100%; text-align: left; margin-bottom: 4px; min-height: 32px; }
.mark .q-btn__content { justify-content: flex-start; text-align: left; flex-wrap: wrap; }
.events { max-height: 300px; }
@media (max-width: 900px) { .transport { margin: 8px 8px 0; } .clock { font-size: 17px; } }
"""
TICK_S: Final = 0.05
MARKS_MAX: Final = 300
"""Largest number of marks in the list; the strip above the slider shows all."""


class ReplayPage:
    """The page of one browser; all browsers share the runs."""

    def __init__(self, replays: tuple[Replay, ...]) -> None:
        self._replays = replays
        self._difference = RunPair(*replays) if len(replays) == 2 else None
        self._player = Player(replays)
        apply_theme(script=False)
        ui.add_head_html(f"<style>{STYLE}</style>")
        self._make_header()
        with ui.element("div"):
            self._transport = Transport(self._player, replays, self._strip(), self.show)
            with ui.element("div").classes("panel-body"):
                with ui.element("div").classes("panel-left"):
                    self._scene = ReplayScene(replays)
                    self._make_marks()
                with ui.element("div").classes("panel-right"):
                    with card("At the cursor"):
                        self._joints = ui.html("", sanitize=False).classes("scroll-x")
                    self._pins = PinsCard(replays, self.show)
        self._before_s = monotonic()
        ui.timer(TICK_S, self._tick)
        self.show()

    def show(self) -> None:
        """Show the runs at the player's time."""
        t_s = self._player.t_s
        shown = [replay.at(replay.counts_at(t_s)) for replay in self._replays]
        self._scene.show(t_s)
        apart = None if self._difference is None else self._difference.at(t_s)
        self._joints.set_content(joint_table(shown, apart))
        self._pins.show(t_s)
        self._transport.show(shown[self._transport.run])

    def _tick(self) -> None:
        now_s = monotonic()
        changed = self._player.advance(now_s - self._before_s)
        self._before_s = now_s
        if changed:
            self.show()

    def _make_header(self) -> None:
        with ui.header().classes("panel-header"):
            for number, replay in enumerate(self._replays):
                ui.label(run_name(replay.run.report.run)).classes("panel-title").props('role=heading aria-level="1"')
                Chip("SIMULATED", "warn")
                Chip(*_verdict(replay))
                if len(self._replays) == 2:
                    Chip(("first", "second, orange")[number])
            ui.element("div").classes("panel-spring")
            dark = ui.dark_mode(None)
            icon_button("contrast", "light or dark", lambda: dark.set_value(not dark.value))

    def _strip(self) -> str:
        marks = [(replay.time_s(mark.counts), mark) for replay in self._replays for mark in replay.marks]
        t_s, values = self._course()
        return strip_picture(t_s, np.nan_to_num(values), (self._player.first_s, self._player.last_s), marks)

    def _course(self) -> tuple[FloatArray, FloatArray]:
        """Return the curve above the slider: the tool's error, or the distance of the two tools."""
        if self._difference is not None:
            return self._difference.course.t_s, self._difference.course.tool_mm
        replay = self._replays[0]
        errors_mm = np.linalg.norm(replay.path.errors_mm, axis=1)
        return np.repeat(np.linspace(0.0, replay.run.duration_s, PATH_INSTANTS), 2), errors_mm

    def _make_marks(self) -> None:
        marks = sorted(
            (
                (replay.time_s(mark.counts), number, mark)
                for number, replay in enumerate(self._replays)
                for mark in replay.marks
            ),
            key=lambda each: each[:2],
        )
        with card("What happened"):
            if not marks:
                ui.label("Nothing but the motion: no broken limit, no error, no output.").classes("muted")
            if len(marks) > MARKS_MAX:
                ui.label(f"The first {MARKS_MAX} of {len(marks)}; the strip above the slider shows all.").classes(
                    "muted"
                )
            with ui.element("div").classes("events"):
                for _, number, mark in marks[:MARKS_MAX]:
                    self._make_mark(number, mark)

    def _make_mark(self, number: int, mark: RunMark) -> None:
        replay = self._replays[number]
        of_run = ("first: ", "second: ")[number] if len(self._replays) == 2 else ""
        button = plain(
            f"{time_words(mark, replay.start_counts)} · {of_run}{mark.who}: {mark.text}",
            lambda: self._go_to(replay.time_s(mark.counts)),
        )
        button.classes("mark").style(f"border-left: 4px solid {MARK_COLOURS[mark.kind]}")

    def _go_to(self, t_s: float) -> None:
        self._player.pause()
        self._player.t_s = t_s
        self.show()


def _verdict(replay: Replay) -> tuple[str, Tone]:
    """Return the verdict of the run's report, and its colour."""
    report = replay.run.report
    if report.fault is not None:
        return "stopped by a fault", "bad"
    if report.passed is None:
        return ("recorded live: counts without a plan", "warn") if replay.run.no_plan else ("recorded live", "")
    return ("verified", "good") if report.passed else ("not verified", "bad")


def serve_replay(
    folders: tuple[Path, ...], plan_folder: Path | None, port: int | None, announce: Callable[[str], None]
) -> None:
    """Serve one run, or two side by side, until Ctrl-C.

    Args:
        folders: one or two folders of runs.
        plan_folder: as for `read_run`, for the first run.
        port: TCP port; None takes the usual one, or a free one if it is in use; 0 takes a free one.
        announce: called with the page's URL when the page is ready.

    Raises:
        InputError: as `Replay.of_folder` and `RunPair` do.
        BusError: the port is in use.
    """
    with open_port(Address(port=port)) as listener:
        plans = (plan_folder, *(None for _ in folders[1:]))
        replays = tuple(Replay.of_folder(*each) for each in zip(folders, plans, strict=True))
        if len(replays) == 2:
            RunPair(*replays)
        names = " and ".join(run_name(replay.run.report.run) for replay in replays)

        def build() -> None:
            ReplayPage(replays)

        serve_page(build, listener, f"{names} – StepTwin", announce)
