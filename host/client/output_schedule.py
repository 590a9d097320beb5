"""Switch digital outputs while a trajectory runs: a gripper, a magnet, a lock, each at its time.

The time of an output is trajectory time, which stands still while the machine is halted. An output is switched once the
board reports that it executes a record which begins at the output's time or later, never before. The board's own
reports come only ten times a second, so the client reads the record number by SDO when an output may be due.
"""

from collections import deque
from collections.abc import Iterable
from math import ceil
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.queue_feed import TrajectoryTime
from steptwin.protocol.cia402 import DigitalOutput


class OutputCommand(NamedTuple):
    """Switch one output of one axis `from_s` seconds after the motion's start, in trajectory time.

    `promptly` tells that the machine moves meanwhile: the board is asked each millisecond then.
    """

    axis: int
    output: DigitalOutput
    on: bool
    from_s: float
    promptly: bool = False


_PROMPT_S: Final = 0.001
"""Time between two questions to the board while an output is due on the way."""
_AGE_S: Final = 0.02
"""Age up to which the last report may be known only now: a look and the records that are sent in it."""


class OutputSchedule:
    """The output commands of one run; each is sent when it is due, and the motion does not wait for it."""

    def __init__(
        self, axes: tuple[AxisClient, ...], commands: tuple[OutputCommand, ...], reached: TrajectoryTime
    ) -> None:
        self._axes = axes
        self._pending = deque(sorted(commands, key=lambda command: command.from_s))
        self._reached = reached

    def add(self, commands: Iterable[OutputCommand]) -> None:
        """Add commands, in order of time, that are all later than those before."""
        self._pending.extend(commands)

    @property
    def is_prompt(self) -> bool:
        """Whether the next output must change promptly."""
        return bool(self._pending) and self._pending[0].promptly

    def times_to_look(self, now_s: float, dt_s: float) -> int:
        """Return how often to look within a time: more than once if an output must change promptly, then or soon."""
        due = self.is_prompt and self._pending[0].from_s <= self._reached.most_s(now_s + dt_s) + _AGE_S
        return ceil(dt_s / _PROMPT_S) if due else 1

    def tend(self, now_s: float) -> None:
        """Send every command that is due by now."""
        while self._pending and has_come(
            self._pending[0].from_s, self._reached, self._axes[0], now_s, _AGE_S if self._pending[0].promptly else 0.0
        ):
            command = self._pending.popleft()
            self._axes[command.axis].switch_output(command.output, on=command.on)


def has_come(t_s: float, reached: TrajectoryTime, axis: AxisClient, now_s: float, age_s: float = 0.0) -> bool:
    """Return whether the trajectory has reached a time; ask the board only if the last report leaves it open.

    `age_s` is how much older than its reading the report may be, where the answer must come at once.
    """
    if reached.least_s < t_s <= reached.most_s(now_s) + age_s:
        reached.report(axis.executing(), now_s)
    return reached.least_s >= t_s
