"""Option of an emulated machine: the drive whose objects its boards show."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from steptwin.features.personalities.file import SUFFIX
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

_PERSONALITY: Final = Spelling(
    key="personality",
    value="NAME|FILE",
    example='"epos4"',
    says="Show the objects of another drive on the bus: of epos4, nanotec-cl3 or cia402-generic, or those of a file"
    " (docs/personalities.md).",
    served=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonalityOptions:
    """Name or file of the personality of a machine's boards; None for that of the robot's file."""

    personality: str | None = field(default=None, metadata={SPELLING: _PERSONALITY})

    def placed(self, folder: Path) -> "PersonalityOptions":
        """Return the options with a relative path resolved in a folder."""
        if self.personality is None or not self.personality.endswith(SUFFIX):
            return self
        return PersonalityOptions(personality=str(folder / self.personality))

    def over(self, other: "PersonalityOptions") -> "PersonalityOptions":
        """Return `other`, with this object's personality in place of its own if there is one."""
        return other if self.personality is None else self
