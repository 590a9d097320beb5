"""The homing of a joint, as its robot file sets it."""

from dataclasses import dataclass
from functools import partial

from steptwin.host.common.bad_input import at_most, require_positive
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import check_all
from steptwin.protocol.homing_methods import HOME_HERE, HOME_HERE_OBSOLETE, HOMING_METHODS


@dataclass(frozen=True, slots=True)
class JointHoming:
    """The homing of a joint; raises InputError for a value out of range.

    Attributes:
        method: the homing method (6098h).
        search_speed: speed of the search for the switch, in the joint's unit/s.
        zero_speed: speed at which the axis crosses the switch's edge, at most `search_speed`.
        acceleration: acceleration of all ramps, in the joint's unit/s^2.
    """

    method: int
    search_speed: float
    zero_speed: float
    acceleration: float

    def __post_init__(self) -> None:
        check_all(
            self._check_method,
            partial(require_positive, self, "search_speed", "zero_speed", "acceleration"),
            self._check_zero_speed,
        )

    def _check_method(self) -> None:
        if self.method not in HOMING_METHODS:
            raise InputError(f"method: {self.method} is not one of 17 to 30, {HOME_HERE_OBSOLETE}, {HOME_HERE}")

    def _check_zero_speed(self) -> None:
        if self.zero_speed > self.search_speed:
            raise InputError(f"zero_speed: {self.zero_speed:g} is above search_speed, {at_most(self.search_speed)}")

    def check_speed(self, speed_max: float) -> None:
        """Raise InputError if the search speed is above the joint's limit."""
        if self.search_speed > speed_max:
            raise InputError(f"homing.search_speed: {self.search_speed:g} is above speed_max, {at_most(speed_max)}")

    def check_acceleration(self, acceleration_max: float) -> None:
        """Raise InputError if the acceleration is above the joint's limit."""
        if self.acceleration > acceleration_max:
            limit = f"acceleration_max, {at_most(acceleration_max)}"
            raise InputError(f"homing.acceleration: {self.acceleration:g} is above {limit}")
