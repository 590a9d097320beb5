"""The table of the joints, the tool's pose, and the buttons for the machine as a whole."""

from nicegui import ui

from steptwin.host.panel.desk import Disable, Enable, HomeAll, HomeJoint, JointView, Snapshot
from steptwin.host.panel.page.elements import Chip, Tone, act, card, cell, heading, line, live, plain, table
from steptwin.host.panel.page.visitor import Visitor

_POSE = (("x", "mm"), ("y", "mm"), ("z", "mm"), ("phi", "deg"))


class Joints:
    """The table of the joints with the tool's pose under it."""

    def __init__(self, visitor: Visitor) -> None:
        self._rows: dict[str, _Row] = {}
        with card(classes="place-joints"):
            with line("between"):
                heading("Joints")
                with line("tight"):
                    act("Switch on", lambda: visitor.ask(Enable()), "power_settings_new")
                    plain("Switch off", lambda: visitor.ask(Disable()))
                    plain("Home all", lambda: visitor.ask(HomeAll()), "home")
            with ui.element("div").classes("scroll-x"):
                headings = [
                    ("joint", ""),
                    ("position", "number"),
                    ("", ""),
                    ("rate", "number spare"),
                    ("error", "number spare"),
                    ("drive", ""),
                    ("homed", ""),
                ]
                with table(headings):
                    for i, joint in enumerate(visitor.desk.robot.joints):
                        self._rows[joint.name] = _Row(visitor, i, joint.name, str(joint.unit))
            with ui.element("div").classes("pose"):
                for i, (name, unit) in enumerate(_POSE):
                    with ui.element("div"):
                        ui.label(f"tool {name}, {unit}").classes("muted small")
                        live(f"pose{i}", "value")

    def refresh(self, snapshot: Snapshot) -> None:
        """Show states, homing and faults."""
        for joint in snapshot.joints:
            self._rows[joint.name].refresh(joint)


class _Row:
    def __init__(self, visitor: Visitor, i: int, name: str, unit: str) -> None:
        with ui.element("tr"):
            with cell():
                ui.label(name).classes("joint-name")
            with cell("number big"):
                self._position = live(f"q{i}")
            with cell("muted"):
                ui.label(unit)
            with cell("number spare muted"):
                live(f"v{i}")
            with cell("number spare muted"):
                live(f"e{i}")
            with cell():
                self._state = Chip()
            with cell(), line("tight nowrap"):
                self._homed = Chip()
                self._home = plain("Home", lambda: visitor.ask(HomeJoint(joint=name))).classes("small-button")
                self._home.props["aria-label"] = f"home {name}"

    def refresh(self, joint: JointView) -> None:
        self._state.show(*_state(joint))
        self._position.classes(add="" if joint.homed else "unknown", remove="unknown" if joint.homed else "")
        self._homed.show("yes" if joint.homed else "no", "good" if joint.homed else "warn")


def _state(joint: JointView) -> tuple[str, Tone]:
    if joint.error:
        return joint.error, "bad"
    return (f"{joint.state}: {joint.hindrance}", "bad") if joint.hindrance else (joint.state, "")
