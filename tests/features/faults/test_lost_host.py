"""What is said of a host that has ended: why, and the last drive that has failed by itself."""

from types import SimpleNamespace
from typing import Any

import pytest

from steptwin.features.faults.engine import Emergency
from steptwin.features.faults.lost_host import outlive
from steptwin.protocol.cia402 import ErrorCode


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ([], "the bus is gone"),
        ([(0, ErrorCode.GROUP_STOPPED)], "the bus is gone"),
        ([(0, 0)], "the bus is gone"),
        (
            [(0, ErrorCode.HEARTBEAT_LOST), (1, ErrorCode.GROUP_STOPPED), (1, 0)],
            "the bus is gone; th1: heartbeat lost (EMCY 0x8130)",
        ),
    ],
)
def test_it_names_the_drive_whose_fault_stopped_the_others(said: list[tuple[int, int]], told: str) -> None:
    """A drive that was stopped with its group, or whose error has gone, is not the reason."""
    board: Any = SimpleNamespace(robot=SimpleNamespace(axis_names=("th1", "th2")))
    host: Any = SimpleNamespace(restart_counts=None, hangs=True)
    engine: Any = SimpleNamespace(emergencies=[Emergency(0, axis, code) for axis, code in said])
    assert outlive(board, engine, host, "the bus is gone") == told
