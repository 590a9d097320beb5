"""The speed limit 0x607F while the drive is switched on: it holds from the next set-point on."""

import itertools
from collections.abc import Iterator

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Mode, State, Status
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

LIMIT = od.MAX_PROFILE_VELOCITY
NEW, AT_ONCE, HALT = 0x10, 0x20, 0x100


def enabled(kernel: Kernel, mode: Mode) -> BenchBoard:
    """A board whose axis may move with 4000 steps/s."""
    board = BenchBoard(kernel)
    for address, steps in (
        (LIMIT, 4000),
        (od.PROFILE_VELOCITY, 8000),
        (od.PROFILE_ACCELERATION, 40_000),
        (od.PROFILE_DECELERATION, 40_000),
    ):
        assert board.write(address, steps * STEP) == 0
    board.enable(mode)
    return board


def word(board: BenchBoard, bits: int = 0) -> None:
    assert board.write(od.CONTROLWORD, 0x0F | bits) == 0


def set_point(board: BenchBoard, target_steps: int, bits: int = 0) -> None:
    assert board.write(od.TARGET_POSITION, target_steps * STEP) == 0
    word(board, NEW | bits)
    word(board)


def speeds(board: BenchBoard, ms: int) -> Iterator[float]:
    """Let time pass; yield the speed each ms, in steps/s."""
    for _ in range(ms):
        board.wait(1)
        yield abs(board.value(od.VELOCITY_ACTUAL)) / STEP


def stands_at(board: BenchBoard, steps: int) -> bool:
    return board.value(od.POSITION_DEMAND) == steps * STEP and not board.firmware.motion.axes[0].running


@pytest.fixture
def pp(fast_kernel: Kernel) -> BenchBoard:
    return enabled(fast_kernel, Mode.PROFILE_POSITION)


@pytest.fixture
def pv(fast_kernel: Kernel) -> BenchBoard:
    return enabled(fast_kernel, Mode.PROFILE_VELOCITY)


@pytest.fixture
def ip(fast_kernel: Kernel) -> BenchBoard:
    return enabled(fast_kernel, Mode.INTERPOLATED_POSITION)


@pytest.mark.parametrize("limit_steps", [1000, 8000])
def test_at_rest_it_holds_for_the_next_set_point(pp: BenchBoard, limit_steps: int) -> None:
    assert pp.write(LIMIT, limit_steps * STEP) == 0
    set_point(pp, 4000)
    assert max(speeds(pp, 5000)) == pytest.approx(limit_steps, rel=0.01)
    assert stands_at(pp, 4000)


@pytest.mark.parametrize("limit_steps", [1000, 8000])
def test_a_set_point_in_progress_keeps_its_speed(pp: BenchBoard, limit_steps: int) -> None:
    set_point(pp, 4000)
    pp.wait(300)
    assert pp.write(LIMIT, limit_steps * STEP) == 0
    assert max(speeds(pp, 1200)) == pytest.approx(4000, rel=0.01)
    assert stands_at(pp, 4000)
    set_point(pp, 0)
    assert max(speeds(pp, 5000)) == pytest.approx(limit_steps, rel=0.01)
    assert stands_at(pp, 0)


@pytest.mark.parametrize("limit_steps", [1000, 8000])
def test_a_set_point_on_the_fly_takes_it(pp: BenchBoard, limit_steps: int) -> None:
    set_point(pp, 40_000)
    pp.wait(300)
    assert pp.write(LIMIT, limit_steps * STEP) == 0
    set_point(pp, 8000, AT_ONCE)
    pp.wait(250)
    assert max(speeds(pp, 100)) == pytest.approx(limit_steps, rel=0.01)
    pp.wait(9000)
    assert stands_at(pp, 8000)
    assert pp.errors() == []


def test_a_halted_set_point_goes_on_within_a_lower_limit(pp: BenchBoard) -> None:
    set_point(pp, 4000)
    pp.wait(300)
    word(pp, HALT)
    pp.wait(300)
    assert pp.write(LIMIT, 1000 * STEP) == 0
    word(pp)
    assert max(speeds(pp, 5000)) <= 1000
    assert stands_at(pp, 4000)
    assert pp.state() is State.OPERATION_ENABLED


def test_a_target_velocity_takes_it(pv: BenchBoard) -> None:
    pv.write(od.TARGET_VELOCITY, -8000 * STEP)
    pv.wait(300)
    assert pv.write(LIMIT, 1000 * STEP) == 0
    assert min(speeds(pv, 500)) == pytest.approx(4000, rel=0.01)
    pv.write(od.TARGET_VELOCITY, -8000 * STEP)
    pv.wait(300)
    assert max(speeds(pv, 500)) == pytest.approx(1000, rel=0.01)
    assert pv.has(Status.INTERNAL_LIMIT)
    assert pv.write(LIMIT, 2000 * STEP) == 0
    pv.write(od.TARGET_VELOCITY, 1500 * STEP)
    pv.wait(500)
    assert max(speeds(pv, 100)) == pytest.approx(1500, rel=0.01)
    assert pv.errors() == []


class TestStreams:
    """Records planned within the limit of their stream's beginning; a higher limit holds for the next record."""

    @staticmethod
    def record(board: BenchBoard, sequence: int, steps: int, end_steps_per_s: int, ms: int = 20) -> None:
        board.record(steps * STEP, end_steps_per_s * STEP * 64 // 1000, ms, sequence)

    def cruise(self, board: BenchBoard) -> None:
        """Begin a stream that reaches 4000 steps/s and has 80 ms of it in the queue."""
        self.record(board, 0, 80, 3900, 40)
        for sequence in range(1, 5):
            self.record(board, sequence, 78, 3900)
        board.start()

    def test_a_lower_limit_waits_for_the_end_of_the_stream(self, ip: BenchBoard) -> None:
        self.cruise(ip)
        ip.wait(50)
        assert ip.write(LIMIT, 1000 * STEP) == 0
        self.record(ip, 5, 78, 3900)
        self.record(ip, 6, 80, 0, 40)
        ip.wait(300)
        assert stands_at(ip, 80 + 5 * 78 + 80)
        assert ip.errors() == []
        self.record(ip, 7, 78, 0)
        assert ip.errors() == [ErrorCode.SEGMENT_REFUSED], "the next stream has the new limit"

    def test_a_higher_limit_holds_for_the_next_record(self, ip: BenchBoard) -> None:
        self.cruise(ip)
        ip.wait(50)
        assert ip.write(LIMIT, 8000 * STEP) == 0
        self.record(ip, 5, 118, 7800)
        self.record(ip, 6, 156, 7800)
        self.record(ip, 7, 160, 0, 40)
        ip.wait(60)
        assert max(speeds(ip, 100)) == pytest.approx(7800, rel=0.01)
        ip.wait(300)
        assert stands_at(ip, 80 + 4 * 78 + 118 + 156 + 160)
        assert ip.errors() == []

    def test_records_that_wait_at_rest_keep_theirs(self, ip: BenchBoard) -> None:
        for sequence in range(2):
            self.record(ip, sequence, 40, 3900 if sequence == 0 else 0)
        assert ip.write(LIMIT, 1000 * STEP) == 0
        ip.start()
        ip.wait(100)
        assert stands_at(ip, 80)
        assert ip.errors() == []
        self.record(ip, 2, 78, 0)
        assert ip.errors() == [ErrorCode.SEGMENT_REFUSED]

    def test_cyclic_set_points_keep_it_until_they_rest(self, fast_kernel: Kernel) -> None:
        """2 steps a ms; the limit of 1 step a ms comes in their midst and holds after a rest."""
        board = enabled(fast_kernel, Mode.CYCLIC_SYNCHRONOUS_POSITION)
        way = [*itertools.accumulate([1, *[2] * 98, 1]), *[198] * 20]
        for tenth, steps in enumerate(way):
            self.cycle(board, steps * 10)
            if tenth == 50:
                assert board.write(LIMIT, 1000 * STEP) == 0
        assert stands_at(board, 1980)
        assert board.errors() == []
        for steps in (1985, 2005, 2025):
            self.cycle(board, steps)
        assert board.errors() == [ErrorCode.OVERSPEED]

    @staticmethod
    def cycle(board: BenchBoard, steps: int) -> None:
        board.send(0x410, (steps * STEP).to_bytes(4, "little", signed=True))
        board.send(0x080, b"")
        board.wait(10)


def test_what_the_driver_needs_off_stays_refused(pp: BenchBoard) -> None:
    for address in (od.MICROSTEPS, od.STEPLEN_NS, od.STEPSPACE_NS, od.DIRSETUP_NS, od.DIRHOLD_NS, od.POLARITY):
        assert pp.write(address, pp.value(address)) == AbortCode.DEVICE_STATE


def test_the_room_for_edges_follows_a_higher_limit(pv: BenchBoard) -> None:
    """14 000 steps/s after a limit of 4000: no edge is lost where the caller drains late."""
    pv.write(od.TARGET_VELOCITY, 2000 * STEP)
    pv.wait(200)
    assert pv.write(LIMIT, 14_000 * STEP) == 0
    pv.write(od.TARGET_VELOCITY, 14_000 * STEP)
    motion, rises = pv.firmware.motion, 0
    before = motion.axes[0].counter_steps
    motion.take_edges()
    for _ in range(2000):
        pv.wait(1)
        if motion.room_ticks < 8:
            rises += len(motion.take_edges()[0].clk_counts) // 2
    rises += len(motion.take_edges()[0].clk_counts) // 2
    assert rises > 20_000
    assert motion.axes[0].counter_steps - before == pytest.approx(rises, abs=2)
