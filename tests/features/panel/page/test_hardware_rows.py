"""The Hardware tab's rows: what is shown of each thing of the emulated machine, and what its buttons ask for."""

from types import SimpleNamespace
from typing import Any

from steptwin.features.panel.page.hardware import rows_of
from steptwin.host.common.choices import Stuck

STATE: Any = SimpleNamespace(
    estop=True,
    supply_v=24.0,
    temperature_degc=25.5,
    protect={"a": SimpleNamespace(low=True, held=False), "b": SimpleNamespace(low=True, held=True)},
    inputs={"gripper": True},
    switches={"a": {"-": SimpleNamespace(closed=True, stuck=True), "+": SimpleNamespace(closed=False, stuck=False)}},
)


class Control:
    """A control port that notes what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *args, **named: self.asked.append((name, *args, named))


def test_every_thing_has_its_state_and_its_buttons() -> None:
    control: Any = Control()
    machine, lines, inputs, switches = rows_of(STATE, control)
    assert [(row.text, row.shown(STATE), list(row.presses)) for row in (*machine, *lines, *inputs, *switches)] == [
        ("emergency stop button", ("pressed", "bad"), ["Press", "Pull out"]),
        ("motor supply", ("24 V", ""), []),
        ("board's temperature", ("25.5 °C", ""), []),
        ("a", ("low: the driver is off", "bad"), ["Hold low", "Release"]),
        ("b", ("held low", "bad"), ["Hold low", "Release"]),
        ("gripper", ("on", "good"), ["On", "Off"]),
        ("a -", ("sticks closed", "warn"), ["Free", "Stick closed", "Stick open"]),
        ("a +", ("open", ""), ["Free", "Stick closed", "Stick open"]),
    ]
    for row in (machine[0], lines[1], inputs[0], switches[1]):
        for request in row.presses.values():
            request()
    for row in machine[1:]:
        assert row.number is not None
        row.number.ask(row.number.value + 1.0)
    assert control.asked == [
        ("emergency_stop", {"pressed": True}),
        ("emergency_stop", {"pressed": False}),
        ("protect", "b", {"held": True}),
        ("protect", "b", {"held": False}),
        ("set_input", "gripper", {"on": True}),
        ("set_input", "gripper", {"on": False}),
        *(("switch", "a", "+", stuck, {}) for stuck in (Stuck.FREE, Stuck.CLOSED, Stuck.OPEN)),
        ("supply", 25.0, {}),
        ("temperature", 26.5, {}),
    ]
