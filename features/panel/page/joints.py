"""The table of the joints with the tool's pose, the Outputs tab, and the Jog tab.

In the Jog tab a joint or the tool moves while a button is held, or by steps.
"""

import json
from functools import partial
from typing import Any, Final

from nicegui import events, ui

from steptwin.features.panel.page.elements import (
    Chip,
    Tone,
    act,
    card,
    cell,
    choice,
    heading,
    line,
    live,
    note,
    plain,
    stack,
    table,
    titled,
)
from steptwin.features.panel.page.visitor import SHOWN, Visitor
from steptwin.features.panel.service.commands import (
    Disable,
    Enable,
    HomeAll,
    HomeJoint,
    Jog,
    JointJog,
    StepJoint,
    StepTool,
    SwitchOutput,
    ToolJog,
)
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.snapshots import JointView, Snapshot
from steptwin.host.client.words import state_words
from steptwin.host.planning.tool_by_hand import StepFrame, tool_speed_max
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.protocol.cia402 import State


class OutputsTab:
    """A row for each output and each input of the robot's file."""

    def __init__(self, visitor: Visitor) -> None:
        robot = visitor.service.robot
        self._chips: dict[str, dict[str, Chip]] = {}
        for kind, names in (("output", list(robot.outputs)), ("input", list(robot.inputs))):
            heading(f"{kind.capitalize()}s")
            self._chips[kind] = {}
            if not names:
                note(f"{robot.name} has no {kind}s.")
                continue
            with table(kind, "is", *([""] if kind == "output" else [])):
                for name in names:
                    with ui.element("tr"):
                        cell(name)
                        with cell():
                            self._chips[kind][name] = Chip()
                        if kind == "output":
                            with cell(), line("tight"):
                                for text, on in (("on", True), ("off", False)):
                                    switch = partial(visitor.ask, SwitchOutput(output=name, on=on))
                                    plain(text, switch, label=f"switch {name} {text}", moves=True)

    def refresh(self, snapshot: Snapshot) -> None:
        for kind, levels in (("output", snapshot.outputs), ("input", snapshot.inputs)):
            for name, chip in self._chips[kind].items():
                on = levels.get(name)
                chip.show("unknown" if on is None else "on" if on else "off", "good" if on else "")


_ON, _OFF = state_words(State.OPERATION_ENABLED), state_words(State.SWITCH_ON_DISABLED)
_TURNS: Final = ("roll", "pitch", "yaw")
"""Rotational coordinates of a tool; with the position they fill the line."""


class Joints:
    """The table of the joints with the tool's pose under it, and the buttons for the machine as a whole."""

    def __init__(self, visitor: Visitor) -> None:
        self._rows: dict[str, _JointRow] = {}
        with card(classes="place-joints"):
            with line("between"):
                heading("Joints")
                with line("tight"):
                    self._on = act("Switch on", lambda: visitor.ask(Enable()), "power_settings_new", moves=True)
                    self._off = plain("Switch off", lambda: visitor.ask(Disable()), moves=True)
                    plain("Home all", lambda: visitor.ask(HomeAll()), "home", moves=True)
            headings = ("joint", "position|number", "", "rate|number spare", "error|number spare", "drive", "homed")
            with ui.element("div").classes("scroll-x"), table(*headings):
                for i, joint in enumerate(visitor.service.robot.axes):
                    self._rows[joint.name] = _JointRow(visitor, i, joint.name, str(joint.unit))
            with ui.element("div").classes("pose"):
                for i, (name, unit) in enumerate(make_kinematics(visitor.service.robot).task.coordinates.items()):
                    with ui.element("div"):
                        of_tool = "" if name in _TURNS else "tool "
                        ui.label(f"{of_tool}{name}, {unit}".rstrip(", ")).classes("muted small")
                        live(f"pose{i}", "value")

    def refresh(self, snapshot: Snapshot) -> None:
        for joint in snapshot.drives:
            self._rows[joint.name].refresh(joint)
        states = {joint.state for joint in snapshot.drives}
        self._on.set_enabled(states != {_ON} and not (snapshot.emergency_stopped or snapshot.faulty))
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
                if name in visitor.service.robot.joint_names:
                    home = plain("Home", lambda: visitor.ask(HomeJoint(joint=name)), label=f"home {name}", moves=True)
                    home.classes("small-button")

    def refresh(self, joint: JointView) -> None:
        tone: Tone = "bad" if joint.error or joint.hindrance else ""
        hindered = f"{joint.state}: {joint.hindrance}" if joint.hindrance else joint.state
        self._state.show(joint.error or hindered, tone)
        self._position.classes(add="" if joint.homed else "unknown", remove="unknown" if joint.homed else "")
        self._homed.show("yes" if joint.homed else "no", "good" if joint.homed else "warn")


HOLD: Final = "hold"
_STEPS: Final = {HOLD: "while held", 10.0: "10", 1.0: "1", 0.1: "0.1"}
"""Modes of a press: a step in mm and degrees, or motion while held."""
_FRAMES: Final = {StepFrame.WORLD: "world's axes", StepFrame.TOOL: "its own"}
_PERCENTS: Final = {5: "5 %", 20: "20 %", 50: "50 %", 100: "100 %"}
_TURN_NAMES: Final = {f"r{axis}": f"about {axis}" for axis in "xyz"}
"""Button texts for the rotations of a tool."""


class JogTab:
    """Buttons to move each joint and each coordinate of the tool."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        robot = visitor.service.robot
        task = make_kinematics(robot).task
        self._names = (*robot.joint_names, *task.steps)
        self._chosen: dict[str, Any] = {"step": HOLD, "percent": 20, "frame": StepFrame.WORLD}
        self._buttons: list[ui.button] = []
        self._refused = ""
        with line("between"):
            with titled("A press moves"):
                choice("what a press moves", _STEPS, HOLD, partial(self._choose, "step"))
            with titled("Speed"):
                choice("speed of a jog", _PERCENTS, 20, partial(self._choose, "percent"))
        with ui.element("div").classes("jog-sides"):
            with stack("tight"):
                heading("Joints")
                for i, joint in enumerate(robot.joints):
                    self._row(joint.name, str(joint.unit), f"q{i}")
            with stack("tight") as tool:
                with line("between"):
                    heading("Tool")
                    choice("axes that the tool moves along", _FRAMES, StepFrame.WORLD, partial(self._choose, "frame"))
                coordinates = list(task.coordinates)
                for name, unit in task.steps.items():
                    self._row(name, unit, f"pose{coordinates.index(name)}" if name in coordinates else None)
                self._why_no_tool = note("The tool can be jogged when every joint is homed.")
            tool.set_visibility(bool(task.steps))
        ui.on("jog_beat", self._beat, args=[["press", "what", "sign"]])
        ui.on("jog_release", self._release, args=[["press"]])
        self._mark_buttons()

    def refresh(self, snapshot: Snapshot) -> None:
        self._why_no_tool.set_visibility(not snapshot.homed)

    def _row(self, name: str, unit: str, position: str | None) -> None:
        with ui.element("div").classes("jog-row"):
            with ui.element("div"):
                ui.label(f"{_TURN_NAMES.get(name, name)}, {unit}")
                if position is not None:
                    live(position, "number muted small")
            for sign, text, direction in ((-1, "−", "backward"), (1, "+", "forward")):
                button = ui.button(text, on_click=partial(self._by_step, name, sign), color=None)
                button.props("unelevated no-caps").classes("jog").props["aria-label"] = f"jog {name} {direction}"
                button.props["data-what"] = json.dumps({"what": name, "sign": sign})
                self._buttons.append(button)

    def _choose(self, what: str, value: Any) -> None:
        self._chosen[what] = value
        self._mark_buttons()

    def _mark_buttons(self) -> None:
        """Mark the buttons for the panel's script: to be held, or to be clicked."""
        for button in self._buttons:
            if self._chosen["step"] == HOLD:
                button.props["data-jog"] = button.props["data-what"]
            else:
                button.props.pop("data-jog", None)
            button.update()

    def _by_step(self, name: str, sign: int) -> None:
        step, percent, frame = self._chosen.values()
        if step == HOLD:
            return  # the script has reported the press and its end
        if name in self._visitor.service.robot.joint_names:
            self._visitor.ask(StepJoint(joint=name, distance=sign * step, speed_percent=percent))
        else:
            self._visitor.ask(StepTool({name: sign * step}, percent, frame))

    def _jog(self, name: str, sign: float) -> Jog:
        part = (1 if sign > 0 else -1) * self._chosen["percent"] / 100
        robot = self._visitor.service.robot
        if name in robot.joint_names:
            return JointJog(name, part * robot.joint(name).speed_max)
        return ToolJog(name, part * tool_speed_max(name), self._chosen["frame"])

    def _beat(self, event: events.GenericEventArguments) -> None:
        """Pass on a beat of a held button; show a refusal once, not with each beat. Other events are dropped."""
        match event.args:
            case {"press": int(press), "what": str(name), "sign": int(sign)} if name in self._names:
                try:
                    self._visitor.service.beat(self._visitor.tab, press, self._jog(name, sign), SHOWN.get())
                except RefusedError as error:
                    self._tell_once(press, str(error))

    def _release(self, event: events.GenericEventArguments) -> None:
        match event.args:
            case {"press": int(press)}:
                self._tell_once(press, self._visitor.service.release(self._visitor.tab, press))

    def _tell_once(self, press: int, why: str | None) -> None:
        """Show why a press has ended, once."""
        if why is not None and self._refused != f"{press} {why}":
            self._refused = f"{press} {why}"
            self._visitor.tell(why)
