"""The homing methods of CiA 402-2 that need no index pulse, as data for the drive and for the host.

Methods 17 to 30 are methods 1 to 14 without the pulse: home is where a switch changes while the axis crosses its edge
in one direction. The home switch of methods 19 and 20 is closed from its edge to the positive end of travel, that of
methods 21 and 22 from its edge to the negative end. The home switch of methods 23 to 30 is closed over a stretch of the
travel and has two edges. Methods 31, 32 and 36 are reserved; 33 and 34 need the index pulse.
"""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol.cia402 import DigitalInput

POSITIVE, NEGATIVE = 1, -1

NO_HOMING: Final = 0
"""Homing method (6098h) 0: no homing. It sets no position."""
HOME_HERE: Final = 37
"""Homing method 37: the present position becomes home."""
HOME_HERE_OBSOLETE: Final = 35
"""Old number of method 37."""


@dataclass(frozen=True, slots=True)
class HomingMethod:
    """The switch edge that defines home, and how the axis searches for it."""

    switch: DigitalInput
    edge_direction: int
    """Direction in which the axis crosses the edge."""
    closes: bool
    """True if the switch closes when the axis crosses the edge in `edge_direction`, False if it opens."""
    search_direction: int
    """Direction of the first search, if the switch is open at the start."""
    turns: bool = False
    """True if the search reverses at the limit switch ahead. The method then needs that limit switch and a home switch
    with two edges."""

    @property
    def at_lower_edge(self) -> bool:
        """True if home is the lower edge of the range in which the switch is closed, False if the upper edge."""
        return (self.edge_direction == POSITIVE) is self.closes


_NEGATIVE_LIMIT, _POSITIVE_LIMIT, _HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME

HOMING_METHODS: Final[dict[int, HomingMethod | None]] = {
    17: HomingMethod(_NEGATIVE_LIMIT, POSITIVE, closes=False, search_direction=NEGATIVE),
    18: HomingMethod(_POSITIVE_LIMIT, NEGATIVE, closes=False, search_direction=POSITIVE),
    19: HomingMethod(_HOME, NEGATIVE, closes=False, search_direction=POSITIVE),
    20: HomingMethod(_HOME, POSITIVE, closes=True, search_direction=POSITIVE),
    21: HomingMethod(_HOME, POSITIVE, closes=False, search_direction=NEGATIVE),
    22: HomingMethod(_HOME, NEGATIVE, closes=True, search_direction=NEGATIVE),
    23: HomingMethod(_HOME, NEGATIVE, closes=False, search_direction=POSITIVE, turns=True),
    24: HomingMethod(_HOME, POSITIVE, closes=True, search_direction=POSITIVE, turns=True),
    25: HomingMethod(_HOME, NEGATIVE, closes=True, search_direction=POSITIVE, turns=True),
    26: HomingMethod(_HOME, POSITIVE, closes=False, search_direction=POSITIVE, turns=True),
    27: HomingMethod(_HOME, POSITIVE, closes=False, search_direction=NEGATIVE, turns=True),
    28: HomingMethod(_HOME, NEGATIVE, closes=True, search_direction=NEGATIVE, turns=True),
    29: HomingMethod(_HOME, POSITIVE, closes=True, search_direction=NEGATIVE, turns=True),
    30: HomingMethod(_HOME, NEGATIVE, closes=False, search_direction=NEGATIVE, turns=True),
    HOME_HERE_OBSOLETE: None,
    HOME_HERE: None,
}
"""Methods by their number in 6098h; None: the present position becomes home."""
