"""The table of the joints, the tool's pose, and the buttons for the machine as a whole."""

from functools import partial
from typing import Final

from nicegui import ui

from steptwin.host.client.words import state_words
from steptwin.host.panel.desk.commands import Disable, Enable, HomeAll, HomeJoint, SwitchOutput
from steptwin.host.panel.desk.state import JointView, Snapshot
from steptwin.host.panel.page.elements import (
    Chip,
    Tone,
    act,
    card,
    cell,
    heading,
    line,
    live,
    note,
    plain,
    table,
)
from steptwin.host.panel.page.visitor import Visitor
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.protocol.cia402 import State


class OutputsTab:
    """A row for each output and each input of the robot's file."""

    def __init__(self, visitor: Visitor) -> None:
        robot = visitor.desk.robot
        heading("Outputs")
        self._outputs: dict[str, Chip] = {}
        self._inputs: dict[str, Chip] = {}
        if robot.outputs:
            with table([("output", ""), ("is", ""), ("", "")]):
                for name in robot.outputs:
                    self._outputs[name] = _output_row(visitor, name)
        else:
            note(f"{robot.name} has no outputs.")
        heading("Inputs")
        if robot.inputs:
            with table([("input", ""), ("is", "")]):
                for name in robot.inputs:
                    with ui.element("tr"):
                        cell(name)
                        with cell():
                            self._inputs[name] = Chip("off")
        else:
            note(f"{robot.name} has no inputs.")

    def refresh(self, snapshot: Snapshot) -> None:
        """Show each output and input as on, off or unknown."""
        for chips, levels in ((self._outputs, snapshot.outputs), (self._inputs, snapshot.inputs)):
            for name, chip in chips.items():
                on = levels.get(name)
                chip.show("unknown" if on is None else "on" if on else "off", "good" if on else "")


def _output_row(visitor: Visitor, name: str) -> Chip:
    with ui.element("tr"):
        cell(name)
        with cell():
            chip = Chip("unknown")
        with cell(), line("tight"):
            for text, on in (("on", True), ("off", False)):
                switch = partial(visitor.ask, SwitchOutput(output=name, on=on))
                plain(text, switch, label=f"switch {name} {text}", moves=True)
    return chip


_ON, _OFF = state_words(State.OPERATION_ENABLED), state_words(State.SWITCH_ON_DISABLED)


_TURNS: Final = ("roll", "pitch", "yaw")
"""Coordinates that nothing but a tool has; with the place they fill the line."""


class Joints:
    """The table of the joints with the tool's pose under it."""

    def __init__(self, visitor: Visitor) -> None:
        self._rows: dict[str, _JointRow] = {}
        with card(classes="place-joints"):
            with line("between"):
                heading("Joints")
                with line("tight"):
                    self._on = act("Switch on", lambda: visitor.ask(Enable()), "power_settings_new", moves=True)
                    self._off = plain("Switch off", lambda: visitor.ask(Disable()), moves=True)
                    plain("Home all", lambda: visitor.ask(HomeAll()), "home", moves=True)
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
                    for i, joint in enumerate(visitor.desk.robot.axes):
                        self._rows[joint.name] = _JointRow(visitor, i, joint.name, str(joint.unit))
            with ui.element("div").classes("pose"):
                for i, (name, unit) in enumerate(make_kinematics(visitor.desk.robot).task.coordinates.items()):
                    with ui.element("div"):
                        of_tool = "" if name in _TURNS else "tool "
                        ui.label(f"{of_tool}{name}, {unit}".rstrip(", ")).classes("muted small")
                        live(f"pose{i}", "value")

    def refresh(self, snapshot: Snapshot) -> None:
        """Show states, homing and faults."""
        for joint in snapshot.drives:
            self._rows[joint.name].refresh(joint)
        states = {joint.state for joint in snapshot.drives}
        held = snapshot.emergency_stopped or any(joint.error for joint in snapshot.drives)
        self._on.set_enabled(states != {_ON} and not held)
        self._off.set_enabled(states != {_OFF})


class _JointRow:
    def __init__(self, visitor: Visitor, i: int, name: str, unit: str) -> None:
        with ui.element("tr"):
            cell(name)
            with cell(classes="number big"):
                self._position = live(f"q{i}")
            cell(unit, "muted")
            for value in (f"v{i}", f"e{i}"):
                with cell(classes="number spare muted"):
                    live(value)
            with cell():
                self._state = Chip()
            with cell(), line("tight nowrap"):
                self._homed = Chip()
                if name in visitor.desk.robot.joint_names:
                    home = plain("Home", lambda: visitor.ask(HomeJoint(joint=name)), label=f"home {name}", moves=True)
                    home.classes("small-button")

    def refresh(self, joint: JointView) -> None:
        self._state.show(*_state(joint))
        self._position.classes(add="" if joint.homed else "unknown", remove="unknown" if joint.homed else "")
        self._homed.show("yes" if joint.homed else "no", "good" if joint.homed else "warn")


def _state(joint: JointView) -> tuple[str, Tone]:
    if joint.error:
        return joint.error, "bad"
    return (f"{joint.state}: {joint.hindrance}", "bad") if joint.hindrance else (joint.state, "")
