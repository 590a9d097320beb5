"""Trajectory time of the axes that interpolate together: run at full rate, slower or faster, halt and resume.

The axes of the group advance along their segments at the same rate, which ramps linearly to the rate wanted, or to 0
for a halt. So they slow down, rest and speed up on the planned path, in step with each other. While the rate r changes
from 1 to 0 within T, an axis with the planned velocity v and acceleration a accelerates with

    a r^2 + v dr/dt,    |v dr/dt| <= max|v| / T,

where the maximum is over the T/2 of trajectory time that the ramp covers. So with T = max|v| / D no axis decelerates
by more than its D beyond the plan. A ramp between other rates has the same slope.

The rate wanted is 1 when the first axis of a group starts: each motion begins as planned.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.kernel import Cells

HALTED_Q16: Final = 0


class RateRamp(NamedTuple):
    """A linear change of the rate: its first tick, the rates at both ends, and its number of ticks, 0 for a jump."""

    tick: int
    from_q16: int
    to_q16: int
    ticks: int


class GroupTime:
    """The axes that halt together, the axes that request a halt, the rate wanted, and the ramp of the common rate."""

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        """The kernel's GROUP_FIELDS."""
        self.cells[k.RATE_TO_Q16] = k.FULL_RATE_Q16
        self._heading_for_q16 = k.FULL_RATE_Q16
        """The rate at the end of the present ramp, as in the cells: it is asked for with every frame."""
        self.wanted_q16 = k.FULL_RATE_Q16
        """Rate at which the members run while no axis requests a halt."""
        self.on_ramp: Callable[[RateRamp], None] = lambda _: None
        """Told of every ramp of the members when it begins."""
        self.members: set[int] = set()
        """Axes that run segments in the group's time."""
        self.rest_tick: int | None = None
        """Tick that time stands still from, if the rate is 0 or on its way there; else None."""
        self.holding: set[int] = set()
        """Axes that request a halt."""

    def hold(self, axis: int, *, hold: bool) -> None:
        """Request a halt of the group for an axis, or withdraw the request."""
        (self.holding.add if hold else self.holding.discard)(axis)

    @property
    def halted(self) -> bool:
        """True if the rate is 0 or on its way there."""
        return self.rest_tick is not None

    @property
    def target_q16(self) -> int:
        """The rate at which the group should run now; full rate without members."""
        if not self.members:
            return k.FULL_RATE_Q16
        return HALTED_Q16 if self.holding else self.wanted_q16

    @property
    def must_ramp(self) -> bool:
        """True if the rate must begin a ramp."""
        return self._heading_for_q16 != self.target_q16

    def rate_q16(self, tick: int) -> int:
        """Return the rate at the start of a tick."""
        since_ticks = tick - int(self.cells[k.RAMP_TICK])
        ramp_ticks = int(self.cells[k.RAMP_TICKS])
        from_q16, to_q16 = int(self.cells[k.RATE_FROM_Q16]), int(self.cells[k.RATE_TO_Q16])
        if since_ticks >= ramp_ticks:
            return to_q16
        return from_q16 + (to_q16 - from_q16) * since_ticks // ramp_ticks

    def resting(self, tick: int) -> bool:
        """Return whether trajectory time stands still from this tick on, or from an earlier one."""
        return self.rest_tick is not None and self.rest_tick <= tick

    def ramp(self, tick: int, full_ramp_ticks: int) -> None:
        """Ramp to the rate requested, from `tick` on; `full_ramp_ticks` is what a ramp from full rate to 0 takes."""
        rate_q16 = self.rate_q16(tick)
        target_q16 = self._heading_for_q16 = self.target_q16
        self.cells[k.RATE_FROM_Q16] = rate_q16
        self.cells[k.RATE_TO_Q16] = target_q16
        self.cells[k.RAMP_TICK] = tick
        ramp_ticks = -(-full_ramp_ticks * abs(target_q16 - rate_q16) // k.FULL_RATE_Q16)
        self.cells[k.RAMP_TICKS] = ramp_ticks
        self.rest_tick = tick + ramp_ticks if target_q16 == HALTED_Q16 else None
        if self.members:
            self.on_ramp(RateRamp(tick, rate_q16, target_q16, ramp_ticks))
