"""Connect the canopen library to a simulated bus, without threads and without waiting."""

import canopen
from canopen.network import Callback, PeriodicMessageTask

from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.host.common.errors import BusError
from steptwin.host.twin.repeated_frames import RepeatedFrames, whole_us_counts
from steptwin.host.twin.simulated_waiting import wait_in_simulated_time
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


class EmbeddedNetwork(canopen.Network):
    """The canopen library's network on a simulated bus; fulfils the client's Clock.

    `send_message` returns when the bus is silent again, so the library's requests find their answers already there. Its
    waits for other frames let simulated time pass. So nothing blocks and no thread is needed. A periodic frame is sent
    when simulated time reaches its instant, while the client waits or before the next frame that the client sends.
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
        """Let `dt_s` seconds of simulated time pass, and the rest of a periodic frame that is on the bus then.

        They are rounded to whole microseconds, at least one: the bus log, in microseconds, then tells every instant.
        """
        until_counts = self._simulation.now_counts + whole_us_counts(dt_s)
        while (due_counts := self._repeated.due_counts) is not None and due_counts < until_counts:
            self._simulation.run_until(due_counts)
            self._send_due()
        self._simulation.run_until(until_counts)

    def subscribe(self, can_id: int, callback: Callback) -> None:
        """Have a function called with each frame of an identifier; what it belongs to then waits in simulated time."""
        wait_in_simulated_time(getattr(callback, "__self__", None), self)
        super().subscribe(can_id, callback)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a data frame, and let simulated time pass until the bus is silent.

        Raises:
            BusError: the nodes' own frames never leave the bus silent.
            ValueError: the frame is a remote frame, which this bus does not have.
        """
        if remote:
            raise ValueError("the simulated board answers no remote frames; CiA 301 advises against them")
        due_counts = self._repeated.due_counts
        if due_counts is not None and due_counts <= self._simulation.now_counts:
            self._send_due()
        try:  # not by a method of our own, which would be one more call for every frame
            self._simulation.send(Frame(can_id, bytes(data)))
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Repeat a data frame every `period` seconds of simulated time, from now on."""
        task = PeriodicMessageTask(can_id, data, period, self._repeated, remote)
        self._send_due()
        return task

    def _send_due(self) -> None:
        """Send the periodic frames that are due."""
        try:
            for frame in self._repeated.take_due():
                self._simulation.send(frame)
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def _frame_arrived(self, frame: Frame, counts: int) -> None:
        self.notify(frame.cob_id, bytearray(frame.data), counts / COUNTS_PER_SECOND)
