"""Serve stored runs in a browser, to this machine only: one run, or two side by side."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Final

import numpy as np
from nicegui import ui

from steptwin.host.common.arrays import FloatArray
from steptwin.host.panel.page.elements import Chip, Tone, card, icon_button, plain
from steptwin.host.panel.page.server import Address, open_port, serve_page
from steptwin.host.panel.page.visitor import apply_theme
from steptwin.host.panel.replay.cards import PinsCard, ReplayScene, Transport
from steptwin.host.panel.replay.marks import RunMark, time_words
from steptwin.host.panel.replay.markup import MARK_COLOURS, joint_table, strip_picture
from steptwin.host.panel.replay.model import PATH_INSTANTS, Replay, RunPair
from steptwin.host.panel.replay.player import Player
from steptwin.host.record.path_error import run_name

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
    """The views of one browser; the runs are shared by all."""

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
        """Return the curve above the slider: how far the tool is from its plan, or the two tools from each other."""
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
    """Return what the run's report says of it, and how it is meant."""
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
        plan_folder: as for `read_run`, for the first of them.
        port: TCP port; None takes the usual one, or a free one if it is in use; 0 takes a free one.
        announce: called with the page's URL when browsers can open it.

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
