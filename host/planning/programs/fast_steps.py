"""Find the steps of a program that are too fast, and the values of their own keys that pass."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from steptwin.host.planning import checks
from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.planning.planner import DEFAULT_POINT_MS, step_peaks
from steptwin.host.planning.programs.complaints import pass_words
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.paces import Pace
from steptwin.host.planning.programs.passing_pace import passing_values
from steptwin.host.planning.programs.steps import Step
from steptwin.host.planning.programs.writing_out import Place
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class MadeStep:
    """A step as it was made at a place of a program.

    Attributes:
        robot: the robot.
        place: the place.
        step: the step.
        before: moves that begin where the step begins.
        from_ms: time of the program at which it begins.
        part: its motion; None if it does not move.
    """

    robot: Robot
    place: Place
    step: Step
    before: Moves
    from_ms: int
    part: Trajectory | None

    def peaks(self) -> tuple[Peak, ...]:
        """Return the peaks of each joint; none without motion, or if PVT records cannot hold it."""
        try:
            return () if self.part is None else step_peaks(self.robot, self.part, self.from_ms)
        except checks.TooFastError:
            return ()

    def check_speed(self, pace: Pace | None = None) -> None:
        """Raise TooFastError if the step, or the step with another pace, is too fast."""
        part = self.part if pace is None else self._with(pace)
        if part is not None:
            peaks = step_peaks(self.robot, part, self.from_ms)
            checks.check_peaks(sorted(peaks, key=lambda peak: peak.quantity is Quantity.STEP_RATE))

    @property
    def situation(self) -> tuple[tuple[float, ...], int]:
        """Where and when it begins, as far as that decides whether it is too fast."""
        return tuple(self.before.composer.joints.tolist()), self.from_ms % DEFAULT_POINT_MS

    def _with(self, pace: Pace) -> Trajectory | None:
        moves = self.before.from_here()
        replace(self.step, pace=pace).add_to(moves)
        return moves.composer.last_part(0.0)


@dataclass(frozen=True, slots=True)
class _FastStep:
    """A step that is too fast at a place."""

    made: MadeStep
    error: checks.TooFastError


def fast_steps(made: Iterable[MadeStep]) -> Iterator[str]:
    """Yield a message for each step that is too fast, with the values that pass wherever it is made."""
    wrong: dict[int, list[_FastStep]] = {}
    judged = Counter[str]()
    for step in made:
        judged[step.place.number] += 1
        try:
            step.check_speed()
        except checks.TooFastError as error:
            wrong.setdefault(id(step.step), []).append(_FastStep(step, error))
    for group in wrong.values():
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
    if step.pace is None:
        return ""
    worst_first = sorted(group, key=lambda fast: -fast.error.least_stretch)
    different = {fast.made.situation: fast for fast in reversed(worst_first)}
    places = sorted(different.values(), key=lambda fast: -fast.error.least_stretch)
    values = passing_values(step.pace, places[0].error, [fast.made.check_speed for fast in places])
    if not values:
        return f"no {' and no '.join(step.pace.keys)} alone passes"
    return f"{' or '.join(values)} passes"
