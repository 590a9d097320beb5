"""Trajectory time of the axes that interpolate together: it runs at full rate, is halted and set going again.

The axes of the group advance along their segments by the same rate, which ramps linearly between full and 0. So they
slow down, rest and speed up on the planned path, in step with each other. While the rate r changes from 1 to 0 within
T, an axis with the planned velocity v and acceleration a accelerates with

    a r^2 + v dr/dt,    |v dr/dt| <= max|v| / T,

the maximum over the T/2 of trajectory time that the ramp covers: T = max|v| / D lets no axis decelerate by more than
its D beyond what the plan asks for. A ramp that begins at another rate, or ends at one, has the same slope.
"""

from steptwin.controller import kernel as k
from steptwin.controller.kernel import Cells

HALTED_Q16 = 0


class GroupTime:
    """Which axes halt together, which of them ask for it, and the ramp of their common rate."""

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        """The kernel's GROUP_FIELDS."""
        self.cells[k.RATE_TO_Q16] = k.FULL_RATE_Q16
        self.members: set[int] = set()
        """The axes that run segments in the group's time."""
        self.rest_tick: int | None = None
        """From when on time stands still, if the rate is 0 or on its way there."""
        self._holding: set[int] = set()

    def hold(self, axis: int, *, hold: bool) -> None:
        """Let an axis ask for a halt of the group, or take that back."""
        (self._holding.add if hold else self._holding.discard)(axis)

    @property
    def halt_wanted(self) -> bool:
        """Whether there is a group and an axis that holds it."""
        return bool(self.members and self._holding)

    @property
    def halted(self) -> bool:
        """Whether the rate is 0 or on its way there."""
        return self.rest_tick is not None

    @property
    def must_ramp(self) -> bool:
        """Whether the rate is not on its way to where it is wanted; asked after every frame."""
        return self.halted != self.halt_wanted

    def rate_q16(self, tick: int) -> int:
        """The rate at the start of a tick."""
        since_ticks = tick - int(self.cells[k.RAMP_TICK])
        ramp_ticks = int(self.cells[k.RAMP_TICKS])
        from_q16, to_q16 = int(self.cells[k.RATE_FROM_Q16]), int(self.cells[k.RATE_TO_Q16])
        if since_ticks >= ramp_ticks:
            return to_q16
        return from_q16 + (to_q16 - from_q16) * since_ticks // ramp_ticks

    def resting(self, tick: int) -> bool:
        """Whether trajectory time stands still from this tick on."""
        return self.rest_tick is not None and self.rest_tick <= tick

    def ramp(self, tick: int, full_ramp_ticks: int) -> None:
        """From `tick` on go to the rate that is wanted, with the slope of a ramp that takes so long from full to 0."""
        rate_q16 = self.rate_q16(tick)
        target_q16 = HALTED_Q16 if self.halt_wanted else k.FULL_RATE_Q16
        self.cells[k.RATE_FROM_Q16] = rate_q16
        self.cells[k.RATE_TO_Q16] = target_q16
        self.cells[k.RAMP_TICK] = tick
        ramp_ticks = -(-full_ramp_ticks * abs(target_q16 - rate_q16) // k.FULL_RATE_Q16)
        self.cells[k.RAMP_TICKS] = ramp_ticks
        self.rest_tick = tick + ramp_ticks if target_q16 == HALTED_Q16 else None
