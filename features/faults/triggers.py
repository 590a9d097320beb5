"""What starts or ends a fault: a time, a position, a frame, a drive's state, or a time drawn by the seed.

Times count from the motion's start, t = 0 of the plan: the first servo tick after the SYNC that sets an axis moving.
Positions are the drivers' counts on servo ticks. A trigger is data; its watch waits for the instant when it is due,
and looks as seldom as possible.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from enum import StrEnum
from random import Random
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.features.faults.requests import Identifier, by_name, whole_number
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Within
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol.cia402 import State
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.features.faults.engine import Engine


class Watch(ABC):
    """Watches for a trigger."""

    @property
    def next_counts(self) -> int | None:
        """Instant of the next look even without events; None if there is none."""
        return None

    @abstractmethod
    def is_due(self, now_counts: int) -> bool:
        """Look; return True if the trigger is due."""

    def motion_starts(self, start_counts: int) -> None:
        """Register t = 0 of the motion."""

    def hear(self, cob_id: int) -> None:
        """Register a frame on the bus."""

    def missing(self) -> str:
        """Return why the trigger has not been due; empty if that is unknown."""
        return ""


class Trigger(ABC):
    """A trigger that begins or ends a fault, as data."""

    __slots__ = ()

    def drawn(self, _random: Random) -> "Trigger":
        """Return the trigger with random values drawn."""
        return self

    def check(self, robot: Robot) -> None:
        """Raise InputError if the robot lacks the joint."""

    @abstractmethod
    def watch(self, engine: "Engine") -> Watch:
        """Return a watch for it on the machine of an engine, from now on."""


# --- time

TIME_MAX_S: Final = 86_400.0
"""Longest time in a scenario: a day."""
Time = Annotated[float, Within(0, TIME_MAX_S, "s")]


@dataclass(frozen=True, slots=True)
class AtTime(Trigger):
    """An instant, in seconds from the motion's start, or from power-up."""

    at_s: float
    from_power_up: bool = False

    def __str__(self) -> str:
        return f"at {self.at_s:g} s from power-up" if self.from_power_up else f"at {self.at_s:g} s"

    def watch(self, engine: "Engine") -> "TimeWatch":
        watch = TimeWatch(counts_of(self.at_s) if self.from_power_up else None, self.at_s)
        if engine.start_counts is not None:
            watch.motion_starts(engine.start_counts)
        return watch


@dataclass(frozen=True, slots=True)
class AtRandom(Trigger, FileTable):
    """An instant of the motion between two times in seconds from its start, drawn uniformly by the scenario's seed.

    Raises:
        InputError: the second time is before the first.
    """

    from_s: Time
    to_s: Time

    def __post_init__(self) -> None:
        if not self.from_s <= self.to_s:
            raise InputError(f"to_s: {self.to_s:g} s is before from_s, {self.from_s:g} s")

    def drawn(self, random: Random) -> AtTime:
        """Return the drawn instant, to a microsecond."""
        return AtTime(round(random.uniform(self.from_s, self.to_s), 6))

    def watch(self, _engine: "Engine") -> Watch:
        raise ValueError(f"{self}: is not drawn")

    def __str__(self) -> str:
        return f"at random from {self.from_s:g} s to {self.to_s:g} s"


class TimeWatch(Watch):
    """Due at an instant: a known one, or a time from the motion's start."""

    def __init__(self, at_counts: int | None = None, from_start_s: float = 0.0) -> None:
        """Wait for an instant; None: `from_start_s` seconds after the motion's start."""
        self._at_counts = at_counts
        self._from_start_s = from_start_s

    @property
    def next_counts(self) -> int | None:
        return self._at_counts

    def is_due(self, now_counts: int) -> bool:
        return self._at_counts is not None and self._at_counts <= now_counts

    def motion_starts(self, start_counts: int) -> None:
        if self._at_counts is None:
            self._at_counts = start_counts + counts_of(self._from_start_s)

    def missing(self) -> str:
        return "no motion began" if self._at_counts is None else ""


# --- position


class Direction(StrEnum):
    """A joint's direction when it passes a position."""

    UP = "up"
    DOWN = "down"
    ANY = "any"


PassingDirection = Annotated[Direction, by_name({each.value: each for each in Direction})]


@dataclass(frozen=True, slots=True)
class AtPosition(Trigger, FileTable):
    """The first servo tick that finds a joint at or beyond a position, after it was before it.

    Attributes:
        joint: name of the joint.
        value: position in mm or degrees.
        direction: the joint's direction when it passes.
    """

    joint: str
    value: float
    direction: PassingDirection = Direction.ANY

    def __str__(self) -> str:
        return f"{self.joint} {_PASSING[self.direction]} {self.value:g}"

    def check(self, robot: Robot) -> None:
        robot.index_of(self.joint)

    def watch(self, engine: "Engine") -> "PositionWatch":
        return PositionWatch(self, engine.target)


_PASSING = {Direction.UP: "rises to", Direction.DOWN: "falls to", Direction.ANY: "passes"}


class PositionWatch(Watch):
    """Due at the first tick that finds a joint at or beyond a position.

    A driver's shortest period limits its pulses, and each moves the motor by a full step at most. So a distant joint
    cannot arrive soon, and looks are rare.
    """

    def __init__(self, trigger: AtPosition, target: RobotBoards) -> None:
        self._trigger = trigger
        self._target = target
        robot = target.robot
        self._joint = robot.index_of(trigger.joint)
        full_steps = np.diag([float(joint.transmission.microsteps) for joint in robot.axes])
        travel = robot.from_steps(full_steps)[:, self._joint] - robot.from_steps(0 * full_steps)[:, self._joint]
        period_min_counts = min(board.config.period_min_counts for board, _ in target.axes)
        self._per_tick = float(np.abs(travel).sum()) * TICK_COUNTS / period_min_counts
        """Largest motion of the joint in a tick."""
        self._was = self._position()
        self._seen = [self._was, self._was]
        self._look_counts = 0

    def _position(self) -> float:
        return float(self._target.robot.from_steps(np.array(self._target.steps()))[self._joint])

    @property
    def next_counts(self) -> int | None:
        return self._look_counts if self._target.moving else None

    def is_due(self, now_counts: int) -> bool:
        if now_counts < self._look_counts:
            return False
        position, value = self._position(), self._trigger.value
        rises = self._was < value <= position and self._trigger.direction is not Direction.DOWN
        falls = self._was > value >= position and self._trigger.direction is not Direction.UP
        if position != value:
            self._was = position
        self._seen = [min(self._seen[0], position), max(self._seen[1], position)]
        quiet_ticks = max(1, int(abs(position - value) / self._per_tick))
        self._look_counts = (now_counts // TICK_COUNTS + quiet_ticks) * TICK_COUNTS
        return rises or falls

    def missing(self) -> str:
        low, high = self._seen
        return f"{self._trigger.joint} was seen from {low:.3f} to {high:.3f}"


# --- frame, state


@dataclass(frozen=True, slots=True)
class OnFrame(Trigger, FileTable):
    """The instant when the n-th frame of an identifier since power-up becomes valid on the bus."""

    id: Identifier
    n: Annotated[int, whole_number(1)] = 1

    def __str__(self) -> str:
        return f"on frame {self.n} of 0x{self.id:03X}"

    def watch(self, _engine: "Engine") -> "FrameWatch":
        return FrameWatch(self)


class FrameWatch(Watch):
    """Due with the n-th frame of an identifier."""

    def __init__(self, trigger: OnFrame) -> None:
        self._trigger = trigger
        self._heard = 0

    def hear(self, cob_id: int) -> None:
        self._heard += cob_id == self._trigger.id

    def is_due(self, _now_counts: int) -> bool:
        return self._heard >= self._trigger.n

    def missing(self) -> str:
        return f"there were {self._heard} such frames"


DriveState = Annotated[State, by_name({state.name.replace("_", " "): state for state in State})]


@dataclass(frozen=True, slots=True)
class AtState(Trigger, FileTable):
    """The instant when the drive of a joint is found in a state."""

    joint: str
    state: DriveState

    def __str__(self) -> str:
        return f"{self.joint} in {self.state.name.replace('_', ' ')}"

    def check(self, robot: Robot) -> None:
        robot.axis_index(self.joint)

    def watch(self, engine: "Engine") -> "StateWatch":
        board, axis = engine.target.axes[engine.target.robot.axis_index(self.joint)]
        if not board.runs_own:
            raise InputError(f"{self}: the state of a drive is known of StepTwin's firmware only")
        return StateWatch(self.state, lambda: board.firmware.nodes[axis].drive.state)


class StateWatch(Watch):
    """Due while a drive is in a state."""

    def __init__(self, state: State, present: Callable[[], State]) -> None:
        self._state = state
        self._present = present
        self._seen: dict[State, None] = {}

    def is_due(self, _now_counts: int) -> bool:
        present = self._present()
        self._seen[present] = None
        return present is self._state

    def missing(self) -> str:
        return f"it was in {', '.join(state.name.replace('_', ' ') for state in self._seen)}"


def counts_of(seconds: float) -> int:
    """Return a time in counts of the board's timer."""
    return round(seconds * COUNTS_PER_SECOND)


def earliest(watches: Iterable[Watch]) -> int | None:
    """Return the first instant when one of the watches must look; None if there is none."""
    return min((counts for watch in watches if (counts := watch.next_counts) is not None), default=None)


# --- keys of triggers


@dataclass(frozen=True, slots=True, kw_only=True)
class TriggerKeys(FileTable):
    """A trigger.

    Attributes:
        at_s: time of the motion.
        power_up_s: time from power-up.
        at_position: a joint passes a position.
        on_frame: a frame is on the bus.
        at_state: the drive of a joint is in a state.
        at_random: time of the motion, drawn by the seed.
    """

    at_s: Time | None = None
    power_up_s: Time | None = None
    at_position: AtPosition | None = None
    on_frame: OnFrame | None = None
    at_state: AtState | None = None
    at_random: AtRandom | None = None

    def trigger(self, robot: Robot) -> Trigger:
        """Return the trigger; raise InputError for none or several, or if the robot lacks its joint."""
        given = {key: value for key in TRIGGERS if (value := getattr(self, key)) is not None}
        if len(given) != 1:
            raise InputError(f"a fault has exactly one of {', '.join(TRIGGERS)}, not {' and '.join(given) or 'none'}")
        ((key, value),) = given.items()
        if not isinstance(value, Trigger):
            return AtTime(value, from_power_up=key == "power_up_s")
        with prefixed(f"{key}."):
            value.check(robot)
        return value


TRIGGERS: Final = tuple(each.name for each in fields(TriggerKeys))
"""Keys of triggers; a fault has one."""
