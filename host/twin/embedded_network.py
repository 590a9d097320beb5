"""Connect the canopen library to a simulated bus, without threads and without waiting."""

import canopen
from canopen.network import PeriodicMessageTask

from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.host.common.errors import BusError
from steptwin.host.twin.repeated_frames import RepeatedFrames
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


class EmbeddedNetwork(canopen.Network):
    """The canopen library's network on a simulated bus.

    `send_message` returns when the bus is silent again, so the library's blocking calls find their answers already
    there: nothing waits and no thread is needed. A periodic frame is sent when simulated time reaches its instant,
    while the client waits or before the next frame that the client sends.
    """

    def __init__(self, simulation: Simulation) -> None:
        super().__init__()
        self._simulation = simulation
        self._repeated = RepeatedFrames(simulation)
        simulation.host.receive = self._frame_arrived

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a data frame, and let simulated time pass until the bus is silent.

        Raises:
            BusError: the nodes' own frames never leave the bus silent.
            ValueError: the frame is a remote frame, which this bus does not have.
        """
        if remote:
            raise ValueError("the simulated board answers no remote frames; CiA 301 advises against them")
        self._send_due()
        try:
            self._simulation.send(Frame(can_id, bytes(data)))
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Repeat a data frame every `period` seconds of simulated time, from now on."""
        task = PeriodicMessageTask(can_id, data, period, self._repeated, remote)
        self._send_due()
        return task

    def _send_due(self) -> None:
        for frame in self._repeated.take_due():
            self.send_message(frame.cob_id, frame.data)

    def run_until(self, until_counts: int) -> None:
        """Let simulated time pass to an instant, or to the end of a periodic frame that is on the bus then."""
        while (due_counts := self._repeated.due_counts) is not None and due_counts < until_counts:
            self._simulation.run_until(due_counts)
            self._send_due()
        self._simulation.run_until(until_counts)

    def _frame_arrived(self, frame: Frame, counts: int) -> None:
        self.notify(frame.cob_id, bytearray(frame.data), counts / COUNTS_PER_SECOND)
