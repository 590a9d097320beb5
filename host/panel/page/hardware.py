"""The Hardware tab: the emulated machine around the board, which only a served board has.

Press its emergency stop, lower its supply, trip a driver's Protect pin, let a switch stick, and see what becomes of it.
"""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Final

from nicegui import ui

from steptwin.host.client.control_client import ControlClient, ControlState, SwitchState
from steptwin.host.common.choices import Stuck
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.panel.desk.state import Snapshot
from steptwin.host.panel.desk.words import told
from steptwin.host.panel.page.elements import Chip, NumberField, Tone, cell, heading, line, note, plain, table
from steptwin.host.panel.page.visitor import SHOWN, Visitor

_EVERY_S: Final = 1.0
Request = Callable[[], ControlState]


class HardwareTab:
    """Buttons for everything that can be operated, each with its present state."""

    def __init__(self, visitor: Visitor, control: ControlClient) -> None:
        self._visitor, self._control = visitor, control
        note("This machine is emulated: here you are its surroundings, and nothing real moves.")
        self._lost = note("", "bad")
        self._lost.set_visibility(False)
        self._body = ui.element("div").classes("stack")
        self._chips: dict[str, Chip] = {}
        self._timer = ui.timer(_EVERY_S, self._poll, active=False)

    def refresh(self, _snapshot: Snapshot) -> None:
        """The control port is asked for the state of the hardware, and only while the tab is open."""

    def open(self, now: bool) -> None:
        """Follow the machine while the tab is shown."""
        self._timer.active = now

    async def _poll(self) -> None:
        await self._ask(self._control.state)

    async def _do(self, name: str, request: Request, *, stops: bool) -> None:
        """Let the operator change something; what stops the machine never comes too late."""
        visitor = self._visitor

        def allow() -> None:
            visitor.desk.operators.require(visitor.tab)
            if visitor.desk.snapshot.connected and not stops:
                visitor.desk.require_shown(name, SHOWN.get())

        if visitor.attempt(allow):
            await self._ask(request)

    async def _ask(self, request: Request) -> None:
        try:
            state = await asyncio.to_thread(request)
        except InputError as error:
            self._visitor.tell(told(error))
            return
        except BusError as error:
            self._lost.set_text(f"The emulated machine does not answer: {told(error)}.")
            self._lost.set_visibility(True)
            return
        self._lost.set_visibility(False)
        self._show(state)

    # --- what is shown

    def _show(self, state: ControlState) -> None:
        if not self._chips:
            with self._body:
                self._build(state)
        self._chips["estop"].show(*_pressed(state.estop))
        self._chips["supply"].show(f"{state.supply_v:g} V")
        self._chips["temperature"].show(f"{state.temperature_degc:g} °C")
        for joint, pin in state.protect.items():
            self._chips[f"protect {joint}"].show(*_protect(low=pin.low, held=pin.held))
        for name, on in state.inputs.items():
            self._chips[f"input {name}"].show("on" if on else "off", "good" if on else "")
        for joint, switches in state.switches.items():
            for name, switch in switches.items():
                self._chips[f"switch {joint} {name}"].show(*_switch(switch))

    def _build(self, state: ControlState) -> None:
        control = self._control
        with table([("the machine", ""), ("is", ""), ("", "")]):
            with self._row("estop", "emergency stop button"):
                self._button("Press", partial(control.emergency_stop, pressed=True), stops=True)
                self._button("Pull out", partial(control.emergency_stop, pressed=False))
            self._number_row("supply", "motor supply", "V", state.supply_v, control.supply)
            self._number_row("temperature", "board's temperature", "°C", state.temperature_degc, control.temperature)
        heading("Drivers' Protect pins")
        with table([("joint", ""), ("pin", ""), ("", "")]):
            for joint in state.protect:
                with self._row(f"protect {joint}", joint):
                    self._button("Hold low", partial(control.protect, joint, held=True), f"Protect of {joint}")
                    self._button("Release", partial(control.protect, joint, held=False), f"Protect of {joint}")
        if state.inputs:
            heading("Inputs")
            with table([("input", ""), ("is", ""), ("", "")]):
                for name in state.inputs:
                    with self._row(f"input {name}", name):
                        self._button("On", partial(control.set_input, name, on=True), f"input {name}")
                        self._button("Off", partial(control.set_input, name, on=False), f"input {name}")
        heading("Switches")
        with table([("switch", ""), ("is", ""), ("", "")]):
            for joint, switches in state.switches.items():
                for name in switches:
                    with self._row(f"switch {joint} {name}", f"{joint} {name}"):
                        for text, stuck in (
                            ("Free", Stuck.FREE),
                            ("Stick closed", Stuck.CLOSED),
                            ("Stick open", Stuck.OPEN),
                        ):
                            self._button(text, partial(control.switch, joint, name, stuck), f"switch {joint} {name}")

    def _row(self, key: str, text: str) -> ui.element:
        """Make a row with a text and the present state; return the place for its buttons."""
        with ui.element("tr"):
            cell(text)
            with cell():
                self._chips[key] = Chip()
            with cell():
                return line("tight")

    def _number_row(self, key: str, text: str, unit: str, value: float, ask: Callable[[float], ControlState]) -> None:
        with self._row(key, text):
            field = NumberField(value=value, suffix=unit).props("outlined dense").classes("w-narrow")
            field.props["aria-label"] = text
            self._button("Set", lambda: ask(_given(field, text)), text)

    def _button(self, text: str, request: Request, of: str = "", *, stops: bool = False) -> None:
        do = partial(self._do, f"{of} {text}".strip(), request, stops=stops)
        plain(text, do, label=f"{of}: {text}" if of else "").classes("small-button")


def _given(field: NumberField, text: str) -> float:
    """Return a field's number; raise InputError without one."""
    if field.value is None:
        raise InputError(f"{text}: there is no number")
    return float(field.value)


def _pressed(pressed: bool) -> tuple[str, Tone]:
    return ("pressed", "bad") if pressed else ("pulled out", "good")


def _protect(*, low: bool, held: bool) -> tuple[str, Tone]:
    if held:
        return "held low", "bad"
    return ("low: the driver is off", "bad") if low else ("high", "good")


def _switch(switch: SwitchState) -> tuple[str, Tone]:
    text = "closed" if switch.closed else "open"
    return (f"sticks {text}", "warn") if switch.stuck else (text, "")
