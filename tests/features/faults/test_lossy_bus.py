"""The drawer pull on a bad bus: the host sends lost records again, in order; CAN repeats disturbed frames."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.bus import FrameCorruption, FrameDelay, FrameLoss, SenderOff
from steptwin.host.common.errors import BusError
from steptwin.protocol.frame import COB_SYNC
from tests.features.faults.faulty_bus import MS, drawer_pull, strikes
from tests.messages import refusing

pytestmark = pytest.mark.usefixtures("impatient")

RPDO4 = range(0x510, 0x518)


def losing(part: float) -> FrameLoss:
    """Return the fault that loses this part of all PVT records."""
    return FrameLoss(RPDO4, rate=part)


@pytest.mark.parametrize(
    ("part", "duration_s"), [pytest.param(0.002, 10.0, marks=pytest.mark.slow), (0.01, 2.0), (0.05, 2.0)]
)
def test_lost_records_are_sent_again(fast_kernel: Kernel, part: float, duration_s: float) -> None:
    outcome = drawer_pull(fast_kernel, losing(part), duration_s=duration_s)
    assert strikes(outcome) > 5
    assert outcome.fault is None
    assert outcome.report.passed, outcome.report.reasons


@pytest.mark.slow
def test_a_line_too_bad_to_keep_up_ends_in_an_underrun(fast_kernel: Kernel) -> None:
    """Two of five records get lost: the queues fill before the start, then run dry, and the board stops itself."""
    outcome = drawer_pull(fast_kernel, losing(0.4), duration_s=10.0)
    assert outcome.fault is not None
    assert outcome.fault.positions_agree
    assert 0xFF01 in [code for codes in outcome.fault.codes.values() for code in codes]


def test_a_lost_sync_is_noticed(fast_kernel: Kernel) -> None:
    outcome = drawer_pull(fast_kernel, FrameLoss((COB_SYNC,)))
    assert outcome.fault is not None
    assert "not all axes start within 1 s" in outcome.fault.message
    assert outcome.verdicts["faults"].passed, outcome.verdicts


@pytest.mark.slow
def test_a_dead_line_never_starts(fast_kernel: Kernel) -> None:
    with refusing(BusError):
        drawer_pull(fast_kernel, losing(1.0))


@pytest.mark.slow
def test_a_noisy_line_costs_bits_and_nothing_else(fast_kernel: Kernel) -> None:
    """One attempt in twenty is disturbed: CAN itself repeats it, no record is missing and no node reports an error."""
    outcome = drawer_pull(fast_kernel, FrameCorruption(rate=0.05))
    assert strikes(outcome) > 60
    assert outcome.report.passed, outcome.report.reasons
    assert not [frame for _, frame in outcome.bus_log if frame.cob_id - 0x80 in range(0x10, 0x18)]


def test_a_hold_up_is_bridged_by_the_queues(fast_kernel: Kernel) -> None:
    """In the middle of the motion a record waits 100 ms in the host's controller."""
    outcome = drawer_pull(fast_kernel, FrameDelay(RPDO4, count=1, delay_counts=100 * MS), from_s=1.5)
    assert strikes(outcome) == 1
    assert outcome.report.passed, outcome.report.reasons
    assert not [frame for _, frame in outcome.bus_log if frame.cob_id - 0x80 in range(0x10, 0x18)]


def test_a_board_that_leaves_the_bus_stops_all_its_axes(fast_kernel: Kernel) -> None:
    """The host learns of it when the board is back."""
    outcome = drawer_pull(fast_kernel, SenderOff(range(0x190, 0x198), count=1), from_s=1.5)
    assert strikes(outcome) == 1
    assert "0x8140" in str(outcome.fault)
    emergencies = [frame for _, frame in outcome.bus_log if frame.cob_id - 0x80 in range(0x10, 0x18)]
    assert sorted(frame.data[:3] for frame in emergencies) == [b"\x40\x81\x11"] * 6


@pytest.mark.slow
def test_the_same_faults_make_the_same_run(fast_kernel: Kernel) -> None:
    runs = [
        drawer_pull(fast_kernel, FrameCorruption(rate=0.01), losing(0.01), seed=7, duration_s=1.2) for _ in range(2)
    ]
    assert runs[0].bus_log == runs[1].bus_log
    assert runs[0].verdicts == runs[1].verdicts
