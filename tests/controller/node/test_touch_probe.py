"""Touch probes: positions latched at edges of IN1 and IN2 (CiA 402-2, objects 60B8h to 60BDh)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, Mode
from steptwin.protocol.nmt import NmtCommand
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.profile_bench import ProfileBench
from tests.controller.units import STEP

OFF = DigitalInput(0)
IN1, IN2 = DigitalInput.IN1, DigitalInput.IN2
POSITIONS = (
    od.TOUCH_PROBE_1_RISING,
    od.TOUCH_PROBE_1_FALLING,
    od.TOUCH_PROBE_2_RISING,
    od.TOUCH_PROBE_2_FALLING,
)


def latched(board: BenchBoard) -> list[int]:
    return [board.value(address) for address in POSITIONS]


def status(board: BenchBoard) -> int:
    return board.value(od.TOUCH_PROBE_STATUS)


def map_tpdo4(board: BenchBoard) -> None:
    """Let TPDO4 carry the status and the first position, and no other value."""
    place = od.address_of(od.TPDO_MAPPING[3])
    cob_id = od.address_of(od.TPDO_COMMUNICATION[3], od.PDO_COB_ID)
    words = (od.TOUCH_PROBE_STATUS << 8 | 16, od.TOUCH_PROBE_1_RISING << 8 | 32)
    written = ((cob_id, 0xC000_0490), (place, 0), (place + 1, words[0]), (place + 2, words[1]), (place, 2))
    for address, value in (*written, (cob_id, 0x4000_0490)):
        assert board.write(address, value) == 0


@pytest.fixture
def moving(fast_kernel: Kernel) -> ProfileBench:
    """An axis at a steady 1000 steps/s, which is a quarter of a step in a servo tick."""
    board = ProfileBench(fast_kernel, Mode.PROFILE_VELOCITY)
    board.write(od.TARGET_VELOCITY, 1000 * STEP)
    board.wait(100)
    return board


def test_the_first_edge_of_each_kind_is_latched_where_the_step_counter_stood(moving: ProfileBench) -> None:
    assert moving.write(od.TOUCH_PROBE_FUNCTION, 0x0031) == 0
    assert status(moving) == 0x0001
    rising = moving.value(od.POSITION_ACTUAL)
    moving.set_inputs(IN1)
    moving.wait(20)
    falling = moving.value(od.POSITION_ACTUAL)
    moving.set_inputs(OFF)
    moving.wait(20)
    assert latched(moving) == [rising, falling, 0, 0]
    assert falling - rising == 20 * STEP
    moving.set_inputs(IN1)
    moving.set_inputs(OFF)
    assert latched(moving) == [rising, falling, 0, 0]
    assert status(moving) == 0x0007


def test_continuous_latches_every_edge(moving: ProfileBench) -> None:
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x1300)
    for _ in range(3):
        moving.wait(7)
        moving.set_inputs(IN2)
        assert latched(moving) == [0, 0, moving.value(od.POSITION_ACTUAL), 0]
        assert status(moving) == 0x0300
        moving.set_inputs(OFF)


def test_each_probe_looks_at_its_own_input_and_edge(moving: ProfileBench) -> None:
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x2111)  # probe 1 rising, probe 2 falling
    moving.set_inputs(IN2)
    assert status(moving) == 0x0101
    moving.set_inputs(IN1)
    assert status(moving) == 0x0503
    one, two = moving.value(od.POSITION_ACTUAL), moving.value(od.POSITION_ACTUAL)
    assert latched(moving) == [one, 0, 0, two]


@pytest.mark.parametrize("function", [0x0001, 0x0010, 0x0030, 0x0002])
def test_a_probe_that_is_off_or_wants_no_edge_latches_nothing(moving: ProfileBench, function: int) -> None:
    assert moving.write(od.TOUCH_PROBE_FUNCTION, function) == 0
    moving.set_inputs(IN1)
    moving.set_inputs(OFF)
    assert latched(moving) == [0] * 4
    assert status(moving) == function & 1


def test_switching_an_edge_off_and_on_arms_it_again_and_keeps_the_position(moving: ProfileBench) -> None:
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0031)
    moving.set_inputs(IN1)
    first = latched(moving)[0]
    moving.set_inputs(OFF)
    assert status(moving) == 0x0007
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0021)
    assert status(moving) == 0x0005
    assert latched(moving)[0] == first
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0031)
    moving.wait(10)
    moving.set_inputs(IN1)
    assert latched(moving)[0] == moving.value(od.POSITION_ACTUAL) > first
    moving.write(od.TOUCH_PROBE_FUNCTION, 0)
    assert status(moving) == 0


@pytest.mark.parametrize("function", [0x0005, 0x0015, 0x0009, 0x000D, 0x0041, 0x0081, 0x0500, 0x4000, 0x8000])
def test_zero_pulses_other_sources_and_the_manufacturers_bits_are_refused(board: BenchBoard, function: int) -> None:
    """0x0609_0030, "invalid value for parameter", and the function stays."""
    board.write(od.TOUCH_PROBE_FUNCTION, 0x0011)
    assert board.write(od.TOUCH_PROBE_FUNCTION, function) == 0x0609_0030
    assert board.value(od.TOUCH_PROBE_FUNCTION) == 0x0011
    assert status(board) == 0x0001


def test_a_reset_of_the_node_switches_the_probes_off(moving: ProfileBench) -> None:
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0031)
    moving.set_inputs(IN1)
    moving.nmt(NmtCommand.RESET_NODE)
    moving.wait(1000)
    assert status(moving) == moving.value(od.TOUCH_PROBE_FUNCTION) == 0
    assert latched(moving) == [0] * 4


def test_a_status_in_a_pdo_is_sent_when_an_edge_comes(moving: ProfileBench) -> None:
    moving.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0011)
    map_tpdo4(moving)
    moving.nmt(NmtCommand.START)
    moving.wait(1)
    moving.set_inputs(IN1)
    position = latched(moving)[0]
    moving.wait(1)
    assert moving.last(0x490) == (3).to_bytes(2, "little") + position.to_bytes(4, "little", signed=True)


def test_each_edge_of_a_continuous_probe_is_sent_although_the_status_stays(moving: ProfileBench) -> None:
    moving.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    moving.write(od.TOUCH_PROBE_FUNCTION, 0x0013)
    map_tpdo4(moving)
    moving.nmt(NmtCommand.START)
    moving.wait(1)
    for _ in range(3):
        moving.wait(5)
        moving.set_inputs(IN1)
        position = latched(moving)[0]
        moving.set_inputs(OFF)
        moving.wait(1)
        assert moving.last(0x490) == (3).to_bytes(2, "little") + position.to_bytes(4, "little", signed=True)


@pytest.mark.slow
@given(
    functions=st.lists(st.integers(0, 0x3F).map(lambda bits: bits & 0x33), min_size=1, max_size=4),
    levels=st.lists(st.booleans(), max_size=12),
)
def test_a_stored_edge_is_one_that_came_while_it_was_wanted(
    fast_kernel: Kernel, functions: list[int], levels: list[bool]
) -> None:
    """Against a model of one probe in CiA 402-2's words."""
    board = BenchBoard(fast_kernel)
    level, stored = False, [False, False]
    for function in functions:
        board.write(od.TOUCH_PROBE_FUNCTION, function)
        wanted = [bool(function & 1 and function & bit) for bit in (0x10, 0x20)]
        stored = [kept and want for kept, want in zip(stored, wanted, strict=True)]
        for new in levels:
            board.set_inputs(IN1 if new else OFF)
            if new != level:
                stored[level] |= wanted[level]
            level = new
        assert status(board) == (function & 1) | stored[0] << 1 | stored[1] << 2
