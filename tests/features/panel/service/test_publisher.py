"""What the panel shows of a machine's queues of motion."""

from types import SimpleNamespace
from typing import cast

import pytest

from steptwin.features.panel.service.snapshots import queue_fill
from steptwin.host.client.drive_status import DriveStatus
from steptwin.host.operate.session import Session


@pytest.mark.parametrize(
    ("free", "interpolating", "fill"),
    [
        ((16, 48, 0), (True, True, True), 0.25),
        ((16, 48, 0), (True, False, True), 0.75),
        ((64, 16, 16), (False, True, True), 0.75),
        ((None, 0, 32), (True, True, True), 0.5),
        ((0, 0, 0), (False, False, False), None),
    ],
)
def test_the_least_filled_queue_of_the_axes_in_motion(
    free: tuple[int | None, ...], interpolating: tuple[bool, ...], fill: float | None
) -> None:
    """Of 64 records; an axis that has not reported its queue does not count, nor one that executes no trajectory."""
    axes = [SimpleNamespace(pvt_status=None if n is None else SimpleNamespace(free=n)) for n in free]
    session = cast(Session, SimpleNamespace(machine=SimpleNamespace(axes=axes)))
    drives = [cast(DriveStatus, SimpleNamespace(interpolating=moves)) for moves in interpolating]
    assert queue_fill(session, drives) == fill
