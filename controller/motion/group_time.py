"""Trajectory time of the axes that interpolate together: run at full rate, slower or faster, halt and resume.

All axes of the group advance along their segments at the same rate. It ramps linearly to the requested rate, or to 0
for a halt. So the axes slow down, stop and accelerate together on the planned path. While the rate r changes from 1 to
0 in the time T, an axis with the planned velocity v and acceleration a accelerates with

    a r^2 + v dr/dt,    |v dr/dt| <= max|v| / T,

where max|v| is the maximum over the trajectory time T/2 that the ramp covers. With T = max|v| / D, no axis exceeds its
planned deceleration by more than D. A ramp between other rates has the same slope.

The requested rate is 1 when the first axis of a group starts: each motion begins as planned.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.kernel import Cells

HALTED_Q16: Final = 0


class RateRamp(NamedTuple):
    """A linear change of the rate: first tick, rates at both ends, and duration in ticks (0 for a jump)."""

    tick: int
    from_q16: int
    to_q16: int
    ticks: int


class GroupTime:
    """The group of axes that halt together: its members, halt requests, requested rate and ramp of the rate."""

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        """The kernel's GROUP_FIELDS."""
        self.cells[k.RATE_TO_Q16] = k.FULL_RATE_Q16
        self._heading_for_q16 = k.FULL_RATE_Q16
        """Rate at the end of the present ramp; a copy of the kernel's cell, because every frame reads it."""
        self.wanted_q16 = k.FULL_RATE_Q16
        """Requested rate, which applies while no axis requests a halt."""
        self.on_ramp: Callable[[RateRamp], None] = lambda _: None
        """Called with every ramp when it begins."""
        self.members: set[int] = set()
        """Axes that run segments in the group's time."""
        self.halt_tick: int | None = None
        """First tick of the halt, if the rate is 0 or ramps to 0; else None."""
        self.holding: set[int] = set()
        """Axes that request a halt."""

    def hold(self, axis: int, *, hold: bool) -> None:
        """Set or clear an axis' request to halt the group."""
        (self.holding.add if hold else self.holding.discard)(axis)

    @property
    def halted(self) -> bool:
        """True if the rate is 0 or ramps to 0."""
        return self.halt_tick is not None

    @property
    def target_q16(self) -> int:
        """Rate at which the group should run; full rate without members."""
        if not self.members:
            return k.FULL_RATE_Q16
        return HALTED_Q16 if self.holding else self.wanted_q16

    @property
    def must_ramp(self) -> bool:
        """True if a ramp to `target_q16` must begin."""
        return self._heading_for_q16 != self.target_q16

    def rate_q16(self, tick: int) -> int:
        """Return the rate at the start of a tick."""
        since_ticks = tick - int(self.cells[k.RAMP_TICK])
        ramp_ticks = int(self.cells[k.RAMP_TICKS])
        from_q16, to_q16 = int(self.cells[k.RATE_FROM_Q16]), int(self.cells[k.RATE_TO_Q16])
        if since_ticks >= ramp_ticks:
            return to_q16
        return from_q16 + (to_q16 - from_q16) * since_ticks // ramp_ticks

    def stopped(self, tick: int) -> bool:
        """Return whether trajectory time is stopped at this tick."""
        return self.halt_tick is not None and self.halt_tick <= tick

    def ramp(self, tick: int, full_ramp_ticks: int) -> None:
        """Begin a ramp to `target_q16` at `tick`; `full_ramp_ticks` is the duration of a ramp from full rate to 0."""
        rate_q16 = self.rate_q16(tick)
        target_q16 = self._heading_for_q16 = self.target_q16
        self.cells[k.RATE_FROM_Q16] = rate_q16
        self.cells[k.RATE_TO_Q16] = target_q16
        self.cells[k.RAMP_TICK] = tick
        ramp_ticks = -(-full_ramp_ticks * abs(target_q16 - rate_q16) // k.FULL_RATE_Q16)
        self.cells[k.RAMP_TICKS] = ramp_ticks
        self.halt_tick = tick + ramp_ticks if target_q16 == HALTED_Q16 else None
        if self.members:
            self.on_ramp(RateRamp(tick, rate_q16, target_q16, ramp_ticks))
