"""The settings that the client writes into an axis before it moves."""

from dataclasses import dataclass

from steptwin.protocol import od

Objects = list[tuple[int, int]]
"""Dictionary entries with their values, as (address, value) in the order in which they are written."""


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """Settings of one axis, in the units of its dictionary entries."""

    microsteps: int
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    velocity_max_units_per_s: int
    deceleration_units_per_s2: int
    """Deceleration of a halt, a quick stop and the stop after a fault."""

    def objects(self) -> Objects:
        """Return the entries that hold these settings."""
        return [
            (od.MICROSTEPS, self.microsteps),
            (od.STEPLEN_NS, self.steplen_ns),
            (od.STEPSPACE_NS, self.stepspace_ns),
            (od.DIRSETUP_NS, self.dirsetup_ns),
            (od.DIRHOLD_NS, self.dirhold_ns),
            (od.MAX_PROFILE_VELOCITY, self.velocity_max_units_per_s),
            (od.PROFILE_DECELERATION, self.deceleration_units_per_s2),
            (od.QUICK_STOP_DECELERATION, self.deceleration_units_per_s2),
        ]
