"""The step configuration of one axis: microsteps, pulse timing, speed limit and direction."""

from dataclasses import dataclass

from steptwin.controller.motion import kernel as k
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

REVERSED = 0xC0
"""Polarity (607Eh) of a reversed axis: bit 7 reverses positions, bit 6 velocities."""
INVERT_DIR = 0x02
"""Bit of DIR in the invert mask (2001h:05)."""


@dataclass(frozen=True, slots=True)
class StepConfig:
    """How an axis makes its steps. The four timings, named as in LinuxCNC, are rounded up to timer counts."""

    microsteps: int
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    velocity_max_units_per_s: int
    polarity: int = 0
    """0 or REVERSED."""
    invert_mask: int = 0
    """0 or INVERT_DIR."""

    @property
    def dir_inverted(self) -> bool:
        """True if DIR is low while the position increases."""
        return bool(self.polarity) != bool(self.invert_mask)

    @property
    def rate_limit_q16_per_ms(self) -> int:
        """Highest step rate: the velocity limit, or the highest rate that the pulse timing permits if that is lower."""
        by_velocity = (self.velocity_max_units_per_s * self.microsteps << 2) // 1000
        pulse_counts = counts_of_ns(self.steplen_ns) + counts_of_ns(self.stepspace_ns)
        by_timing = (COUNTS_PER_SECOND * k.STEP_Q16) // (1000 * pulse_counts)
        return min(by_velocity, by_timing)


UNCONFIGURED = StepConfig(1, 1_000_000, 1_000_000, 0, 0, velocity_max_units_per_s=0)
"""Configuration of an axis that refuses every motion."""
