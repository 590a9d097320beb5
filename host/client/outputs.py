"""Digital outputs that are switched while a trajectory runs: a gripper, a magnet, a lock, each at its time.

That time is the trajectory's: it stands still while the machine is halted. An output is switched when the board says
that it executes a record which begins at the output's time or later, never before. The board is asked for that when it
can be so: its own reports come ten times a second only.
"""

from collections import deque
from typing import NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.trajectory_time import TrajectoryTime
from steptwin.protocol.cia402 import DigitalOutput


class OutputCommand(NamedTuple):
    """One output of one axis takes a level, this long after the motion's start."""

    axis: int
    output: DigitalOutput
    on: bool
    from_s: float


class OutputSchedule:
    """The commands of one run, sent when they are due; the motion stands still meanwhile and waits for none."""

    def __init__(
        self, axes: tuple[AxisClient, ...], commands: tuple[OutputCommand, ...], reached: TrajectoryTime
    ) -> None:
        self._axes = axes
        self._pending = deque(sorted(commands, key=lambda command: command.from_s))
        self._reached = reached

    def tend(self, now_s: float) -> None:
        """Send what is due by now."""
        while self._pending and self._is_due(self._pending[0].from_s, now_s):
            command = self._pending.popleft()
            self._axes[command.axis].switch_output(command.output, on=command.on)

    def _is_due(self, from_s: float, now_s: float) -> bool:
        if self._reached.least_s < from_s <= self._reached.most_s(now_s):
            self._reached.report(self._axes[0].executing(), now_s)
        return self._reached.least_s >= from_s
