"""The Outputs tab: the digital outputs, which can be switched, and the digital inputs."""

from functools import partial

from nicegui import ui

from steptwin.host.panel.desk import Snapshot, SwitchOutput
from steptwin.host.panel.page.elements import Chip, cell, heading, line, note, plain, table
from steptwin.host.panel.page.visitor import Visitor


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
                        with cell():
                            ui.label(name)
                        with cell():
                            self._inputs[name] = Chip("off")
        else:
            note(f"{robot.name} has no inputs.")

    def refresh(self, snapshot: Snapshot) -> None:
        """Show what is on."""
        for chips, levels in ((self._outputs, snapshot.outputs), (self._inputs, snapshot.inputs)):
            for name, chip in chips.items():
                on = levels.get(name)
                chip.show("unknown" if on is None else "on" if on else "off", "good" if on else "")


def _output_row(visitor: Visitor, name: str) -> Chip:
    with ui.element("tr"):
        with cell():
            ui.label(name)
        with cell():
            chip = Chip("unknown")
        with cell(), line("tight"):
            for text, on in (("on", True), ("off", False)):
                button = plain(text, partial(_switch, visitor, name, on=on))
                button.props["aria-label"] = f"switch {name} {text}"
    return chip


def _switch(visitor: Visitor, name: str, *, on: bool) -> None:
    visitor.ask(SwitchOutput(output=name, on=on))
