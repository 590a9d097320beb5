"""A joint's switches, and the homing methods that they allow."""

from dataclasses import dataclass
from functools import partial
from typing import Final

from steptwin.host.common.bad_input import at_most
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Positive, check_limits
from steptwin.host.common.findings import check_all
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.homing_methods import HOME_HERE, HOME_HERE_OBSOLETE, HOMING_METHODS, POSITIVE, HomingMethod


@dataclass(frozen=True, slots=True)
class JointHoming(FileTable):
    """The homing of a joint; raises InputError for a value out of range.

    Attributes:
        method: the homing method (6098h).
        search_speed: speed of the search for the switch, in the joint's unit/s.
        zero_speed: speed of the axis over the switch's edge, at most `search_speed`.
        acceleration: acceleration of all ramps, in the joint's unit/s^2.
    """

    method: int
    search_speed: Positive
    zero_speed: Positive
    acceleration: Positive

    def __post_init__(self) -> None:
        check_all(
            self._check_method,
            partial(check_limits, self),
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


_NEGATIVE, _POSITIVE, _FROM, _TO = "negative_limit", "positive_limit", "home_from", "home_to"

_LIMITS: Final = {DigitalInput.NEGATIVE_LIMIT: _NEGATIVE, DigitalInput.POSITIVE_LIMIT: _POSITIVE}


def _edge_key(method: HomingMethod) -> str:
    """Return the key of the edge that a method takes as home."""
    return _LIMITS.get(method.switch) or (_FROM if method.at_lower_edge else _TO)


def _needed_keys(method: HomingMethod) -> tuple[str, ...]:
    """Return the keys of all edges that a method needs, the home edge first."""
    if not method.turns:
        return (_edge_key(method),)
    turn = DigitalInput.POSITIVE_LIMIT if method.search_direction == POSITIVE else DigitalInput.NEGATIVE_LIMIT
    return (_edge_key(method), _FROM, _TO, _LIMITS[turn])


@dataclass(frozen=True, slots=True)
class JointSwitches(FileTable):
    """The positions of a joint's switches, in its unit; None for a missing edge. Raises InputError for a wrong order.

    Attributes:
        negative_limit: the negative limit switch is closed here and below.
        positive_limit: the positive limit switch is closed here and above.
        home_from: lower edge of the home switch, which is closed above it; None: closed from the end of travel.
        home_to: upper edge of the home switch, which is closed below it; None: closed to the end of travel.
    """

    negative_limit: float | None = None
    positive_limit: float | None = None
    home_from: float | None = None
    home_to: float | None = None

    def __post_init__(self) -> None:
        pairs = ((_NEGATIVE, _POSITIVE), (_FROM, _TO), (_NEGATIVE, _TO), (_FROM, _POSITIVE))
        check_all(*(partial(self._check_order, low, high) for low, high in pairs))

    @property
    def inputs(self) -> tuple[DigitalInput, ...]:
        """The inputs to which the joint's switches are wired."""
        fitted = {
            DigitalInput.NEGATIVE_LIMIT: self.negative_limit is not None,
            DigitalInput.POSITIVE_LIMIT: self.positive_limit is not None,
            DigitalInput.HOME: self.home_from is not None or self.home_to is not None,
        }
        return tuple(which for which, there in fitted.items() if there)

    def _check_order(self, low: str, high: str) -> None:
        below, above = getattr(self, low), getattr(self, high)
        if below is not None and above is not None and not below < above:
            raise InputError(f"{high}: {above:g} is not above {low}, {below:g}")

    def check_negative(self, lower: float, unit: str) -> None:
        """Raise InputError if the negative limit switch lies within the joint's limits, where a motion closes it."""
        negative = self.negative_limit
        if negative is not None and not negative < lower:
            raise InputError(f"switches.negative_limit: {negative:g} {unit} is not below lower, {lower:g} {unit}")

    def check_positive(self, upper: float, unit: str) -> None:
        """Raise InputError if the positive limit switch lies within the joint's limits, where a motion closes it."""
        positive = self.positive_limit
        if positive is not None and not positive > upper:
            raise InputError(f"switches.positive_limit: {positive:g} {unit} is not above upper, {upper:g} {unit}")

    def edge(self, method: HomingMethod) -> float | None:
        """Return the position of the edge that a method takes as home; None if the joint has no such edge."""
        position: float | None = getattr(self, _edge_key(method))
        return position

    def check_method(self, number: int) -> None:
        """Raise InputError unless a homing method of this number can work with these switches."""
        method = HOMING_METHODS.get(number)
        if method is None:
            return
        for key in _needed_keys(method):
            if getattr(self, key) is None:
                raise InputError(f"homing.method: {number} needs switches.{key}")
        if method.switch not in _LIMITS and not method.turns:
            other = _TO if method.at_lower_edge else _FROM
            if getattr(self, other) is not None:
                raise InputError(f"homing.method: {number} is for a home switch without {other}; 23 to 30 are for both")
