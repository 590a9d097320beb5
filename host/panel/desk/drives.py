"""Commands that move nothing: power, faults, digital outputs, settings."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.host.operate.inputs_outputs import no_such_output, switch_output
from steptwin.host.operate.recovering import reset
from steptwin.host.panel.desk.requests import Command, Work
from steptwin.host.panel.desk.settings import check_settings, write_settings
from steptwin.host.panel.desk.state import DeskState


@dataclass(frozen=True, slots=True)
class Enable(Command):
    """Switch every drive on; they hold their positions."""

    title = "switch on"

    def perform(self, work: Work) -> str:
        """Switch the drives on."""
        with work.session.charge("switch on", needs=()) as charge:
            charge.enable()
        return ""


@dataclass(frozen=True, slots=True)
class Disable(Command):
    """Switch every drive off."""

    title = "switch off"
    needs_drives = False

    def perform(self, work: Work) -> str:
        """Switch the drives off, unless they move."""
        with work.session.alone("switch off"):
            work.session.machine.disable()
        return ""


@dataclass(frozen=True, slots=True)
class ResetFaults(Command):
    """Reset the drives' faults, and end an emergency stop; the drives are off afterwards."""

    title = "reset"
    needs_drives = False

    def perform(self, work: Work) -> str:
        """Reset the faults that the operator has seen."""
        reset(work.session, age_s=time.monotonic() - work.seen_s)
        return "faults are reset, the drives are off"


@dataclass(frozen=True, slots=True)
class SwitchOutput(Command):
    """Switch a digital output by its name in the robot's file."""

    needs_drives = False
    output: str
    on: bool

    @property
    def title(self) -> str:
        """Its name, with the output."""
        return f"switch {self.output}"

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the output exists."""
        outputs = list(state.robot.outputs)
        if self.output not in outputs:
            raise no_such_output(state.robot.name, self.output, outputs)

    def perform(self, work: Work) -> str:
        """Switch the output."""
        switch_output(work.session, self.output, on=self.on)
        return f"{self.output}: {'on' if self.on else 'off'}"


@dataclass(frozen=True, slots=True)
class WriteSettings(Command):
    """Write settings: values by `Setting.key`."""

    title = "settings"
    needs_drives = False
    changes_settings = True
    values: Mapping[str, float]

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the settings exist and may have these values."""
        check_settings(state.limits, self.values)

    def perform(self, work: Work) -> str:
        """Write the settings to the board, and change the limits."""
        write_settings(work.session, work.state.limits, self.values)
        return ", ".join(f"{key} = {value:g}" for key, value in self.values.items())
