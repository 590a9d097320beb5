"""Connect the canopen library to a simulated bus, without threads and without waiting.

Three of its objects wait: a PDO (`wait_for_reception`, on which `BaseNode402` builds its states and modes), a node's
NMT master (`wait_for_heartbeat`) and its EMCY consumer (`wait`). Each has a condition as a public attribute.
"""

import threading
from dataclasses import dataclass
from typing import Final

import can
import canopen
from canopen.emcy import EmcyConsumer
from canopen.network import Callback, PeriodicMessageTask
from canopen.nmt import NmtMaster
from canopen.pdo import PdoMap

from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.host.client.links import Clock
from steptwin.host.client.waiting import wait_until
from steptwin.host.common.errors import BusError
from steptwin.protocol.frame import REMOTE, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

_POLL_S: Final = 0.001


def whole_us_counts(dt_s: float) -> int:
    """Convert a duration to counts, rounded to whole microseconds, at least one unless it is 0."""
    return max(round(dt_s * 1_000_000), 1 if dt_s > 0 else 0) * COUNTS_PER_US


@dataclass(slots=True)
class _Repeated:
    """A frame that is repeated until `stop`."""

    frame: Frame
    period_counts: int
    due_counts: int
    stopped: bool = False

    def stop(self) -> None:
        self.stopped = True


class RepeatedFrames:
    """Periodic frames and their next instants; replaces python-can's bus in the library's periodic tasks."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._repeated: list[_Repeated] = []
        self.due_counts: int | None = None
        """Instant of the next periodic frame, even if it has been stopped since; None without frames."""

    def send_periodic(self, message: can.Message, period_s: float) -> _Repeated:
        """Repeat a frame from now on, until `stop` of the returned object."""
        remote = REMOTE if message.is_remote_frame else 0
        frame = Frame(message.arbitration_id | remote, bytes(message.data))
        repeated = _Repeated(frame, whole_us_counts(period_s), self._simulation.now_counts)
        self._repeated.append(repeated)
        self.due_counts = repeated.due_counts
        return repeated

    def take_due(self) -> list[Frame]:
        """Return the due frames, each once; missed repetitions are dropped."""
        now_counts = self._simulation.now_counts
        if self.due_counts is None or self.due_counts > now_counts:
            return []
        self._repeated = [repeated for repeated in self._repeated if not repeated.stopped]
        due = [repeated for repeated in self._repeated if repeated.due_counts <= now_counts]
        for repeated in due:
            passed = (now_counts - repeated.due_counts) // repeated.period_counts
            repeated.due_counts += (passed + 1) * repeated.period_counts
        self.due_counts = min((repeated.due_counts for repeated in self._repeated), default=None)
        return [repeated.frame for repeated in due]


class SimulatedCondition(threading.Condition):
    """A condition for one thread: simulated time passes while it waits, and arriving frames notify it."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock
        self._notified = False

    def wait(self, timeout: float | None = None) -> bool:
        """Let simulated time pass until the notification, at most `timeout` seconds; return whether it came."""
        self._notified = False
        wait_until(self._clock, lambda: self._notified, float("inf") if timeout is None else timeout, _POLL_S)
        return self._notified

    def notify(self, n: int = 1) -> None:
        """End the wait; also called by `notify_all`."""
        self._notified = True
        super().notify(n)


def wait_in_simulated_time(receiver: object, clock: Clock) -> None:
    """Make an object of the library wait for its frames on this clock, if it waits at all."""
    match receiver:
        case PdoMap():
            receiver.receive_condition = SimulatedCondition(clock)
            if receiver.period is None and receiver.event_timer:  # an RPDO of the board has no timer
                # By itself the library waits only from the second reception on. Before that,
                # BaseNode402.op_mode polls the last value, while no time passes.
                receiver.period = receiver.event_timer / 1000
        case NmtMaster():
            receiver.state_update = SimulatedCondition(clock)
        case EmcyConsumer():
            receiver.emcy_received = SimulatedCondition(clock)
        case _:
            pass


class EmbeddedNetwork(canopen.Network):
    """The canopen library's network on a simulated bus; implements the client's Clock.

    `send_message` returns when the bus is silent, so the library's requests find their answers at once. Its waits for
    other frames let simulated time pass. So nothing blocks and no thread is needed. A periodic frame is sent when
    simulated time reaches its instant, while the client waits or before its next frame.
    """

    def __init__(self, simulation: Simulation) -> None:
        super().__init__()
        self._simulation = simulation
        self._repeated = RepeatedFrames(simulation)
        simulation.host.receive = self._frame_arrived

    def now_s(self) -> float:
        """Return the simulated seconds since power-up."""
        return self._simulation.now_s

    def wait(self, dt_s: float) -> None:
        """Let `dt_s` seconds of simulated time pass, and complete any periodic frame on the bus.

        The time is rounded to whole microseconds, at least one, as instants in the bus log.
        """
        until_counts = self._simulation.now_counts + whole_us_counts(dt_s)
        while (due_counts := self._repeated.due_counts) is not None and due_counts < until_counts:
            self._simulation.run_until(due_counts)
            self._send_due()
        self._simulation.run_until(until_counts)

    def subscribe(self, can_id: int, callback: Callback) -> None:
        """Call a function with each frame of an identifier; its object then waits in simulated time."""
        wait_in_simulated_time(getattr(callback, "__self__", None), self)
        super().subscribe(can_id, callback)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame, and let simulated time pass until the bus is silent; a remote frame carries no data.

        Raises:
            BusError: the nodes' own frames keep the bus busy for ever.
        """
        due_counts = self._repeated.due_counts
        if due_counts is not None and due_counts <= self._simulation.now_counts:
            self._send_due()
        try:  # not by a method of our own, which would cost a call for every frame
            self._simulation.send(Frame(can_id | REMOTE, b"") if remote else Frame(can_id, bytes(data)))
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Repeat a frame every `period` seconds of simulated time, from now on."""
        task = PeriodicMessageTask(can_id, data, period, self._repeated, remote)
        self._send_due()
        return task

    def _send_due(self) -> None:
        """Send due periodic frames."""
        try:
            for frame in self._repeated.take_due():
                self._simulation.send(frame)
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def _frame_arrived(self, frame: Frame, counts: int) -> None:
        self.notify(frame.cob_id, bytearray(frame.data), counts / COUNTS_PER_SECOND)
