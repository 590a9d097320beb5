"""Let the canopen library wait for a frame in simulated time, where it would block until another thread delivers it.

Three of its objects wait so: a PDO (`wait_for_reception`, on which `BaseNode402` builds its states and modes), a node's
NMT master (`wait_for_heartbeat`) and its EMCY consumer (`wait`). Each has a condition as a public attribute.
"""

import threading
from typing import Final

from canopen.emcy import EmcyConsumer
from canopen.nmt import NmtMaster
from canopen.pdo import PdoMap

from steptwin.host.client.link import Clock
from steptwin.host.client.waiting import wait_until

_POLL_S: Final = 0.001


class SimulatedCondition(threading.Condition):
    """A condition for one thread: while it waits, simulated time passes, and frames that arrive then notify it."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock
        self._notified = False

    def wait(self, timeout: float | None = None) -> bool:
        """Let simulated time pass until the notification, but not more than `timeout` seconds; return if it came."""
        self._notified = False
        wait_until(self._clock, lambda: self._notified, float("inf") if timeout is None else timeout, _POLL_S)
        return self._notified

    def notify(self, n: int = 1) -> None:
        """End the wait; `notify_all` calls this as well."""
        self._notified = True
        super().notify(n)


def wait_in_simulated_time(receiver: object, clock: Clock) -> None:
    """Make an object of the library that receives frames wait for them on this clock, if it is one that waits."""
    match receiver:
        case PdoMap():
            receiver.receive_condition = SimulatedCondition(clock)
            if receiver.period is None and receiver.event_timer:  # an RPDO of the board has no timer
                # By itself the library waits only from the second reception on. Before that, BaseNode402.op_mode looks
                # again and again at the last value, while no time passes.
                receiver.period = receiver.event_timer / 1000
        case NmtMaster():
            receiver.state_update = SimulatedCondition(clock)
        case EmcyConsumer():
            receiver.emcy_received = SimulatedCondition(clock)
        case _:
            pass
