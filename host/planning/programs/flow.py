"""Times of blended steps of a program, and of outputs that change on their path."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.planning.drives import DriveAnswer
from steptwin.host.planning.motion import Motion, OutputChange
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.whole import FlowingSteps
from steptwin.host.planning.programs.paces import OnTheWay

_WHOLE_MS: Final = 1e-6
"""Tolerance in ms for a time after a whole millisecond."""


BranchesOnWay = tuple[str, tuple[tuple[float, str], ...]]
"""Branch of the arm at the start of a path, and times and names of its changes."""


@dataclass(frozen=True, slots=True)
class LegTime:
    """Times of a blended step.

    Attributes:
        from_s: time in the sequence when it begins, at the corner before it.
        until_s: time when it ends.
        motion: its part of the motion.
        branches: branches of the arm; empty for a step without a path of the tool.
        passes_mm: distance from the corner at its end; None at the end of the motion.
        stops: True if it stops at its end by choice, since that is faster.
        switched: outputs that change on its path.
        drives: margins of the drives in the whole motion that ends with it; None elsewhere.
    """

    from_s: float
    until_s: float
    motion: Motion
    branches: BranchesOnWay = ("", ())
    passes_mm: float | None = None
    stops: bool = False
    switched: tuple[OutputChange, ...] = ()
    drives: DriveAnswer | None = None

    @property
    def notes(self) -> tuple[str | OutputChange, ...]:
        """Changes of outputs, and the treatment of the corner at the step's end as text."""
        notes: list[str | OutputChange] = [*self.switched]
        if self.stops:
            notes.append("stops at its end, which is faster than rounding the corner")
        elif self.passes_mm is not None:
            notes.append(f"passes the corner at {self.passes_mm:.3f} mm")
        return tuple(notes)


def switching_words(change: OutputChange) -> str:
    """Return a change of an output as text."""
    return f"{change.output} {'on' if change.on else 'off'} at {change.from_s:.3f} s"


LATE_S: Final = 0.01
"""Largest delay of an output's change: the start of a record is detected a few milliseconds later."""


def switch_on_way(
    composer: Composer, outputs: Sequence[OnTheWay], times_s: Sequence[float], begins_s: float
) -> tuple[OutputChange, ...]:
    """Change outputs during a motion that begins at a time of the composer's sequence; return the changes.

    `times_s` are the motion's times at the place of each. Raises InputError for a change before the motion.
    """
    changes = []
    for each, there_s in zip(outputs, times_s, strict=True):
        own_s = there_s - each.ahead_s
        if own_s < 0:
            raise InputError(
                f"outputs.{each.output}: ahead_s: {each.ahead_s:g} s is {-own_s:.3f} s before the motion begins"
            )
        from_s = ceil(1000 * (begins_s + own_s) - _WHOLE_MS) / 1000
        changes.append(OutputChange(each.output, each.on, from_s, from_s + LATE_S, on_the_way=True))
    composer.add_output_changes(changes)
    return tuple(changes)


def check_none_gathered(legs: FlowingSteps | None, what: str) -> None:
    """Raise InputError if a step is blended with one that begins at rest."""
    if legs is not None and legs.is_open:
        raise InputError(f"{what} begins at rest, but the step before flows on: leave its blend_mm out")
