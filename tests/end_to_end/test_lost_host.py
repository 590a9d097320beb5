"""The drawer pull while the host's heartbeat stays away: a controlled stop, and a fault that says so."""

import numpy as np
import pytest

from controller.backend import Kernel
from host.embedded import EmbeddedNetwork
from host.jobs import make_job
from host.planner import plan
from host.robots import load_robot
from host.run import Outcome, execute

HEARTBEAT = 0x77F
LAST_S = 3.0
TIMEOUT_S = 0.35
ARM = range(3, 6)


def run_without_heartbeat(kernel: Kernel) -> Outcome:
    """The last heartbeat comes some 3 s after power-up."""
    send = EmbeddedNetwork.send_message
    sent = 0

    def some(network: EmbeddedNetwork, can_id: int, data: bytes, remote: bool = False) -> None:
        nonlocal sent
        sent += can_id == HEARTBEAT
        if can_id != HEARTBEAT or sent <= LAST_S / 0.1:
            send(network, can_id, data, remote)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EmbeddedNetwork, "send_message", some)
        robot = load_robot("warehouse-scara")
        return execute(plan(robot, make_job(robot, "drawer-pull", {})), "drawer-pull", kernel)


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
    """It keeps to the plan until the time is over and is at rest within a few hundredths of a second."""
    lost_counts = max(counts for counts, frame in lost.bus_log if frame.cob_id == HEARTBEAT) + TIMEOUT_S * 72e6
    for axis in ARM:
        evidence = lost.comparison.evidence.axes[axis]
        assert evidence.violations == 0
        assert evidence.step_counts[-1] < lost_counts + 0.05 * 72e6
        ideal, steps_s = lost.comparison.ideal[axis], lost.comparison.counted[axis].time_s
        before = steps_s < (lost_counts - lost.comparison.evidence.start_counts) / 72e6
        assert np.abs(steps_s[before] - ideal.time_s[: before.sum()]).max(initial=0.0) < 0.001
    th1 = lost.comparison.evidence.axes[3].step_counts
    assert th1[-1] > lost_counts - 0.01 * 72e6


def test_it_does_so_every_time(fast_kernel: Kernel, lost: Outcome) -> None:
    assert run_without_heartbeat(fast_kernel).bus_log == lost.bus_log
