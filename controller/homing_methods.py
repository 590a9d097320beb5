"""The homing methods of CiA 402-2 that need no index pulse, as data.

Methods 17 to 30 are methods 1 to 14 without the pulse: home is where a switch changes while the axis crosses its edge
in one direction. The home switch of 19 and 20 is closed from the edge to the positive end of travel, that of 21 and 22
to the negative end; that of 23 to 30 is closed over a stretch of the travel and has two edges.
"""

from dataclasses import dataclass

from steptwin.protocol.cia402 import HOME_HERE, HOME_HERE_OBSOLETE, DigitalInput

POSITIVE, NEGATIVE = 1, -1


@dataclass(frozen=True, slots=True)
class HomingMethod:
    """Which edge of which switch is home, and how to get there."""

    switch: DigitalInput
    edge_direction: int
    """In which direction the axis crosses the edge that counts."""
    closes: bool
    """Whether the switch closes there; else it opens."""
    search_direction: int
    """Where the axis looks for the switch first if it is open at the start."""
    turns: bool = False
    """Whether the search turns round at a limit switch."""


_NEGATIVE_LIMIT, _POSITIVE_LIMIT, _HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME

METHODS: dict[int, HomingMethod | None] = {
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
"""By the number in 0x6098; None: home is where the axis stands."""
