"""Where a joint's switches are and how it is homed by them, as a robot's file says it."""

from dataclasses import dataclass
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import HOME_HERE, HOME_HERE_OBSOLETE, HOMING_METHODS

_NEGATIVE, _POSITIVE, _FROM, _TO = "negative_limit", "positive_limit", "home_from", "home_to"

_EDGES: Final = {
    17: _NEGATIVE,
    18: _POSITIVE,
    19: _FROM,
    20: _FROM,
    21: _TO,
    22: _TO,
    23: _FROM,
    24: _FROM,
    25: _TO,
    26: _TO,
    27: _TO,
    28: _TO,
    29: _FROM,
    30: _FROM,
}
"""Which edge is home, by the methods' figures in CiA 402-2."""
_NEEDED: Final = {
    **dict.fromkeys(range(23, 27), (_FROM, _TO, _POSITIVE)),
    **dict.fromkeys(range(27, 31), (_FROM, _TO, _NEGATIVE)),
}
"""What a method needs beside its edge: the home switch's other end, and the limit switch at which it turns round."""
_ONE_SIDED: Final = {19: _TO, 20: _TO, 21: _FROM, 22: _FROM}
"""The methods whose home switch is closed to the end of travel, and the end that it does not have."""


@dataclass(frozen=True, slots=True)
class JointSwitches:
    """Where a joint's switches close, in the joint's unit; None where there is none.

    Attributes:
        negative_limit: the limit switch is closed here and below.
        positive_limit: the limit switch is closed here and above.
        home_from: the home switch is closed from here on, up to `home_to` or to the end of travel.
        home_to: the home switch is closed up to here, from `home_from` or from the end of travel on.

    Raises:
        InputError: switches that are the wrong way round.
    """

    negative_limit: float | None = None
    positive_limit: float | None = None
    home_from: float | None = None
    home_to: float | None = None

    def __post_init__(self) -> None:
        for low, high in ((_NEGATIVE, _POSITIVE), (_FROM, _TO), (_NEGATIVE, _TO), (_FROM, _POSITIVE)):
            below, above = getattr(self, low), getattr(self, high)
            if below is not None and above is not None and not below < above:
                raise InputError(f"{high}: {above:g} is not above {low}, {below:g}")

    def check_outside(self, lower: float, upper: float, unit: str) -> None:
        """Raise InputError if a limit switch is within the joint's limits, where motions would run into it."""
        negative, positive = self.negative_limit, self.positive_limit
        if negative is not None and not negative < lower:
            raise InputError(f"switches.negative_limit: {negative:g} {unit} is not below lower, {lower:g} {unit}")
        if positive is not None and not positive > upper:
            raise InputError(f"switches.positive_limit: {positive:g} {unit} is not above upper, {upper:g} {unit}")

    def edge(self, method: int) -> float | None:
        """The position of the edge that is home by a method; None if that has none."""
        return getattr(self, _EDGES[method]) if method in _EDGES else None

    def check_method(self, method: int) -> None:
        """Raise InputError if these switches do not suit a method."""
        for key in (*filter(None, [_EDGES.get(method)]), *_NEEDED.get(method, ())):
            if getattr(self, key) is None:
                raise InputError(f"homing.method: {method} needs switches.{key}")
        unwanted = _ONE_SIDED.get(method)
        if unwanted and getattr(self, unwanted) is not None:
            raise InputError(f"homing.method: {method} is for a home switch without {unwanted}; 23 to 30 are for both")


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
        for name in ("search_speed", "zero_speed", "acceleration"):
            value = getattr(self, name)
            if not value > 0:
                raise InputError(f"{name}: {value:g} is not above 0")
        if self.zero_speed > self.search_speed:
            raise InputError(f"zero_speed: {self.zero_speed:g} is above search_speed, {self.search_speed:g}")

    def check_within(self, speed_max: float, acceleration_max: float) -> None:
        """Raise InputError if it is more than the joint can do."""
        if self.search_speed > speed_max:
            raise InputError(f"homing.search_speed: {self.search_speed:g} is above speed_max, {speed_max:g}")
        if self.acceleration > acceleration_max:
            limit = f"acceleration_max, {acceleration_max:g}"
            raise InputError(f"homing.acceleration: {self.acceleration:g} is above {limit}")
