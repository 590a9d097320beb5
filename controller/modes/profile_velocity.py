"""Profile velocity mode (CiA 402-2, "profile velocity mode"): follow the target velocity (60FFh) by ramps.

The ramps keep the profile acceleration (6083h) and deceleration (6084h). The mode moves towards the end of the allowed
range at the target velocity, so the axis stops at a soft limit (607Dh) or the end of the i32 range as at a target
position. Bit 11 of the statusword then shows the reason. A new target velocity or controlword uses the present profile
objects.
"""

from collections.abc import Callable

from steptwin.controller.modes.drive_mode import DriveMode
from steptwin.controller.modes.profile_feed import ProfileFeed
from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Status
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class ProfileVelocity(DriveMode):
    """Follows the target velocity; the feed makes the motion."""

    def __init__(self, context: AxisContext, feed: ProfileFeed, note: Callable[[int], None]) -> None:
        """Begin; call `note` with each target velocity, because it may be a cyclic set-point."""
        super().__init__(context)
        self._note = note
        self._limits = context.limits
        self._feed = feed
        self._enabled = False
        """True while the drive is in OPERATION ENABLED in this mode."""
        self._halted = False
        self._wanted_units_per_s = 0
        self._velocity = 0
        """Velocity that the axis follows, in 1/64 unit per ms: the target, reduced to the axis' limit."""
        context.dictionary.bind(self)

    def control(self, controlword: int, _previous: int) -> None:
        """Obey the halt bit; follow the target velocity once the drive is enabled in this mode."""
        halted = bool(controlword & Control.HALT)
        if self._enabled and halted is self._halted:
            return
        self._enabled, self._halted = True, halted
        self._follow(self._dictionary.get(od.TARGET_VELOCITY))

    def follow_target(self, units_per_s: int) -> None:
        """Follow a new target velocity at once, if the drive is enabled in this mode."""
        self._context.touch()
        self._note(units_per_s)
        if self._enabled:
            self._follow(units_per_s)

    def _follow(self, units_per_s: int) -> None:
        self._wanted_units_per_s = units_per_s
        self._velocity = 0
        speed = abs(units_per_s) * VELOCITY_PER_UNIT_PER_MS // 1000
        limits = self._feed.limits(speed)
        if limits is None or not self._feed.free:
            return
        if speed and not self._halted:
            self._velocity = limits.velocity if units_per_s > 0 else -limits.velocity
        low, high = self._limits.range()
        end = high if self._velocity > 0 else low
        if self._velocity and (end - self._feed.take_over()) * self._velocity > 0:
            self._feed.move_to(end, limits)
        elif self._motion.running:
            (self._feed.halt if self._halted else self._feed.stop)(limits)

    def finished(self) -> None:
        """Handle standstill: after a ramp of the drive, follow the target velocity."""
        was_moving = self._feed.active
        if self._feed.finished() and not was_moving:
            self._follow(self._dictionary.get(od.TARGET_VELOCITY))

    def void_target(self) -> None:
        """Reset the target velocity, so that an axis that is enabled later does not move by itself."""
        self._dictionary.set(od.TARGET_VELOCITY, 0)
        self._wanted_units_per_s = 0

    def interrupted(self) -> None:
        """Abandon motion and target, because the drive stops, leaves OPERATION ENABLED or changes the mode."""
        self._feed.abandon()
        self._enabled = self._halted = False
        self._velocity = 0
        self.void_target()

    def target_reached(self) -> bool:
        """Return bit 10: the axis has the target velocity, within its limits; in a halt, it is at standstill."""
        return self._feed.steady_velocity == self._velocity

    @property
    def _at_limit(self) -> bool:
        """True if the velocity limit or the end of the allowed range reduces the target velocity."""
        if self._halted or not self._enabled:
            return False
        wanted = abs(self._wanted_units_per_s) * VELOCITY_PER_UNIT_PER_MS // 1000
        return abs(self._velocity) < wanted or (wanted > 0 and not self._motion.running)

    def status_bits(self) -> int:
        """Return bits 11, internal limit, and 12, zero speed."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (0 if self._motion.running else Status.ZERO_SPEED)
