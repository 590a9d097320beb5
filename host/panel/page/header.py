"""The head of the page: what the machine is and does, who operates it, and the buttons that stop it."""

from nicegui import ui

from steptwin.host.panel.desk import Activity, Snapshot
from steptwin.host.panel.page.elements import Chip, Tone, icon_button, line, moving, plain
from steptwin.host.panel.page.sockets import SHOWN
from steptwin.host.panel.page.visitor import Visitor


class PageHead:
    """The head of the page; it stays in sight, with the emergency stop in it.

    Attributes:
        root: where the line is placed that says what is in the way: it must be in sight, too.
    """

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        desk = visitor.desk
        with ui.header().classes("panel-header") as self.root:
            ui.label(desk.robot.name).classes("panel-title").props('role=heading aria-level="1"')
            self._simulated = Chip("SIMULATED", "warn")
            ui.label("no connection to the panel").classes("chip bad no-panel")
            self._state = Chip()
            self._activity = Chip()
            for said in (self._state, self._activity):
                said.element.classes("said")
            self._activity.element.props["data-activity"] = ""
            ui.element("div").classes("panel-spring")
            with line("tight"):
                self._pause = plain("Pause", lambda: visitor.attempt(lambda: desk.pause(visitor.name)), "pause")
                self._resume = moving(plain("Resume", lambda: visitor.attempt(self._go_on), "play_arrow"))
                halt = plain("Stop", None, "stop")  # the panel's script sends stops, in more ways than one
                halt.props["data-stop"] = "stop"
            with line("tight said"):
                self._operator = Chip()
                self._take = plain("Operate", self._take_lease)
                self._give = plain("Give up", self._give_lease)
            theme = icon_button("contrast", "light or dark")
            theme.props["data-theme-switch"] = ""
            with ui.button(color=None).props("unelevated").classes("estop") as stop:
                ui.label("E-STOP")
                ui.label("Esc").classes("key")
            stop.props["data-stop"] = "emergency_stop"
            stop.props["aria-label"] = "emergency stop, key Escape"
            ui.element("div").classes("stop-line").props('role=alert data-stop-line=""')
            with ui.element("div").classes("part-track"):
                ui.element("div").classes("part-bar").props["data-part"] = ""

    def refresh(self, snapshot: Snapshot) -> None:
        """Show state, activity and operator."""
        self._simulated.show("SIMULATED" if snapshot.simulated else "", "warn")
        self._state.show(*machine_state(snapshot))
        activity = snapshot.activity
        self._activity.show("" if activity is None else activity_words(activity))
        trajectory = activity is not None and activity.pausable
        paused = activity is not None and activity.paused
        self._pause.set_visibility(not paused)
        self._pause.set_enabled(trajectory)
        self._resume.set_visibility(paused)
        self._refresh_operator(snapshot)

    def _refresh_operator(self, snapshot: Snapshot) -> None:
        operates = self._visitor.operates
        if operates:
            self._operator.show(f"you operate ({self._visitor.name})", "good")
        elif snapshot.operator is None:
            self._operator.show("nobody operates")
        else:
            self._operator.show(f"{snapshot.operator} operates, you watch", "warn")
        self._take.set_text("Operate" if snapshot.operator is None else "Take over")
        self._take.set_visibility(not operates)
        self._give.set_visibility(operates)

    def _go_on(self) -> None:
        self._visitor.desk.resume(self._visitor.tab, SHOWN.get())

    def _take_lease(self) -> None:
        self._visitor.desk.operators.take_over(self._visitor.tab, self._visitor.name)

    def _give_lease(self) -> None:
        self._visitor.desk.operators.give_up(self._visitor.tab)


def machine_state(snapshot: Snapshot) -> tuple[str, Tone]:
    """Return the machine's state in a word or two, and how it is meant."""
    if not snapshot.connected:
        return "not connected", "bad"
    if snapshot.emergency_stopped:
        return "emergency stop", "bad"
    if any(joint.error for joint in snapshot.joints):
        return "fault", "bad"
    if any(joint.hindrance for joint in snapshot.joints):
        return "cannot be switched on", "bad"
    states = {joint.state for joint in snapshot.joints}
    return (states.pop(), "") if len(states) == 1 else ("drives differ", "warn")


def activity_words(activity: Activity) -> str:
    """Return what the machine does, with the part that is done."""
    part = "" if activity.fraction is None else f" {100 * activity.fraction:.0f} %"
    return f"{activity.name}{part}{', paused' if activity.paused else ''}"
