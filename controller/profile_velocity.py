"""Profile velocity mode (CiA 402-2, "profile velocity mode"): the axis follows 0x60FF by ramps of 0x6083 and 0x6084.

A velocity is a motion to the end of the allowed range, at that speed: so the axis stops at a soft limit 0x607D, or at
the end of the range of a position, just as it would at a target. There bit 11 of the statusword says why it stands.
A new target velocity or a new controlword takes the profile objects as they are then.
"""

from steptwin.controller.modes import Mode
from steptwin.controller.motion import Motion
from steptwin.controller.profile_feed import ProfileFeed
from steptwin.controller.soft_limits import SoftLimits
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Status
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class ProfileVelocity(Mode):
    """The mode's target and bits; the motion itself is the feed's."""

    def __init__(self, axis: int, motion: Motion, dictionary: ObjectDictionary, feed: ProfileFeed) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._limits = SoftLimits(dictionary)
        self._feed = feed
        self._enabled = False
        """Whether the drive is in OPERATION ENABLED in this mode."""
        self._halted = False
        self._wanted_units_per_s = 0
        self._velocity = 0
        """The velocity being followed, in 1/64 unit per ms: what the axis' limit leaves of the wanted one."""

    def control(self, controlword: int, _previous: int) -> None:
        """Obey the halt bit; entering the mode or the state follows the target velocity at once."""
        halted = bool(controlword & Control.HALT)
        if self._enabled and halted is self._halted:
            return
        self._enabled, self._halted = True, halted
        self._follow(self._dictionary.get(od.TARGET_VELOCITY))

    def write_target(self, units_per_s: int) -> None:
        """Follow a new target velocity, in OPERATION ENABLED at once."""
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
        elif self._motion.running(self._axis):
            (self._feed.halt if self._halted else self._feed.stop)(limits)

    def finished(self) -> None:
        """The axis stands; after a ramp that was not the mode's it begins to follow its target."""
        was_moving = self._feed.active
        if self._feed.finished() and not was_moving:
            self._follow(self._dictionary.get(od.TARGET_VELOCITY))

    def interrupted(self) -> None:
        """The drive was stopped or switched off."""
        self._feed.abandon()
        self._enabled = self._halted = False
        self._velocity = 0

    def target_reached(self) -> bool:
        """Bit 10: the axis has the target velocity, as far as it is allowed; during halt, standstill."""
        return self._feed.steady_velocity == self._velocity

    @property
    def _at_limit(self) -> bool:
        """Less than the wanted velocity: slowed to the axis' limit, or standing at the end of the allowed range."""
        if self._halted or not self._enabled:
            return False
        wanted = abs(self._wanted_units_per_s) * VELOCITY_PER_UNIT_PER_MS // 1000
        return abs(self._velocity) < wanted or (wanted > 0 and not self._motion.running(self._axis))

    def status_bits(self) -> int:
        """Bits 11, internal limit, and 12, zero speed."""
        bits = Status.INTERNAL_LIMIT if self._at_limit else 0
        return bits | (0 if self._motion.running(self._axis) else Status.ZERO_SPEED)
