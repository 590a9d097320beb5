"""Switch digital outputs while a trajectory runs: a gripper, a magnet, a lock, each at its time.

The time of an output is trajectory time, which stands still while the machine is halted. An output is switched once the
board reports that it executes a record which begins at the output's time or later, never before. The board's own
reports come only ten times a second, so the client reads the record number by SDO when an output may be due.
"""

from collections import deque
from typing import NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.trajectory_time import TrajectoryTime
from steptwin.protocol.cia402 import DigitalOutput


class OutputCommand(NamedTuple):
    """Switch one output of one axis `from_s` seconds after the motion's start, in trajectory time."""

    axis: int
    output: DigitalOutput
    on: bool
    from_s: float


class OutputSchedule:
    """The output commands of one run; each is sent when it is due, and the motion does not wait for it."""

    def __init__(
        self, axes: tuple[AxisClient, ...], commands: tuple[OutputCommand, ...], reached: TrajectoryTime
    ) -> None:
        self._axes = axes
        self._pending = deque(sorted(commands, key=lambda command: command.from_s))
        self._reached = reached

    def tend(self, now_s: float) -> None:
        """Send every command that is due by now."""
        while self._pending and self._is_due(self._pending[0].from_s, now_s):
            command = self._pending.popleft()
            self._axes[command.axis].switch_output(command.output, on=command.on)

    def _is_due(self, from_s: float, now_s: float) -> bool:
        """Return whether the trajectory has reached a time; ask the board only if the last report leaves it open."""
        if self._reached.least_s < from_s <= self._reached.most_s(now_s):
            self._reached.report(self._axes[0].executing(), now_s)
        return self._reached.least_s >= from_s
