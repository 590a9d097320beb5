"""Note what is done to a machine beside its bus, as requests of the control port with their instants."""

from collections import deque
from typing import Any

from steptwin.emulator.faults.bus import BusFault, BusRepair
from steptwin.emulator.faults.harm import Harm
from steptwin.emulator.faults.schedule import Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.host.faults.requests import request_of
from steptwin.host.faults.target import Places
from steptwin.host.robots.robot import Robot
from steptwin.protocol.timer import COUNTS_PER_SECOND


class OperationLog:
    """Every operation on the machine of a simulation from now on, or the last ones; it takes the place of an older log.

    The simulation tells of operations; faults of the bus are noted by `note`.
    """

    def __init__(self, robot: Robot, simulation: Simulation, most: int | None = None) -> None:
        """Begin; `most` is the number of operations that are remembered, None for all."""
        self._robot = robot
        self._simulation = simulation
        self._places = Places([board.config.axis_count for board in simulation.boards])
        self._done: deque[tuple[int, Harm]] = deque(maxlen=most)
        """What was done, and its instants in counts; axes are numbered among all boards'."""
        simulation.on_operation = self._operated

    def _operated(self, scheduled: Scheduled) -> None:
        operation = self._places.on_machine(scheduled.board, scheduled.operation)
        if operation is not None:
            self._done.append((scheduled.counts, operation))

    def note(self, fault: BusFault | BusRepair) -> None:
        """Note a fault of the bus that begins now, or the end of all."""
        self._done.append((self._simulation.now_counts, fault))

    def requests(self) -> list[dict[str, Any]]:
        """Return what was done under the keys of docs/control-port.md, with `at_s` in seconds since power-up."""
        return [{"at_s": counts / COUNTS_PER_SECOND} | request_of(self._robot, harm) for counts, harm in self._done]
