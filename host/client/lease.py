"""Be the one program in charge of a machine: each node lends itself to one program at a time (object 2017h).

The board decides: a node takes a token only while it has none. A program claims the nodes in the order of their ids, so
that of two programs one gets them all. Other programs hear the answers to a claim, too; `OpenRequests` keeps them
apart. A claim counts when the node then holds the token, which every program reads alike.

A node forgets the token when it loses a heartbeat, and when it has monitored none for a second: docs/canopen.md.
"""

import secrets
from collections.abc import Sequence
from contextlib import suppress

from steptwin.host.client.axis import AxisClient
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.protocol import od
from steptwin.protocol.entry import DataType
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS


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
