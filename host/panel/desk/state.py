"""The desk's state: what it knows of the machine beside the axes' reports, and what it keeps for its pages."""

import time
from collections.abc import Mapping

from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.history import Drawing, History
from steptwin.host.panel.desk.results import RunResults
from steptwin.host.panel.desk.settings import MachineSettings
from steptwin.host.panel.desk.snapshot import Activity, Snapshot
from steptwin.host.robots.robot import Robot


class DeskState:
    """The desk's state, which outlives each connection; the worker writes it, any thread reads it.

    Attributes:
        events: what has happened, in words.
        history: the last minutes of every joint.
        drawing: the planned path and the tool's trace.
        results: the runs that have ended.
        limits: the robot's limits and all settings.
        latest: the newest snapshot that was published.
        activity: what the worker makes the machine do.
        emergency_stopped: True from an emergency stop until the reset.
        simulated: True if the board says that it is emulated.
        outputs: the digital outputs, as last read.
        bus_load_percent, late_ms, stood_percent: figures of a served board.
    """

    def __init__(self, robot: Robot) -> None:
        """Begin without a connection to the machine of this robot's file."""
        self.events = EventLog()
        self.history = History(len(robot.joints))
        self.drawing = Drawing()
        self.results = RunResults()
        self.limits = MachineSettings(robot, robot)
        self.activity: Activity | None = None
        self.emergency_stopped = False
        self.simulated: bool | None = None
        self.outputs: Mapping[str, bool] = {}
        self.bus_load_percent: float | None = None
        self.late_ms: float | None = None
        self.stood_percent: float | None = None
        self.latest = Snapshot(
            number=-1,
            time_s=time.monotonic(),
            connected=False,
            why_not="looking for the machine",
            simulated=None,
            joints=(),
            pose=None,
            links_mm=(),
            inputs={},
            outputs={},
            activity=None,
            emergency_stopped=False,
            operator=None,
        )

    @property
    def robot(self) -> Robot:
        """The robot with its present limits."""
        return self.limits.robot

    def begin(self, name: str, fraction: float | None) -> None:
        """Say what the worker does, and which part is done; None for a jog, which has no end."""
        self.activity = Activity(name, fraction, paused=False, pausable=False)

    def end(self) -> None:
        """Say that the worker does nothing any more."""
        self.activity = None
