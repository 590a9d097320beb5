"""The drawer pull without the host's heartbeat: a controlled stop, and a fault that names the heartbeat."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.bus import FrameLoss
from steptwin.host.twin.embedded.outcome import Outcome
from tests.features.faults.faulty_bus import MS, drawer_pull

HEARTBEAT = 0x77F
SILENT_COUNTS = 72_000_000
TIMEOUT_COUNTS = round(0.35 * 72e6)
ARM = range(3, 6)


def run_without_heartbeat(kernel: Kernel) -> Outcome:
    """Run the drawer pull; from 1 s after power-up on, no heartbeat reaches the board."""
    return drawer_pull(kernel, FrameLoss((HEARTBEAT,)), from_s=SILENT_COUNTS / 72e6)


@pytest.fixture(scope="module")
def lost(fast_kernel: Kernel) -> Outcome:
    return run_without_heartbeat(fast_kernel)


def test_it_ends_in_a_fault_that_names_the_heartbeat(lost: Outcome) -> None:
    assert lost.fault is not None
    assert lost.fault.message == "sx: heartbeat lost (EMCY 0x8130)"
    assert set(map(tuple, lost.fault.codes.values())) == {(0x8130,)}
    assert lost.fault.positions_agree
    assert not lost.report.passed


def test_the_arm_stops_by_a_ramp(lost: Outcome) -> None:
    """It follows the plan until the heartbeat's time is over and is at rest within 50 ms."""
    heard = [counts for counts, frame in lost.bus_log if frame.cob_id == HEARTBEAT and counts < SILENT_COUNTS]
    lost_counts = max(heard) + TIMEOUT_COUNTS
    evidence = lost.comparison.evidence
    for axis in ARM:
        assert not evidence.axes[axis].violations.counts.size
        assert evidence.axes[axis].step_counts[-1] < lost_counts + 50 * MS
        planned_s, made_s = lost.comparison.ideal[axis].time_s, lost.comparison.counted[axis].time_s
        kept = made_s < (lost_counts - evidence.start_counts) / 72e6
        assert np.abs(made_s[kept] - planned_s[: kept.sum()]).max() < 0.001
    assert evidence.axes[3].step_counts[-1] > lost_counts - 10 * MS


@pytest.mark.slow
def test_it_makes_the_same_run_every_time(fast_kernel: Kernel, lost: Outcome) -> None:
    assert run_without_heartbeat(fast_kernel).bus_log == lost.bus_log
