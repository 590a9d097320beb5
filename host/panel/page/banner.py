"""The line under the head that says why the machine does not do what it is asked for, and the way out."""

from nicegui import ui

from steptwin.host.panel.desk import HomeAll, ResetFaults, Snapshot
from steptwin.host.panel.page.elements import Tone, plain
from steptwin.host.panel.page.visitor import Visitor


class Banner:
    """A line that is there only when something is in the way."""

    def __init__(self, visitor: Visitor) -> None:
        with ui.element("div").classes("banner").props("role=status") as self._line:
            self._text = ui.label()
            self._reset = plain("Reset", lambda: visitor.ask(ResetFaults()), "restart_alt")
            self._home = plain("Home all", lambda: visitor.ask(HomeAll()), "home")
        self._tone: Tone = ""
        self._line.set_visibility(False)

    def refresh(self, snapshot: Snapshot) -> None:
        """Show the most important reason."""
        text, tone, remedy = obstacle(snapshot)
        self._text.set_text(text)
        self._line.set_visibility(bool(text))
        self._reset.set_visibility(remedy == "reset")
        self._home.set_visibility(remedy == "home")
        if tone != self._tone:
            self._line.classes(add=tone, remove=self._tone)
            self._tone = tone


def obstacle(snapshot: Snapshot) -> tuple[str, Tone, str]:
    """Return what is in the way, how bad it is, and the remedy: `reset`, `home` or none; empty texts if nothing is."""
    if not snapshot.connected:
        return f"Not connected: {snapshot.why_not}. Positions are the last known.", "bad", ""
    if snapshot.emergency_stopped:
        return "Emergency stop: nothing moves until the reset.", "bad", "reset"
    faults = {
        joint.error: [each.name for each in snapshot.joints if each.error == joint.error]
        for joint in snapshot.joints
        if joint.error
    }
    if faults:
        reasons = (f"{', '.join(names)}: {error}" for error, names in faults.items())
        text = f"Fault: {'; '.join(reasons)}"
        return text if text.endswith("?") else f"{text}.", "bad", "reset"
    lost = [joint.name for joint in snapshot.joints if not joint.homed]
    if lost and snapshot.activity is None:
        return f"Not homed: {', '.join(lost)}. Until then these joints can only be jogged.", "warn", "home"
    return "", "", ""
