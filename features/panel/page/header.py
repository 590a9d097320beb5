"""Head of the page: the machine's state, obstacles, the operator, the stop buttons; and the log of events."""

import time
from collections.abc import Callable
from typing import Final

from nicegui import ui

from steptwin.features.panel.page.elements import Chip, Tone, card, choice, heading, icon_button, line, plain
from steptwin.features.panel.page.visitor import SHOWN, Visitor
from steptwin.features.panel.service.commands import HomeAll, ResetFaults
from steptwin.features.panel.service.history import Event, Severity
from steptwin.features.panel.service.snapshots import Activity, Snapshot, grouped
from steptwin.host.client.words import STOP_PRESSED


class PageHead:
    """Head of the page; it stays visible, with the emergency stop in it.

    Attributes:
        root: element of the head; the banner is placed in it to stay visible, too.
    """

    def __init__(self, visitor: Visitor) -> None:
        self._visitor, service = visitor, visitor.service

        def attempt(action: Callable[[], None]) -> Callable[[], object]:
            return lambda: visitor.attempt(action)

        self.root: ui.header = ui.header().classes("panel-header")
        with self.root:
            ui.label(service.robot.name).classes("panel-title").props('role=heading aria-level="1"')
            self._simulated = Chip("SIMULATED", "warn")
            ui.label("no connection to the panel").classes("chip bad no-panel")
            self._state, self._activity = Chip(classes="said"), Chip(classes="said")
            self._activity.element.props["data-activity"] = ""
            ui.element("div").classes("panel-spring")
            with line("tight"):
                self._pause = plain("Pause", attempt(lambda: service.pause(visitor.name)), "pause")
                resume = attempt(lambda: service.resume(visitor.tab, SHOWN.get()))
                self._resume = plain("Resume", resume, "play_arrow", moves=True)
                halt = plain("Stop", None, "stop")  # the panel's script sends stops, by several paths
                halt.props["data-stop"] = "stop"
            with line("tight said"):
                self._operator = Chip()
                take = attempt(lambda: service.operator.take(visitor.tab, visitor.name))
                self._take = plain("Operate", take)
                self._give = plain("Give up", lambda: service.operator.give_up(visitor.tab))
            icon_button("contrast", "light or dark").props["data-theme-switch"] = ""
            with ui.button(color=None).props("unelevated").classes("estop") as stop:
                ui.label("E-STOP")
                ui.label("Esc").classes("key")
            stop.props.update({"data-stop": "emergency_stop", "aria-label": "emergency stop, key Escape"})
            ui.element("div").classes("stop-line").props('role=alert data-stop-line=""')
            with ui.element("div").classes("part-track"):
                ui.element("div").classes("part-bar").props["data-part"] = ""

    def refresh(self, snapshot: Snapshot) -> None:
        self._simulated.show("SIMULATED" if snapshot.simulated else "", "warn")
        self._state.show(*machine_state(snapshot))
        activity = snapshot.activity
        self._activity.show("" if activity is None else activity_words(activity))
        paused = activity is not None and activity.paused
        self._pause.set_visibility(not paused)
        self._pause.set_enabled(activity is not None and activity.pausable)
        self._resume.set_visibility(paused)
        if self._visitor.operates:
            self._operator.show(f"you operate ({self._visitor.name})", "good")
        elif snapshot.operator is None:
            self._operator.show("nobody operates")
        else:
            self._operator.show(f"{snapshot.operator} operates, you watch", "warn")
        self._take.set_visibility(snapshot.operator is None)
        self._give.set_visibility(self._visitor.operates)


def machine_state(snapshot: Snapshot) -> tuple[str, Tone]:
    """Return the machine's state in a word or two, and its tone."""
    if not snapshot.connected:
        return "not connected", "bad"
    if snapshot.emergency_stopped:
        return "emergency stop", "bad"
    if snapshot.faulty:
        return "fault", "bad"
    if any(joint.hindrance for joint in snapshot.drives):
        return "cannot be switched on", "bad"
    states = {joint.state for joint in snapshot.drives}
    return (states.pop(), "") if len(states) == 1 else ("drives differ", "warn")


def activity_words(activity: Activity) -> str:
    """Return the activity as text, with the fraction done."""
    if activity.waits_for and not activity.paused:
        return f"{activity.name} waits for {activity.waits_for}"
    part = "" if activity.fraction is None else f" {100 * activity.fraction:.0f} %"
    return f"{activity.name}{part}{', paused' if activity.paused else ''}"


class Banner:
    """A line about the reason why the machine does not move, and the remedy; its space is reserved."""

    def __init__(self, visitor: Visitor) -> None:
        with (
            ui.element("div").classes("banner-place"),
            ui.element("div").classes("banner").props("role=status") as self._line,
        ):
            self._text = ui.label()
            self._remedies = {
                "reset": plain("Reset", lambda: visitor.ask(ResetFaults()), "restart_alt", moves=True),
                "home": plain("Home all", lambda: visitor.ask(HomeAll()), "home", moves=True),
            }
        self._tone: Tone = ""

    def refresh(self, snapshot: Snapshot) -> None:
        text, tone, remedy = obstacle(snapshot)
        self._text.set_text(text or "Nothing is in the way.")
        self._text.props["title"] = text
        for name, button in self._remedies.items():
            button.set_visibility(name == remedy)
        if tone != self._tone:
            self._line.classes(add=tone, remove=self._tone)
            self._tone = tone


_BEHIND_PERCENT: Final = 5.0
"""Least percentage of time with a stopped board clock that is reported."""


def obstacle(snapshot: Snapshot) -> tuple[str, Tone, str]:
    """Return the obstacle, its severity, and the remedy: `reset`, `home` or none; empty texts without an obstacle."""
    joints = snapshot.drives
    if not snapshot.connected:
        seen = " Positions are the last known." if joints else ""
        return f"Not connected: {_sentence(str(snapshot.why_not))}{seen}", "bad", ""
    hindered = grouped((joint.name, joint.hindrance) for joint in joints if joint.hindrance is not None)
    if snapshot.emergency_stopped:
        pressed = STOP_PRESSED in hindered
        way_out = "pull its button out at the machine, then reset" if pressed else "nothing moves until the reset"
        return f"Emergency stop: {way_out}.", "bad", "reset"
    faults = grouped((joint.name, joint.error) for joint in joints if joint.error is not None)
    if faults:
        text = "; ".join(f"{', '.join(names)}: {fault}" for fault, names in faults.items())
        return f"Fault: {_sentence(text)}", "bad", "reset"
    if hindered:
        text = "; ".join(
            why if len(names) == len(joints) else f"{', '.join(names)}: {why}" for why, names in hindered.items()
        )
        return f"The drives cannot be switched on: {_sentence(text)}", "bad", ""
    lost = [joint.name for joint in snapshot.joints if not joint.homed]
    if lost and snapshot.activity is None:
        return f"Not homed: {', '.join(lost)}. Until then these joints can only be jogged.", "warn", "home"
    stood_percent = snapshot.board.stood_percent or 0.0
    behind = (
        f"The emulated board falls behind: its clock stood for {stood_percent:.0f} % of the last 5 s, since the"
        " computer is too slow. The machine moves as planned, but takes longer."
    )
    return (behind, "warn", "") if stood_percent >= _BEHIND_PERCENT else ("", "", "")


def _sentence(text: str) -> str:
    return text if text.endswith(("?", ".", "!")) else f"{text}."


_SHOWN_EVENTS: Final = 200  # the service keeps more


class EventLogView:
    """List of events, the newest first; failures are also shown as messages, since the list is at the page's end."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._log = visitor.service.events
        self._told = max((event.number for event in self._log.since()), default=0)
        """Number of the last event that needs no message in this browser."""
        self._faulty = False
        self._filter = "all"
        self._shown: list[int] = []
        """Numbers of the listed events, the oldest first."""
        with card(classes="panel-wide place-events"):
            with line("between"):
                heading("What has happened")
                with line("tight"):
                    choice("events to show", {"all": "all", "problems": "problems only"}, "all", self._choose)
                    plain("Clear", self._log.clear)
            self._list = ui.element("div").classes("events").props('role=log aria-label="events" tabindex=0')

    def refresh(self, snapshot: Snapshot) -> None:
        was_faulty, self._faulty = self._faulty, snapshot.emergency_stopped or snapshot.faulty
        if was_faulty and not self._faulty and snapshot.connected:
            self._visitor.withdraw()
        for event in self._log.since(self._told):
            self._told = event.number
            if event.severity is Severity.ERROR and snapshot.connected:  # the banner shows it already
                self._visitor.tell(event.text)
        self._show()

    def _choose(self, name: str) -> None:
        self._filter = name
        self._clear()
        self._show()

    def _clear(self) -> None:
        self._list.clear()
        self._shown = []

    def _show(self) -> None:
        wanted = [each for each in self._log.since() if self._filter == "all" or each.severity is not Severity.INFO]
        events = wanted[-_SHOWN_EVENTS:]
        numbers = [event.number for event in events]
        if self._shown and (not numbers or numbers[0] != self._shown[0]):
            self._clear()
        for event in events[len(self._shown) :]:
            with self._list:
                _row(event).move(self._list, target_index=0)
        self._shown = numbers


def _row(event: Event) -> ui.element:
    with ui.element("div").classes(f"event {event.severity}") as row:
        ui.label(time.strftime("%H:%M:%S", time.localtime(event.wall_s))).classes("muted number")
        ui.label(event.severity).classes("kind")
        ui.label(event.text)
    return row
