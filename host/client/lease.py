"""Lease and heartbeat: be the only program in charge of a machine, and let it detect the loss of this program.

Each node accepts one program at a time (object 2017h): it accepts a token only while it has none. A program claims the
nodes in the order of their ids, so one of two programs gets all of them. Other programs also receive the answers to a
claim; `OpenRequests` separates them. A claim is successful if the node then returns the token, which all programs read
alike. A node forgets the token when it loses a heartbeat, or when it has monitored none for a second: docs/protocol.md.

Axes that monitor the host's heartbeat stop when it ends. The network repeats the heartbeat, also during a long SDO
transfer: a bus interface by its own timer, the embedded network by simulated time. The heartbeat has the lowest
priority of all frames, so the axes also lose the host if the bus is never idle.
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
"""Heartbeat time-out: two heartbeats may be lost and the third half a period late. A full queue lasts longer."""
WATCH_HOST: Final = HOST_NODE_ID << 16 | TIMEOUT_MS
"""Consumer heartbeat time (1016h) with which a node monitors this host."""
_FRAME: Final = COB_HEARTBEAT + HOST_NODE_ID, bytes((NmtState.OPERATIONAL,))


class Lease:
    """A program's claim on the axes of a machine, with its own token."""

    def __init__(self, axes: Sequence[AxisClient], token: int | None = None) -> None:
        """Create a lease without claiming; the default token is random, so no other program has it."""
        self._axes = axes
        self._token = 1 + secrets.randbelow(DataType.UNSIGNED32.high) if token is None else token

    def require_free(self) -> None:
        """Raise BusError if another program is in charge of an axis; the machine is not changed."""
        for axis in self._axes:
            if axis.read(od.CHARGE_TOKEN) not in (CHARGE_FREE, self._token):
                raise _taken(axis)

    def claim(self) -> None:
        """Claim all axes; if another program has one of them, claim none and raise BusError."""
        for axis in self._axes:
            if not self._take(axis):
                self.release()
                raise _taken(axis)

    def keep(self) -> None:
        """Claim axes again that were lost since `claim`; raises as `claim`."""
        for axis in self._axes:
            if axis.read(od.CHARGE_TOKEN) != self._token and not self._take(axis):
                self.release()
                raise _taken(axis)

    def _take(self, axis: AxisClient) -> bool:
        with suppress(DeviceFaultError):  # refused
            axis.write(od.CHARGE_TOKEN, self._token)
        return axis.read(od.CHARGE_TOKEN) == self._token

    def release(self) -> None:
        """Release all axes of this program; if one does not answer, the axes release themselves later."""
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
    """The heartbeat of this host, from `start` until `stop`."""

    def __init__(self, network: canopen.Network) -> None:
        self._network = network
        self._task: PeriodicMessageTask | None = None

    def start(self) -> None:
        """Send the first frame now and repeat it; do nothing if it has already been started."""
        if self._task is None:
            self._task = self._network.send_periodic(*_FRAME, PERIOD_S)

    def beat(self) -> None:
        """Send one frame now: a node monitors this host from its first heartbeat on (CiA 301)."""
        self._network.send_message(*_FRAME)

    def stop(self) -> None:
        """Stop sending; axes that still monitor this host detect its loss."""
        if self._task is not None:
            self._task.stop()  # type: ignore[no-untyped-call]
            self._task = None
