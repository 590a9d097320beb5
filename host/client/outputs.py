"""Digital outputs that are switched while a trajectory runs: a gripper, a magnet, a lock, each at its time."""

from collections import deque
from typing import NamedTuple

from host.client.axis import AxisClient
from protocol.cia402 import DigitalOutput


class OutputCommand(NamedTuple):
    """One output of one axis takes a level, this long after the motion's start."""

    axis: int
    output: DigitalOutput
    on: bool
    from_s: float


class OutputSchedule:
    """The commands of one run, sent when they are due; the motion stands still meanwhile and waits for none."""

    def __init__(self, axes: tuple[AxisClient, ...], commands: tuple[OutputCommand, ...], started_s: float) -> None:
        self._axes = axes
        self._pending = deque(sorted(commands, key=lambda command: command.from_s))
        self._started_s = started_s

    def tend(self, now_s: float) -> None:
        """Send what is due by now."""
        while self._pending and now_s - self._started_s >= self._pending[0].from_s:
            command = self._pending.popleft()
            self._axes[command.axis].switch_output(command.output, on=command.on)
