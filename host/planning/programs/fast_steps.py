"""Find the steps of a program that are too fast, and passing values of their own keys."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.common.features import changed_motion
from steptwin.host.common.planning_time import check_planning_time, planning_step
from steptwin.host.planning import checks
from steptwin.host.planning.checks import TooFastError
from steptwin.host.planning.motion import DEFAULT_POINT_MS, Motion
from steptwin.host.planning.motions.stretched import least_passing
from steptwin.host.planning.peaks import Peak, Quantity, TooLongError, sampled, shifted
from steptwin.host.planning.planner import step_peaks
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.program import Place
from steptwin.host.planning.programs.program_file import pass_words
from steptwin.host.planning.programs.steps import Step
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

Check = Callable[[Step], None]
"""Checks a step with another pace; raises TooFastError if it is too fast."""

_DIGITS: Final = 3
"""Significant digits of a value that is not in whole milliseconds."""
_PER_DECADE: Final = 9 * 10 ** (_DIGITS - 1)
"""Number of values with so many digits from 1 to below 10."""


@dataclass(frozen=True, slots=True)
class _Key:
    """A key of a pace, and its possible values in messages, numbered by slowness.

    Attributes:
        name: name of the key.
        slower: 1 if a larger value is slower, -1 if a smaller one is.
        reach: largest factor on the value. Beyond it the step's numbers have a wrong unit.
        in_ms: True for a duration in whole milliseconds; other values have three significant digits.
        of_ramps: True for a key that only reduces accelerations.
    """

    name: str
    slower: int
    reach: float = 1000.0
    in_ms: bool = False
    of_ramps: bool = False

    def value(self, number: int) -> float:
        """Return the value with a number."""
        size = self.slower * number
        if self.in_ms:
            return size / 1000
        exponent, mantissa = divmod(size, _PER_DECADE)
        return float(f"{mantissa + _PER_DECADE // 9}e{exponent}")

    def at_least_as_fast(self, value: float) -> int:
        """Return the number of the slowest value that is not slower than a given one."""
        return self.slower * self._size(value, ROUND_FLOOR if self.slower > 0 else ROUND_CEILING)

    def at_least_as_slow(self, value: float) -> int:
        """Return the number of the fastest value that is not faster than a given one."""
        return self.slower * self._size(value, ROUND_CEILING if self.slower > 0 else ROUND_FLOOR)

    def made_slower(self, value: float, factor: float) -> float:
        """Return a value made slower by a factor."""
        return value * factor**self.slower

    def _size(self, value: float, rounding: str) -> int:
        exact = Decimal(repr(value))
        if self.in_ms:
            return int((1000 * exact).to_integral_value(rounding))
        exponent = exact.adjusted() - (_DIGITS - 1)
        mantissa = int(exact.scaleb(-exponent).to_integral_value(rounding))
        return _PER_DECADE * exponent + mantissa - _PER_DECADE // 9


_KEYS: Final = {
    key.name: key
    for key in (
        _Key("speed_mm_s", -1),
        _Key("speed_deg_s", -1),
        _Key("ramp_s", 1, reach=10.0, of_ramps=True),
        _Key("speed_percent", -1),
        _Key("duration_s", 1, in_ms=True),
    )
}


def passing_values(step: Step, names: Iterable[str], error: TooFastError, checks: Iterable[Check]) -> list[str]:
    """Return the values that pass, such as `speed_mm_s = 42.1`, each by itself; none if no value passes.

    Each is the passing value nearest to the step's own, in three digits or whole milliseconds.

    Args:
        step: the step, which is too fast.
        names: its keys that may be changed.
        error: refusal of the step at the place where it is made first of all.
        checks: checks of the step at all places of the program where it is made, the one of `error` first.
    """
    places = tuple(checks)
    only_ramps = all(peak.quantity in (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION) for peak in error.peaks)
    keys = [_KEYS[name] for name in names if only_ramps or not _KEYS[name].of_ramps]
    values = ((key.name, _passing_value(step, key, error.least_stretch, places)) for key in keys)
    return [f"{name} = {value:.10g}" for name, value in values if value is not None]


def _passing_value(step: Step, key: _Key, least_stretch: float, checks: tuple[Check, ...]) -> float | None:
    own: float = getattr(step, key.name)
    slowest = key.at_least_as_slow(key.made_slower(own, key.reach))
    number = key.at_least_as_fast(own)
    guess = key.at_least_as_slow(key.made_slower(own, least_stretch))
    for check in checks:

        def passes(number: int, check: Check = check) -> bool:
            changed: dict[str, Any] = {key.name: key.value(number)}
            try:
                check(replace(step, **changed))
            except (TooFastError, TooLongError):
                return False
            return True

        if number != key.at_least_as_fast(own) and passes(number):
            continue
        found = least_passing(passes, number, guess, slowest)
        if found is None:
            return None
        number = guess = found
    return key.value(number)


class _Examination(NamedTuple):
    """Speed of a step's motion; `refused` is the error if PVT records cannot hold it."""

    peaks: tuple[Peak, ...]
    refused: TooFastError | None


@dataclass(frozen=True, eq=False)
class MadeStep:
    """A step as it was made at a place of a program.

    Attributes:
        robot: the robot.
        place: the place.
        step: the step.
        before: moves with the step's start.
        from_ms: time in the program when it begins.
        part: its motion before features change it; None without one.
    """

    robot: Robot
    place: Place
    step: Step
    before: Moves
    from_ms: int
    part: Motion | None

    @cached_property
    def _executed(self) -> Motion | None:
        changed = None if self.part is None else changed_motion(self.robot, self.part)
        return self.part if changed is None else changed.motion

    @property
    def peaks(self) -> tuple[Peak, ...]:
        """Peaks of each joint; empty without motion, or if PVT records cannot hold it."""
        return self._look.peaks

    @cached_property
    def positions(self) -> checks.SampleCheck:
        """Its positions, for `check_joint`."""
        if self._executed is None:
            return checks.SampleCheck(self.robot, np.zeros(0))
        check = checks.SampleCheck(self.robot, checks.knots_ms(self._executed) + self.from_ms)
        for _ in check.looking(shifted(sampled(self._executed), self.from_ms / 1000)):
            pass
        return check

    @cached_property
    def _look(self) -> _Examination:
        """Examine the motion once, on first use: a run leaves that to the planner."""
        if self._executed is None:
            return _Examination((), None)
        windows = shifted(sampled(self._executed), self.from_ms / 1000)
        try:
            return _Examination(step_peaks(self.robot, self._executed, self.from_ms, windows), None)
        except TooFastError as error:
            return _Examination((), error)

    def check_speed(self) -> None:
        """Raise TooFastError if the step is too fast."""
        if self._look.refused is not None:
            raise self._look.refused
        checks.check_peaks(sorted(self.peaks, key=lambda peak: peak.quantity is Quantity.STEP_RATE))

    def check_pace(self, step: Step) -> None:
        """Raise TooFastError if the step is too fast with another pace."""
        moves = self.before.from_here()
        step.add_to(moves)
        replace(self, part=moves.composer.motion_since(0.0)).check_speed()

    @property
    def situation(self) -> tuple[tuple[float, ...], int]:
        """Place and time of its beginning; equal ones are equally fast."""
        return tuple(self.before.composer.joints.tolist()), self.from_ms % DEFAULT_POINT_MS


@dataclass(frozen=True, slots=True)
class _FastStep:
    """A step at a place where it is too fast."""

    made: MadeStep
    error: checks.TooFastError


def fast_steps(made: Iterable[MadeStep]) -> Iterator[str]:
    """Yield a message for each step that is too fast, with values that pass at all of its places."""
    wrong: dict[int, list[_FastStep]] = {}
    judged = Counter[str]()
    for step in made:
        judged[step.place.number] += 1
        try:
            with planning_step(f"{step.place} ({step.step})"):
                check_planning_time()
                step.check_speed()
        except checks.TooFastError as error:
            wrong.setdefault(id(step.step), []).append(_FastStep(step, error))
    for group in wrong.values():
        with planning_step(f"{group[0].made.place} ({group[0].made.step})"):
            yield _message(group, judged)


def _message(group: list[_FastStep], judged: Mapping[str, int]) -> str:
    first = group[0]
    place, step = first.made.place, first.made.step
    numbers = Counter(fast.made.place.number for fast in group)
    where = pass_words(place, numbers[place.number], judged[place.number])
    if others := [number for number in numbers if number != place.number]:
        where += f", also as step {others[0]}"
    return f"step {place.number} ({step}{where}): {first.error}; {_advice(step, group)}"


def _advice(step: Step, group: list[_FastStep]) -> str:
    if not step.keys:
        return ""
    worst_first = sorted(group, key=lambda fast: -fast.error.least_stretch)
    different = {fast.made.situation: fast for fast in reversed(worst_first)}
    places = sorted(different.values(), key=lambda fast: -fast.error.least_stretch)
    turns_in_space = not make_kinematics(places[0].made.robot).task.is_flat
    names = [name for name in step.keys if name != "speed_deg_s" or turns_in_space]
    values = passing_values(step, names, places[0].error, [fast.made.check_pace for fast in places])
    if not values:
        return f"no {' and no '.join(names)} alone passes"
    return f"{' or '.join(values)} passes"
