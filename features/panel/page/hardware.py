"""The Hardware tab: the emulated machine around a served board.

Press its emergency stop, lower its supply, trip a driver's Protect pin, stick a switch, and watch the reaction.
"""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Final, NamedTuple

from nicegui import ui

from steptwin.features.panel.page.elements import Chip, NumberField, Tone, cell, heading, line, note, plain, table
from steptwin.features.panel.page.visitor import SHOWN, Visitor
from steptwin.features.panel.service.messages import operator_message
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.client.control_client import ControlClient, ControlState
from steptwin.host.common.choices import Stuck
from steptwin.host.common.errors import BusError, InputError

_EVERY_S: Final = 1.0
Request = Callable[[], ControlState]
Shown = tuple[str, Tone]
_STOP: Final = "Press"
"""Name of the button that stops the machine."""
_STUCK: Final = {"Free": Stuck.FREE, "Stick closed": Stuck.CLOSED, "Stick open": Stuck.OPEN}


class SettableNumber(NamedTuple):
    """A settable number: its control port request, its unit, and its initial value."""

    ask: Callable[[float], ControlState]
    unit: str
    value: float


class MachineRow(NamedTuple):
    """An operable part of the machine.

    Attributes:
        text: its name on the page.
        of: its name in the labels of its buttons; empty if a button's own text is enough.
        shown: its present state from the control port.
        presses: control port request of each of its buttons.
        number: its settable number, if it has one.
    """

    text: str
    of: str
    shown: Callable[[ControlState], Shown]
    presses: Mapping[str, Request] = MappingProxyType({})
    number: SettableNumber | None = None


def rows_of(state: ControlState, control: ControlClient) -> tuple[list[MachineRow], ...]:
    """Return all operable parts: the machine, the drivers' fault lines, inputs, switches."""

    def either(request: Callable[..., ControlState], name: str, on: str, off: str) -> dict[str, Request]:
        return {on: partial(request, **{name: True}), off: partial(request, **{name: False})}

    stop = either(control.emergency_stop, "pressed", _STOP, "Pull out")
    supply = SettableNumber(control.supply, "V", state.supply_v)
    temperature = SettableNumber(control.temperature, "°C", state.temperature_degc)
    lines, inputs, switches = list[MachineRow](), list[MachineRow](), list[MachineRow]()
    for joint in state.protect:
        hold = either(partial(control.protect, joint), "held", "Hold low", "Release")
        lines.append(MachineRow(joint, f"Protect of {joint}", partial(_protect, joint), hold))
    for name in state.inputs:
        put = either(partial(control.set_input, name), "on", "On", "Off")
        inputs.append(MachineRow(name, f"input {name}", partial(_input, name), put))
    for joint, name in ((joint, name) for joint, names in state.switches.items() for name in names):
        stick = {text: partial(control.switch, joint, name, stuck) for text, stuck in _STUCK.items()}
        switch = f"{joint} {name}"
        switches.append(MachineRow(switch, f"switch {switch}", partial(_switch, joint, name), stick))
    machine = [
        MachineRow("emergency stop button", "", _estop, stop),
        MachineRow("motor supply", "motor supply", lambda now: (f"{now.supply_v:g} V", ""), number=supply),
        MachineRow("board's temperature", "", lambda now: (f"{now.temperature_degc:g} °C", ""), number=temperature),
    ]
    return machine, lines, inputs, switches


def _estop(now: ControlState) -> Shown:
    return ("pressed", "bad") if now.estop else ("pulled out", "good")


def _protect(joint: str, now: ControlState) -> Shown:
    pin = now.protect[joint]
    if pin.held:
        return "held low", "bad"
    return ("low: the driver is off", "bad") if pin.low else ("high", "good")


def _input(name: str, now: ControlState) -> Shown:
    return ("on", "good") if now.inputs[name] else ("off", "")


def _switch(joint: str, name: str, now: ControlState) -> Shown:
    switch = now.switches[joint][name]
    text = "closed" if switch.closed else "open"
    return (f"sticks {text}", "warn") if switch.stuck else (text, "")


class HardwareTab:
    """Buttons for all operable parts, each with its present state."""

    def __init__(self, visitor: Visitor, control: ControlClient) -> None:
        self._visitor, self._control = visitor, control
        note("This machine is emulated: here you are its surroundings, and nothing real moves.")
        self._lost = note("", "bad")
        self._lost.set_visibility(False)
        self._body = ui.element("div").classes("stack")
        self._chips: list[tuple[MachineRow, Chip]] = []
        self._timer = ui.timer(_EVERY_S, lambda: self._ask(control.state), active=False)

    def refresh(self, _snapshot: Snapshot) -> None:
        """Do nothing: the control port is polled for the hardware only while the tab is open."""

    def open(self, now: bool) -> None:
        """Poll the machine while the tab is shown."""
        self._timer.active = now

    async def _do(self, name: str, request: Request, *, stops: bool) -> None:
        """Send a request of the operator; requests that stop the machine are always accepted."""
        visitor = self._visitor

        def allow() -> None:
            visitor.service.operator.require(visitor.tab)
            if visitor.service.snapshot.connected and not stops:
                visitor.service.require_shown(name, SHOWN.get())

        if visitor.attempt(allow):
            await self._ask(request)

    async def _ask(self, request: Request) -> None:
        try:
            state = await asyncio.to_thread(request)
        except InputError as error:
            self._visitor.tell(operator_message(error))
            return
        except BusError as error:
            self._lost.set_text(f"The emulated machine does not answer: {operator_message(error)}.")
            self._lost.set_visibility(True)
            return
        self._lost.set_visibility(False)
        if not self._chips:
            self._build(state)
        for row, chip in self._chips:
            chip.show(*row.shown(state))

    def _build(self, state: ControlState) -> None:
        board = self._visitor.service.robot.board
        pins = "fault lines at the board" if board.profile.switched else "Protect pins"
        drivers = f"Drivers ({board.driver_profile or board.profile.chip.name}): {pins}"
        tables = (
            ("", "the machine", "is"),
            (drivers, "joint", "line"),
            ("Inputs", "input", "is"),
            ("Switches", "switch", "is"),
        )
        with self._body:
            for (title, *columns), rows in zip(tables, rows_of(state, self._control), strict=True):
                if title and rows:
                    heading(title)
                if rows:
                    with table(*columns, ""):
                        for row in rows:
                            self._row(row)

    def _row(self, row: MachineRow) -> None:
        with ui.element("tr"):
            cell(row.text)
            with cell():
                self._chips.append((row, Chip()))
            with cell(), line("tight"):
                for text, request in row.presses.items():
                    self._button(text, request, row.of)
                if row.number is not None:
                    self._number(row.text, row.number)

    def _number(self, text: str, number: SettableNumber) -> None:
        field = NumberField(value=number.value, suffix=number.unit).props("outlined dense").classes("w-narrow")
        field.props["aria-label"] = text

        def ask() -> ControlState:
            if field.value is None:
                raise InputError(f"{text}: there is no number")
            return number.ask(float(field.value))

        self._button("Set", ask, text)

    def _button(self, text: str, request: Request, of: str) -> None:
        do = partial(self._do, f"{of} {text}".strip(), request, stops=text == _STOP)
        plain(text, do, label=f"{of}: {text}" if of else "").classes("small-button")
