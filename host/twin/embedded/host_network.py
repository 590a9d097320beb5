"""The network of a host with faults: it stands between the client and the simulated bus, in simulated time.

The client notices nothing: a wait or a frame takes longer, or never returns. While the program hangs, the bus interface
goes on with the periodic heartbeat, as the kernel's broadcast manager does; a program that has died has none.
"""

from collections.abc import Callable
from typing import Final

from steptwin.emulator.simulation import Simulation
from steptwin.host.faults.engine import HostCondition, HostLostError
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from steptwin.protocol.frame import COB_RPDO, FIRST_NODE_ID, NODE_ID_MAX

_HANGING_S: Final = 0.01
"""Time after which it is seen whether the program goes on."""
_RECORDS: Final = range(COB_RPDO[3] + FIRST_NODE_ID, COB_RPDO[3] + NODE_ID_MAX + 1)
"""Identifiers of the points of all nodes."""


class FaultyNetwork(EmbeddedNetwork):
    """An embedded network whose client hangs, dies, is late or sends points out of order, as its condition says."""

    def __init__(self, simulation: Simulation, condition: HostCondition, moving: Callable[[], bool]) -> None:
        """Connect a client.

        Args:
            simulation: the simulated boards.
            condition: how the client is; it may change at any instant.
            moving: returns whether the machine moves: a client is left when it stands, unless it is known to go on.
        """
        super().__init__(simulation)
        self._condition = condition
        self._moving = moving
        self._held: dict[int, bytes] = {}
        """The point of each identifier that waits for the one that follows it."""

    def wait(self, dt_s: float) -> None:
        """Let simulated time pass, more if the client is late; raises HostLostError if it never goes on."""
        self._go_on()
        super().wait(dt_s + self._condition.late_s)
        self._go_on()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame, or hold a point back until the next one has been sent; raises as `wait`."""
        self._go_on()
        if can_id in _RECORDS and (self._condition.disordered or can_id in self._held):
            held = self._held.pop(can_id, None)
            if held is None:
                self._held[can_id] = bytes(data)
                return
            super().send_message(can_id, data, remote)
            data = held
        super().send_message(can_id, data, remote)
        self._go_on()

    def _send_due(self) -> None:
        if self._condition.dead:
            self._repeated.take_due()  # they lapse: a wait in which the program dies goes on without them
        else:
            super()._send_due()

    def _go_on(self) -> None:
        """Return when the client goes on."""
        condition = self._condition
        while condition.hangs and not condition.dead:
            moves = self._moving()
            super().wait(_HANGING_S)
            if not (moves or condition.goes_on):
                raise HostLostError("the host hung")
        if condition.dead:
            raise HostLostError("the host died")
