"""How a joint is homed, as its robot's file says it."""

from dataclasses import dataclass

from steptwin.host.common.bad_input import require_positive
from steptwin.host.common.errors import InputError
from steptwin.protocol.homing_methods import HOME_HERE, HOME_HERE_OBSOLETE, HOMING_METHODS


@dataclass(frozen=True, slots=True)
class JointHoming:
    """How a joint is homed; speeds in its unit/s, acceleration in unit/s^2.

    Attributes:
        method: of CiA 402, object 0x6098.
        search_speed: at which the switch is searched for.
        zero_speed: at which its edge is crossed.
        acceleration: of all ramps.

    Raises:
        InputError: no such method, or speeds that are none.
    """

    method: int
    search_speed: float
    zero_speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if self.method not in HOMING_METHODS:
            raise InputError(f"method: {self.method} is none of 17 to 30, {HOME_HERE_OBSOLETE}, {HOME_HERE}")
        require_positive(self, "search_speed", "zero_speed", "acceleration")
        if self.zero_speed > self.search_speed:
            raise InputError(f"zero_speed: {self.zero_speed:g} is above search_speed, {self.search_speed:g}")

    def check_within(self, speed_max: float, acceleration_max: float) -> None:
        """Raise InputError if it is more than the joint can do."""
        if self.search_speed > speed_max:
            raise InputError(f"homing.search_speed: {self.search_speed:g} is above speed_max, {speed_max:g}")
        if self.acceleration > acceleration_max:
            limit = f"acceleration_max, {acceleration_max:g}"
            raise InputError(f"homing.acceleration: {self.acceleration:g} is above {limit}")
