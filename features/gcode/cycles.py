"""Drilling cycles of G-code as the moves along z of which they are made."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from steptwin.host.common.errors import InputError

CYCLES: Final = ("G73", "G81", "G82", "G83", "G85", "G89")
PECKING: Final = ("G73", "G83")
DWELLING: Final = ("G82", "G89")
_FEEDING_OUT: Final = ("G85", "G89")
_FREE_MM: Final = 0.254
"""Distance by which a chip is broken, and before which a rapid move into the hole ends, as in LinuxCNC: 0.01 inch."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """A part of a cycle: a move to a height, rapid or at the feed, or a dwell at the height."""

    height_mm: float
    is_rapid: bool = False
    dwell_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Drilling:
    """A hole.

    Attributes:
        code: the cycle's word.
        from_mm: height to which the tool comes rapidly, R.
        to_mm: height of the bottom, Z.
        clear_mm: height at which the cycle ends.
        peck_mm: depth after which chips are broken or taken out, Q.
        dwell_s: duration at the bottom, P.
    """

    code: str
    from_mm: float
    to_mm: float
    clear_mm: float
    peck_mm: float = 0.0
    dwell_s: float = 0.0

    def __post_init__(self) -> None:
        if self.to_mm > self.from_mm:
            raise InputError(f"{self.code}: R is below Z, the bottom")
        if self.code in PECKING and not self.peck_mm > 0:
            raise InputError(f"{self.code}: Q is missing or not above 0, the depth of a peck")

    def strokes(self) -> Iterator[Stroke]:
        """Yield the parts from R on, after which the tool is at the height to clear."""
        depth = self.from_mm
        while self.code in PECKING and depth - self.peck_mm > self.to_mm:
            depth -= self.peck_mm
            yield Stroke(depth)
            if self.code == "G73":
                yield Stroke(depth + _FREE_MM, is_rapid=True)
            else:
                yield Stroke(self.from_mm, is_rapid=True)
                yield Stroke(min(depth + _FREE_MM, self.from_mm), is_rapid=True)
        yield Stroke(self.to_mm)
        if self.dwell_s:
            yield Stroke(self.to_mm, dwell_s=self.dwell_s)
        if self.code in _FEEDING_OUT:
            yield Stroke(self.from_mm)
        yield Stroke(self.clear_mm, is_rapid=True)
