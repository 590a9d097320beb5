"""Boards of a machine that are lost amid a motion: stop what the others still do."""

from collections.abc import Sequence
from contextlib import suppress

from steptwin.host.client.axis import AxisClient
from steptwin.host.common.errors import BusError
from steptwin.protocol.cia402 import QUICK_STOP, State


def stop_the_rest(axes: Sequence[AxisClient]) -> None:
    """Quick-stop the axes that may still follow a trajectory after something has ended it for others.

    The axes of one board stop together by themselves, those of another board do not.
    """
    with suppress(BusError):  # the error that has ended the trajectory is what matters
        for axis in axes:
            if axis.drive_status is None or axis.drive_status.state is State.OPERATION_ENABLED:
                axis.send_interpolation_controlword(QUICK_STOP)
