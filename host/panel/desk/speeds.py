"""The speed of the trajectory that runs, in percent of the planned one: followed, and changed as the operator asks."""

import time
from collections.abc import Callable
from typing import Final, NamedTuple

from steptwin.host.client import Machine
from steptwin.host.client.pausing import change_speed, present_speed_percent
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.panel.desk.history import EventLog
from steptwin.host.panel.desk.stops import ShownStates
from steptwin.host.panel.desk.words import told

SPEED_PERIOD_S: Final = 0.3
"""Time from one question about the present speed to the next, while a trajectory runs."""
PLANNED_PERCENT: Final = 100


class _Wanted(NamedTuple):
    """A speed, and the number of the newest state that the page had shown which asks for it."""

    percent: int
    shown: int


class RunSpeed:
    """The speed on the way: any thread may ask for one or read it; the worker's thread tends it in its waits.

    Attributes:
        percent: the present speed as last read, 0 in a pause; None without a trajectory.
    """

    def __init__(self, events: EventLog, shown: ShownStates, faster: Callable[[], None]) -> None:
        """Begin without a trajectory; `faster` is called when one runs faster than planned."""
        self.percent: float | None = None
        self._events = events
        self._shown = shown
        self._faster = faster
        self._wanted: _Wanted | None = None
        self._tending = False
        self._read_s = float("-inf")

    def ask(self, percent: int, shown: int) -> None:
        """Let the trajectory run at a percentage of the planned speed, with the worker's next wait."""
        self._wanted = _Wanted(percent, shown)

    def drop(self) -> None:
        """Drop what is asked for and not done yet."""
        self._wanted = None

    def tend(self, machine: Machine) -> None:
        """Change the speed if that is asked for, and read it from time to time; in the worker's thread.

        A speed that comes too late, or after a stop, is refused as a command is, with a line in the events.
        """
        if self._tending:  # a question waits itself
            return
        if not any(axis.interpolating for axis in machine.axes):
            self.percent = self._wanted = None
            return
        wanted, self._wanted = self._wanted, None
        if wanted is None and time.monotonic() - self._read_s < SPEED_PERIOD_S:
            return
        self._tending = True
        try:
            if wanted is not None:
                self._change(machine, wanted)
            self.percent = present_speed_percent(machine.axes)
        except (InputError, DeviceFaultError, BusError) as error:
            self._events.error(f"speed: {told(error)}")
        finally:
            self._tending, self._read_s = False, time.monotonic()
        if self.percent is not None and self.percent > PLANNED_PERCENT:
            self._faster()

    def _change(self, machine: Machine, wanted: _Wanted) -> None:
        self._shown.require(wanted.shown)
        change_speed(machine, wanted.percent)
        self._events.info(f"speed: {wanted.percent} % of the planned one")
        if wanted.percent > PLANNED_PERCENT:
            self._faster()
