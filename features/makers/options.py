"""The part of `steptwin new` that reads the configuration of a motion controller."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from steptwin.host.cli.asking import ask, on_terminal
from steptwin.host.cli.options import option
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.robots.new_file import NewRobot

KIND = "cartesian"


@dataclass(frozen=True, slots=True)
class ConfigurationOptions:
    """Which controller a configuration given by --from is of."""

    controller: str | None = option(
        "NAME", "With --from FILE: klipper, grbl, marlin or linuxcnc, if the file does not show it."
    )

    def robot(self, name: str, kind: str | None, given: dict[str, str], original: str | None) -> "NewRobot | None":
        """Return the robot of a configuration; None if --from names no file.

        Raises:
            InputError: the file is no configuration that is known, or something in it is wrong or missing.
        """
        if original is None or not Path(original).is_file():
            if self.controller is not None:
                raise InputError(f"--controller {self.controller}: is for a configuration: give --from FILE")
            return None
        if kind not in (None, KIND):
            raise InputError(f"--kind {kind}: a controller's configuration makes a {KIND}: leave --kind out")
        from steptwin.features.makers.configurations.known import CONTROLLERS, read_configuration
        from steptwin.features.makers.robot_file import missing_figures, robot_of

        if self.controller is not None and self.controller not in CONTROLLERS:
            raise unknown("--controller", self.controller, CONTROLLERS)
        with prefixed(f"{original}: "):
            found = read_configuration(Path(original), self.controller)
            if on_terminal():
                for key, what in missing_figures(found, given).items():

                    def check(text: str, key: str = key) -> None:
                        missing_figures(found, {**given, key: text})

                    given[key] = ask(f"{key}, {what}", None, check)
            return robot_of(name, found, given, original)
