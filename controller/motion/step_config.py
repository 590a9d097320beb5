"""The step configuration of one axis: microsteps, pulse timing, speed limit and direction."""

from dataclasses import dataclass

from steptwin.controller.motion import kernel as k
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

REVERSED = 0xC0
"""Value of the polarity (607Eh): bit 7 reverses positions, bit 6 velocities."""
INVERT_DIR = 0x02
"""Bit of the invert mask (2001h:05), whose bits are STEP, DIR, ENABLE in this order."""


@dataclass(frozen=True, slots=True)
class StepConfig:
    """The step configuration. Its four timings are LinuxCNC's, in ns, and are rounded up to timer counts."""

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
        """True if DIR is low while the position grows."""
        return bool(self.polarity) != bool(self.invert_mask)

    @property
    def rate_limit_q16_per_ms(self) -> int:
        """Highest step rate: the velocity limit, or the fastest pulses that the timing permits if these are slower."""
        by_velocity = (self.velocity_max_units_per_s * self.microsteps << 2) // 1000
        pulse_counts = counts_of_ns(self.steplen_ns) + counts_of_ns(self.stepspace_ns)
        by_timing = (COUNTS_PER_SECOND * k.STEP_Q16) // (1000 * pulse_counts)
        return min(by_velocity, by_timing)


UNCONFIGURED = StepConfig(1, 1_000_000, 1_000_000, 0, 0, velocity_max_units_per_s=0)
"""The configuration of an axis that refuses every motion."""
