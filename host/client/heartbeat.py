"""Send the host's heartbeat; axes that watch it stop by themselves when it stops.

The network repeats the heartbeat, also between the frames of a long SDO dialogue: a bus interface by its own timer, the
embedded network by simulated time. Of all frames the heartbeat has the lowest priority, so the axes take a host for
lost, too, if the bus is never idle.
"""

from typing import Final

import canopen
from canopen.network import PeriodicMessageTask

from steptwin.protocol.frame import COB_HEARTBEAT, HOST_NODE_ID
from steptwin.protocol.nmt import NmtState

PERIOD_S: Final = 0.1
TIMEOUT_MS: Final = 350
"""Two heartbeats may be lost and the third half a period late; a queue of 64 records of 10 ms lasts longer."""
WATCH_HOST: Final = HOST_NODE_ID << 16 | TIMEOUT_MS
"""The consumer heartbeat time (1016h) that makes a node watch this host."""
_FRAME: Final = COB_HEARTBEAT + HOST_NODE_ID, bytes((NmtState.OPERATIONAL,))


class Heartbeat:
    """The heartbeat of this host, sent from `start` until `stop`."""

    def __init__(self, network: canopen.Network) -> None:
        self._network = network
        self._task: PeriodicMessageTask | None = None

    def start(self) -> None:
        """Send the first frame now and repeat it, unless the heartbeat has been started already."""
        if self._task is None:
            self._task = self._network.send_periodic(*_FRAME, PERIOD_S)

    def beat(self) -> None:
        """Send one frame at once: a node monitors this host from the first heartbeat that it receives (CiA 301)."""
        self._network.send_message(*_FRAME)

    def stop(self) -> None:
        """Stop sending; axes that still watch this host take it for lost."""
        if self._task is not None:
            self._task.stop()  # type: ignore[no-untyped-call]
            self._task = None
