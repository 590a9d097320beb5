"""The line under the head that says why the machine does not do what it is asked for, and the way out."""

from collections.abc import Iterable

from nicegui import ui

from steptwin.host.client.plain_words import STOP_PRESSED
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
    joints = snapshot.joints
    if not snapshot.connected:
        seen = " Positions are the last known." if joints else ""
        return f"Not connected: {sentence(str(snapshot.why_not))}{seen}", "bad", ""
    hindered = by_reason((joint.name, joint.hindrance) for joint in joints)
    if snapshot.emergency_stopped:
        pressed = STOP_PRESSED in hindered
        way_out = "pull its button out at the machine, then reset" if pressed else "nothing moves until the reset"
        return f"Emergency stop: {way_out}.", "bad", "reset"
    faults = by_reason((joint.name, joint.error) for joint in joints)
    if faults:
        text = "; ".join(f"{', '.join(names)}: {fault}" for fault, names in faults.items())
        return f"Fault: {sentence(text)}", "bad", "reset"
    if hindered:
        text = "; ".join(
            why if len(names) == len(joints) else f"{', '.join(names)}: {why}" for why, names in hindered.items()
        )
        return f"The drives cannot be switched on: {sentence(text)}", "bad", ""
    lost = [joint.name for joint in joints if not joint.homed]
    if lost and snapshot.activity is None:
        return f"Not homed: {', '.join(lost)}. Until then these joints can only be jogged.", "warn", "home"
    return "", "", ""


def by_reason(reasons: Iterable[tuple[str, str | None]]) -> dict[str, list[str]]:
    """Return the names of those that have a reason, by their reasons."""
    named: dict[str, list[str]] = {}
    for name, reason in reasons:
        if reason is not None:
            named.setdefault(reason, []).append(name)
    return named


def sentence(text: str) -> str:
    """Return a text with a full stop, unless it ends a sentence already."""
    return text if text.endswith(("?", ".", "!")) else f"{text}."
