"""Options of commands that take a file of G-code."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from steptwin.features.gcode.dialects import SUFFIXES, Dialect
from steptwin.host.cli.options import option
from steptwin.host.common.errors import InputError


@dataclass(frozen=True, slots=True)
class GcodeOptions:
    """The dialect of a file of G-code."""

    dialect: Dialect | None = option(
        "NAME",
        "Controller for which a file of G-code is written: klipper, marlin, grbl, grblhal or linuxcnc. Without it, only"
        " words that are the same for all of them are read (docs/programs.md).",
    )

    def keys(self, file: str) -> Mapping[str, str]:
        """Return the step's key `dialect`; raise InputError if it is given for another file."""
        if self.dialect is None:
            return {}
        if Path(file).suffix.lower() not in SUFFIXES:
            raise InputError(f"--dialect: is for files of G-code, {', '.join(SUFFIXES)}, not for {file}")
        return {"dialect": self.dialect.value}
