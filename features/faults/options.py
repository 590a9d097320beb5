"""The scenario of an emulated machine: what goes wrong with it on purpose."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from reprlib import repr as short
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.features.faults.kinds.harm import Harm
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

    A path stands for the scenario in that file, and harms for one that begins with them at power-up.
    """

    scenario: "Scenario | Sequence[Harm] | Path | str | None" = field(default=None, metadata={SPELLING: _FAULTS})

    def over(self, other: "FaultOptions") -> "FaultOptions":
        """Return other options, with those of these that are no defaults in place of theirs."""
        return other if self.scenario is None else self

    def read_for(self, robot: "Robot", folder: Path) -> "FaultOptions":
        """Return the same with the scenario read; the file's relative path begins at a folder."""
        given = self.scenario
        placed = replace(self, scenario=folder / given if isinstance(given, str) else given)
        return replace(self, scenario=placed.scenario_for(robot))

    def scenario_for(self, robot: "Robot") -> "Scenario | None":
        """Return the scenario, read for a robot if it is in a file.

        Raises:
            InputError: something is wrong in the file, or there is no scenario in what is given.
        """
        from steptwin.features.faults.kinds.harm import Harm
        from steptwin.features.faults.scenario import Scenario, read_scenario

        given: object = self.scenario
        if given is None or isinstance(given, Scenario):
            return given
        if isinstance(given, Path | str):
            return read_scenario(given, robot)
        if not isinstance(given, Iterable) or not all(isinstance(each, Harm) for each in given):
            raise InputError(f"scenario: {short(given)} is not Scenario or Sequence[Harm] or Path or str or None")
        return Scenario.from_power_up(given)
