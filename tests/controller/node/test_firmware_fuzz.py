"""Random commands in any order and at any time: invariants of the board that no host can break."""

import struct
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import OUTPUT_PINS, Pin
from steptwin.protocol import od
from tests.controller.bench_board import BenchBoard
from tests.controller.motion.kernel_rig import Timing, pin_timing_faults

AXES = 2
H_UNITS = 16_384 * 9 // 16
"""The step rule's threshold in units, at one microstep."""

Action = Callable[[BenchBoard], None]

axes = st.integers(0, AXES - 1)


def action(function: Callable[..., object], *arguments: st.SearchStrategy[object]) -> st.SearchStrategy[Action]:
    """Return a strategy for calls of a method of the board with drawn arguments."""
    return st.tuples(*arguments).map(lambda drawn: lambda board: (function(board, *drawn), None)[1])


def records(board: BenchBoard, axis: int, segments: list[tuple[int, int, int]]) -> None:
    """Send records with the sequence numbers that the axis expects."""
    for displacement, velocity, duration_ms in segments:
        board.record(displacement, velocity, duration_ms, board.value(od.PVT_NEXT_SEQUENCE, axis), axis)


def cycles(board: BenchBoard, axis: int, ways: list[int]) -> None:
    """Send set-points a millisecond apart, each with a SYNC."""
    for way in ways:
        board.send(0x410 + axis, struct.pack("<i", board.value(od.POSITION_DEMAND, axis) + way))
        board.send(0x080, b"")
        board.wait(1)


def write(address: int, values: st.SearchStrategy[int]) -> st.SearchStrategy[Action]:
    return action(lambda board, value, axis: board.write(address, value, axis), values, axes)


segments = st.tuples(
    st.integers(-40_000, 40_000), st.sampled_from([0, 0, 65_536, -300_000, 400_000]), st.integers(0, 60)
)
actions = st.one_of(
    action(records, axes, st.lists(segments, min_size=1, max_size=5)),
    action(BenchBoard.start),
    write(od.CONTROLWORD, st.sampled_from([0x06, 0x07, 0x0F, 0x1F, 0x3F, 0x5F, 0x02, 0x00, 0x80, 0x10F, 0x11F, 0x11F])),
    write(od.BUFFER_CLEAR, st.just(0)),
    write(od.MODE_OF_OPERATION, st.sampled_from([0, 1, 3, 6, 7, 8])),
    write(od.INTERPOLATION_PERIOD, st.sampled_from([1, 2])),
    action(cycles, axes, st.lists(st.integers(-20_000, 20_000), min_size=1, max_size=10)),
    write(od.MICROSTEPS, st.sampled_from([1, 2, 8, 16, 125])),
    write(od.MAX_PROFILE_VELOCITY, st.sampled_from([1, 10**6, 8_000 * 16_384])),
    write(od.TARGET_POSITION, st.integers(-(10**7), 10**7)),
    write(od.POSITION_LIMIT_MIN, st.integers(-(10**7), 10**6)),
    write(od.POSITION_LIMIT_MAX, st.integers(-(10**6), 10**7)),
    write(od.PROFILE_VELOCITY, st.sampled_from([1, 10**5, 10**7, 2**32 - 1])),
    write(od.PROFILE_ACCELERATION, st.sampled_from([10**6, 10**8, 2**32 - 1])),
    write(od.PROFILE_DECELERATION, st.sampled_from([10**6, 10**8, 2**32 - 1])),
    write(od.MOTION_PROFILE_TYPE, st.sampled_from([0, 3])),
    write(od.TARGET_VELOCITY, st.sampled_from([0, 15, 10**6, -(10**7), 2**31 - 1])),
    write(od.HOME_OFFSET, st.integers(-(10**6), 10**6)),
    write(od.DIGITAL_OUTPUTS, st.sampled_from([0, 1 << 16, 2 << 16, 3 << 16, 0xFFFF_FFFF])),
    write(od.DIGITAL_OUTPUTS_MASK, st.sampled_from([0, 1 << 16, 2 << 16, 3 << 16])),
    write(od.CONSUMER_HEARTBEATS[0], st.sampled_from([0, 0x7F_0001, 0x7F_0005])),
    write(od.ABORT_CONNECTION_OPTION, st.integers(0, 3)),
    write(od.COMMUNICATION_ERROR_BEHAVIOUR, st.integers(0, 2)),
    write(od.STORE_ALL, st.just(int.from_bytes(b"save", "little"))),
    action(BenchBoard.send, st.just(0x77F), st.just(b"\5")),
    action(BenchBoard.nmt, st.sampled_from([1, 2, 128, 129, 130]), st.sampled_from([0, 0x10, 0x11])),
    action(BenchBoard.wait, st.sampled_from([0.1, 0.25, 1, 7, 30])),
)


def check(board: BenchBoard) -> None:
    motion = board.firmware.motion
    for node in board.firmware.nodes:
        owed_units = abs(board.value(od.FOLLOWING_ERROR_ACTUAL, node.axis))
        assert owed_units <= H_UNITS // motion.axes[node.axis].config.microsteps + 1, "a step is owed"
        assert node.drive.energised or not motion.axes[node.axis].running, "a disabled axis moves"


def check_outputs(board: BenchBoard) -> None:
    """Check that every change is a new level, in order of time, and that the last levels are those of object 60FEh."""
    changes = [change for change in board.firmware.take_pins() if change.pin in OUTPUT_PINS]
    assert changes == sorted(changes, key=lambda change: change.counts)
    levels: dict[tuple[int, Pin], int] = {(axis, pin): 0 for axis in range(AXES) for pin in OUTPUT_PINS}
    for change in changes:
        assert levels[change.axis, change.pin] != change.level
        levels[change.axis, change.pin] = change.level
    for (axis, pin), level in levels.items():
        word = board.value(od.DIGITAL_OUTPUTS, axis) & board.value(od.DIGITAL_OUTPUTS_MASK, axis)
        assert level == bool(word & OUTPUT_PINS[pin])


def release(board: BenchBoard) -> None:
    """Clear every axis' halt bit, so that halted motions come to their end."""
    board.nmt(1)
    for axis in range(AXES):
        board.write(od.CONTROLWORD, board.value(od.CONTROLWORD, axis) & ~0x100, axis)


@pytest.mark.slow
@given(script=st.lists(actions, max_size=40))
@settings(max_examples=150)
def test_invariants_hold_after_every_command(fast_kernel: Kernel, script: list[Action]) -> None:
    """No frame raises, no disabled axis moves, counter and outputs follow commands, edges keep the pulse timing."""
    board = BenchBoard(fast_kernel, AXES)
    board.enable()
    for act in script:
        act(board)
        check(board)
    release(board)
    for axis in range(AXES):
        board.write(od.CONTROLWORD, 0x07, axis)  # a motion in profile velocity does not end by itself
    board.wait(3000)
    check(board)
    check_outputs(board)
    assert not any(board.firmware.motion.axes[axis].running for axis in range(AXES))
    for edges in board.firmware.motion.take_edges():
        clk = [int(counts) for counts in edges.clk_counts]
        directions = [(int(word) >> 1, int(word) & 1) for word in edges.direction]
        assert pin_timing_faults(clk[0::2], clk[1::2], directions, Timing()) == []
