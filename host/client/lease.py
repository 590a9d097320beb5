"""Be the one program in charge of a machine, and let it notice when this program is gone: lease and heartbeat.

Each node lends itself to one program at a time (object 2017h). The board decides: a node takes a token only while it
has none. A program claims the nodes in the order of their ids, so that of two programs one gets them all. Other
programs hear the answers to a claim, too; `OpenRequests` keeps them apart. A claim counts when the node then holds the
token, which every program reads alike. A node forgets the token when it loses a heartbeat, and when it has monitored
none for a second: docs/canopen.md.

Axes that watch the host's heartbeat stop by themselves when it stops. The network repeats it, also between the frames
of a long SDO dialogue: a bus interface by its own timer, the embedded network by simulated time. Of all frames the
heartbeat has the lowest priority, so the axes take a host for lost, too, if the bus is never idle.
"""

import secrets
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

import canopen
from canopen.network import PeriodicMessageTask

from steptwin.host.client.axis import AxisClient
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.protocol import od
from steptwin.protocol.entry import DataType
from steptwin.protocol.frame import COB_HEARTBEAT, HOST_NODE_ID
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS

PERIOD_S: Final = 0.1
TIMEOUT_MS: Final = 350
"""Two heartbeats may be lost and the third half a period late; a queue of 64 records of 10 ms lasts longer."""
WATCH_HOST: Final = HOST_NODE_ID << 16 | TIMEOUT_MS
"""The consumer heartbeat time (1016h) that makes a node watch this host."""
_FRAME: Final = COB_HEARTBEAT + HOST_NODE_ID, bytes((NmtState.OPERATIONAL,))


class Lease:
    """A program's claim on the axes of a machine, under a token of its own."""

    def __init__(self, axes: Sequence[AxisClient], token: int | None = None) -> None:
        """Claim nothing yet; by default the token is random, so that no other program has it."""
        self._axes = axes
        self._token = 1 + secrets.randbelow(DataType.UNSIGNED32.high) if token is None else token

    def require_free(self) -> None:
        """Raise BusError if another program is in charge of an axis; nothing on the machine changes."""
        for axis in self._axes:
            if axis.read(od.CHARGE_TOKEN) not in (CHARGE_FREE, self._token):
                raise _taken(axis)

    def claim(self) -> None:
        """Claim all axes; raise BusError, with nothing claimed, if another program has one."""
        for axis in self._axes:
            if not self._take(axis):
                self.release()
                raise _taken(axis)

    def keep(self) -> None:
        """Claim again what was lost since `claim`; raises as it does."""
        for axis in self._axes:
            if axis.read(od.CHARGE_TOKEN) != self._token and not self._take(axis):
                self.release()
                raise _taken(axis)

    def _take(self, axis: AxisClient) -> bool:
        with suppress(DeviceFaultError):  # refused
            axis.write(od.CHARGE_TOKEN, self._token)
        return axis.read(od.CHARGE_TOKEN) == self._token

    def release(self) -> None:
        """Give back what this program holds; if an axis does not answer, the rest forget this program by themselves."""
        with suppress(BusError):
            for axis in self._axes:
                with suppress(DeviceFaultError):  # another program holds it
                    axis.write(od.CHARGE_RELEASE, self._token)


def _taken(axis: AxisClient) -> BusError:
    taken, wait = "another program is in charge of the machine", "wait for its end"
    killed = f"up to {CHARGE_UNWATCHED_MS / 1000:g} s if it was killed"
    return BusError(
        f"{taken}, says {axis.name} (node 0x{axis.node_id:02X}): {wait}, {killed}; "
        "`steptwin stop` and `estop` work at any time"
    ).plainly(f"{taken}: {wait}, {killed}; you can stop the machine at any time")


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
