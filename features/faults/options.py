"""Options of an emulated machine: its scenario of faults."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from reprlib import repr as short
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.features.faults.fault import Fault
    from steptwin.features.faults.scenario import Scenario
    from steptwin.host.robots.robot import Robot

_FAULTS: Final = Spelling(
    key="faults",
    value="FILE",
    example='"faults.toml"',
    says="Let the faults of a scenario happen: TOML with [[fault]] (docs/faults.md).",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultOptions:
    """The scenario of an emulated machine; its times count from the first motion that a SYNC starts, or from power-up.

    A path names the scenario's file; a list of faults begins at power-up.
    """

    scenario: "Scenario | Sequence[Fault] | Path | str | None" = field(default=None, metadata={SPELLING: _FAULTS})

    def over(self, other: "FaultOptions") -> "FaultOptions":
        """Return `other`, with this object's scenario in place of its own if there is one."""
        return other if self.scenario is None else self

    def read_for(self, robot: "Robot", folder: Path) -> "FaultOptions":
        """Return the options with the scenario read; a relative path begins at a folder."""
        given = self.scenario
        placed = replace(self, scenario=folder / given if isinstance(given, str) else given)
        return replace(self, scenario=placed.scenario_for(robot))

    def scenario_for(self, robot: "Robot") -> "Scenario | None":
        """Return the scenario, read for a robot if it is a file.

        Raises:
            InputError: the file is invalid, or the options have no scenario.
        """
        from steptwin.features.faults.fault import Fault
        from steptwin.features.faults.scenario import Scenario, read_scenario

        given: object = self.scenario
        if given is None or isinstance(given, Scenario):
            return given
        if isinstance(given, Path | str):
            return read_scenario(given, robot)
        if not isinstance(given, Iterable) or not all(isinstance(each, Fault) for each in given):
            raise InputError(f"scenario: {short(given)} is not Scenario or Sequence[Fault] or Path or str or None")
        return Scenario.from_power_up(given)
