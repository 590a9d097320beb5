"""The host's heartbeat: axes that were told to watch it stop by themselves when it stays away.

While a client lives, its network repeats the heartbeat, also in between the frames of a long SDO dialogue: a bus
interface by its own timer, the embedded network by simulated time. It has the lowest priority of all frames, so a bus
without a pause counts as a lost host.
"""

from typing import Final

import canopen
from canopen.network import PeriodicMessageTask

from steptwin.protocol.frame import COB_HEARTBEAT, HOST_NODE_ID
from steptwin.protocol.nmt import NmtState

PERIOD_S: Final = 0.1
TIMEOUT_MS: Final = 350
"""Two heartbeats may get lost and the third be half a period late; a queue of 64 records of 10 ms lasts longer."""
WATCH_HOST: Final = HOST_NODE_ID << 16 | TIMEOUT_MS
"""The entry of 0x1016 that names this host."""


class Heartbeat:
    """Says that this host is there, from `start` to `stop`."""

    def __init__(self, network: canopen.Network) -> None:
        self._network = network
        self._task: PeriodicMessageTask | None = None

    def start(self) -> None:
        """Send the first one now, unless it is beating already."""
        if self._task is None:
            frame = COB_HEARTBEAT + HOST_NODE_ID, bytes((NmtState.OPERATIONAL,))
            self._task = self._network.send_periodic(*frame, PERIOD_S)

    def stop(self) -> None:
        """Fall silent; axes that still watch take the host for lost."""
        if self._task is not None:
            self._task.stop()  # type: ignore[no-untyped-call]
            self._task = None
