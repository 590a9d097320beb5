"""Stops are one-way: each ends where its option code says, whatever another master's controlword says meanwhile.

The tables are CiA 402-2's: transition 16 leads from QUICK STOP ACTIVE only with the option codes 5 to 8.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, Mode, State
from steptwin.protocol.frame import Frame
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

RTSO, SO, OE = State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED
SOD, QSA = State.SWITCH_ON_DISABLED, State.QUICK_STOP_ACTIVE
REACTION, FAULT = State.FAULT_REACTION_ACTIVE, State.FAULT
SPEED: Final = 2_000 * STEP
WORDS: Final = (0x0F, 0x1F, 0x10F, 0x07, 0x06, 0x02, 0x00, 0x80, 0x8F)
"""Enable operation, with and without modes' bits, disable, shutdown, quick stop, disable voltage, reset."""


def word(controlword: int) -> Callable[[BenchBoard], None]:
    def give(board: BenchBoard) -> None:
        assert board.write(od.CONTROLWORD, controlword) == 0

    return give


def nmt_stop_and_start(board: BenchBoard) -> None:
    board.nmt(2)
    board.nmt(1)


def estop(board: BenchBoard) -> None:
    board.set_inputs(DigitalInput.ESTOP)
    board.set_inputs(DigitalInput(0))


def limit_switch(board: BenchBoard) -> None:
    board.set_inputs(DigitalInput.POSITIVE_LIMIT)


def emergency_stop(board: BenchBoard) -> None:
    assert board.write(od.EMERGENCY_STOP, 1) == 0


class Stop(NamedTuple):
    """A stop from motion: its options, its command, the state while it ramps, the state it ends in."""

    options: dict[int, int]
    begin: Callable[[BenchBoard], None]
    meanwhile: State | None
    """None: it is a cut."""
    end: State


QUICK_STOP_ENDS: Final = {0: (None, SOD), 1: (QSA, SOD), 2: (QSA, SOD), 5: (QSA, QSA), 6: (QSA, QSA)}
FAULT_REACTIONS: Final = {0: (None, FAULT), 1: (REACTION, FAULT), 2: (REACTION, FAULT)}
STOPS: Final[dict[str, Stop]] = {
    **{f"quick stop {i}": Stop({od.QUICK_STOP_OPTION: i}, word(0x02), *to) for i, to in QUICK_STOP_ENDS.items()},
    **{
        f"lost connection by quick stop {i}": Stop(
            {od.ABORT_CONNECTION_OPTION: 3, od.QUICK_STOP_OPTION: i}, nmt_stop_and_start, *to
        )
        for i, to in QUICK_STOP_ENDS.items()
    },
    "lost connection, disable": Stop({od.ABORT_CONNECTION_OPTION: 2}, nmt_stop_and_start, None, SOD),
    **{
        f"lost connection, fault {i}": Stop(
            {od.ABORT_CONNECTION_OPTION: 1, od.FAULT_REACTION_OPTION: i}, nmt_stop_and_start, *to
        )
        for i, to in FAULT_REACTIONS.items()
    },
    "shutdown 0": Stop({od.SHUTDOWN_OPTION: 0}, word(0x06), None, RTSO),
    "shutdown 1": Stop({od.SHUTDOWN_OPTION: 1}, word(0x06), OE, RTSO),
    "disable operation 0": Stop({od.DISABLE_OPERATION_OPTION: 0}, word(0x07), None, SO),
    "disable operation 1": Stop({od.DISABLE_OPERATION_OPTION: 1}, word(0x07), OE, SO),
    "disable voltage": Stop({}, word(0x00), None, SOD),
    **{
        f"limit switch {i}": Stop({od.FAULT_REACTION_OPTION: i}, limit_switch, *to) for i, to in FAULT_REACTIONS.items()
    },
    **{f"e-stop {i}": Stop({od.FAULT_REACTION_OPTION: i}, estop, REACTION, FAULT) for i in range(3)},
    "emergency stop": Stop({}, emergency_stop, REACTION, FAULT),
}
AT_REST: Final[dict[State, dict[int, State]]] = {
    SOD: {0x06: RTSO},
    RTSO: {0x0F: OE, 0x1F: OE, 0x10F: OE, 0x8F: OE, 0x07: SO, 0x02: SOD, 0x00: SOD, 0x80: SOD},
    SO: {0x0F: OE, 0x1F: OE, 0x10F: OE, 0x8F: OE, 0x06: RTSO, 0x02: SOD, 0x00: SOD, 0x80: SOD},
    QSA: {0x0F: OE, 0x1F: OE, 0x10F: OE, 0x8F: OE, 0x00: SOD, 0x80: SOD},
    FAULT: {},  # the fault reset acts when its bit rises
}
"""The state to which a word leads from the state in which a stop has ended; others change nothing."""


def moving(kernel: Kernel, options: dict[int, int]) -> BenchBoard:
    """Return an axis at SPEED in profile velocity mode, which stops within 5 ms."""
    board = BenchBoard(kernel)
    rates = (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION)
    for address, value in {**dict.fromkeys(rates, 400_000 * STEP), **options}.items():
        assert board.write(address, value) == 0
    board.enable(Mode.PROFILE_VELOCITY)
    board.write(od.TARGET_VELOCITY, SPEED)
    board.wait(20)
    assert board.value(od.VELOCITY_ACTUAL) == SPEED
    return board


def running(board: BenchBoard) -> bool:
    return board.firmware.motion.axes[0].running


def harder(stop: Stop, controlword: int) -> Stop:
    """Return the stop that a word makes of one that ramps: only a stop that leads further replaces it."""
    off = Stop({}, word(0), None, SOD)
    if stop.meanwhile in (OE, QSA) and controlword in (0x00, 0x80):
        return off
    if stop.meanwhile is OE and controlword == 0x02:
        return stop._replace(meanwhile=QSA, end=SOD)
    if stop.meanwhile is OE and controlword == 0x06:
        return stop._replace(end=RTSO)
    return stop


@pytest.mark.parametrize("controlword", WORDS, ids=hex)
@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS)
def test_every_stop_ends_where_its_option_says(fast_kernel: Kernel, stop: Stop, controlword: int) -> None:
    """The word is repeated every millisecond, with a target velocity, from the stop on."""
    board = moving(fast_kernel, stop.options)
    stop.begin(board)
    assert running(board) is (stop.meanwhile is not None)
    assert board.state() is (stop.meanwhile or stop.end)
    speed = board.value(od.VELOCITY_ACTUAL)
    if running(board):
        stop = harder(stop, controlword)
    previous = board.value(od.CONTROLWORD)
    for _ in range(8):
        if not running(board):
            break
        board.write(od.CONTROLWORD, controlword)
        previous = controlword
        board.write(od.TARGET_VELOCITY, SPEED)
        assert board.state() is (stop.meanwhile if running(board) else stop.end)
        board.wait(1)
        assert board.value(od.VELOCITY_ACTUAL) < speed
        speed = board.value(od.VELOCITY_ACTUAL)
    assert (board.state(), board.value(od.VELOCITY_ACTUAL)) == (stop.end, 0)
    board.write(od.CONTROLWORD, controlword)
    resets = stop.end is FAULT and controlword & ~previous & 0x80
    assert board.state() is (SOD if resets else AT_REST[stop.end].get(controlword, stop.end))


@pytest.mark.parametrize("option", [1, 2])
def test_an_option_code_written_meanwhile_is_for_the_next_stop(fast_kernel: Kernel, option: int) -> None:
    board = moving(fast_kernel, {od.QUICK_STOP_OPTION: option})
    word(0x02)(board)
    assert board.write(od.QUICK_STOP_OPTION, 6) == 0
    word(0x0F)(board)
    board.wait(10)
    assert board.state() is SOD


# --- in every mode

SYNC_S: Final = 0x080


def profile_position(board: BenchBoard) -> None:
    board.write(od.TARGET_POSITION, 1_000 * STEP)
    board.write(od.CONTROLWORD, 0x1F)


def profile_velocity(board: BenchBoard) -> None:
    board.write(od.TARGET_VELOCITY, SPEED)


def homing(board: BenchBoard) -> None:
    board.write(od.HOMING_METHOD, 18)
    board.write(od.CONTROLWORD, 0x1F)


def interpolation(board: BenchBoard) -> None:
    board.record(10 * STEP, 2 * STEP * 64, 10, 0)
    for sequence in range(1, 12):
        board.record(20 * STEP, 2 * STEP * 64, 10, sequence)
    board.write(od.CONTROLWORD, 0x1F)


def go_on_with_positions(board: BenchBoard) -> None:
    board.write(od.TARGET_POSITION, board.value(od.TARGET_POSITION) + 2 * STEP)
    board.send(SYNC_S, b"")


def go_on_with_velocity(board: BenchBoard) -> None:
    board.write(od.TARGET_VELOCITY, SPEED)
    board.send(SYNC_S, b"")


def nothing(_board: BenchBoard) -> None:
    pass


class Motion(NamedTuple):
    """How an axis is set moving in a mode, what its master goes on to send, and the words that it repeats."""

    begin: Callable[[BenchBoard], None]
    go_on: Callable[[BenchBoard], None] = nothing
    words: tuple[int, ...] = (0x0F, 0x1F)


MOTIONS: Final = {
    Mode.PROFILE_POSITION: Motion(profile_position, words=(0x0F, 0x1F, 0x0F, 0x3F)),
    Mode.PROFILE_VELOCITY: Motion(profile_velocity, profile_velocity),
    Mode.HOMING: Motion(homing),
    Mode.INTERPOLATED_POSITION: Motion(interpolation),
    Mode.CYCLIC_SYNCHRONOUS_POSITION: Motion(nothing, go_on_with_positions),
    Mode.CYCLIC_SYNCHRONOUS_VELOCITY: Motion(nothing, go_on_with_velocity),
}


def in_motion(kernel: Kernel, mode: Mode, options: dict[int, int]) -> BenchBoard:
    board = BenchBoard(kernel)
    rates = (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION, od.HOMING_ACCELERATION)
    values = {**dict.fromkeys(rates, 400_000 * STEP), od.HOMING_SEARCH_SPEED: SPEED, od.INTERPOLATION_PERIOD: 1}
    for address, value in {**values, **options}.items():
        assert board.write(address, value) == 0
    board.enable(mode)
    MOTIONS[mode].begin(board)
    for _ in range(15):
        MOTIONS[mode].go_on(board)
        board.wait(1)
    assert board.value(od.VELOCITY_ACTUAL) > SPEED / 4
    return board


def lost_heartbeat(board: BenchBoard) -> None:
    """The node stays OPERATIONAL, so that the controlwords of another master still come by process data."""
    assert board.write(od.COMMUNICATION_ERROR_BEHAVIOUR, 1) == 0
    assert board.write(od.CONSUMER_HEARTBEATS[0], 0x7F << 16 | 3) == 0
    board.send(0x77F, b"\x05")
    board.wait(3.01)


def bus_off(board: BenchBoard) -> None:
    assert board.write(od.COMMUNICATION_ERROR_BEHAVIOUR, 1) == 0
    board.firmware.on_bus_off(board.now)
    board.firmware.poll(board.now)


def late_rpdo(board: BenchBoard) -> None:
    board.firmware.nodes[0].dictionary.set(0x1402_05, 3)
    board.firmware.nodes[0].process_data.invalidate()
    board.send(0x610, bytes.fromhex("4041600000000000"))  # any call lets the parameter take effect
    board.firmware.receive(Frame(0x410, board.value(od.TARGET_POSITION).to_bytes(4, "little", signed=True)), board.now)
    board.wait(3.01)


CAUSES: Final = {
    "quick stop": (word(0x02), {}),
    "heartbeat": (lost_heartbeat, {od.ABORT_CONNECTION_OPTION: 3}),
    "bus-off": (bus_off, {od.ABORT_CONNECTION_OPTION: 3}),
    "late RPDO": (late_rpdo, {od.ABORT_CONNECTION_OPTION: 3}),
    "NMT stop": (nmt_stop_and_start, {od.ABORT_CONNECTION_OPTION: 3}),
}


@pytest.mark.parametrize("cause", CAUSES)
@pytest.mark.parametrize("mode", MOTIONS)
def test_in_every_mode_the_drive_ends_switched_off(fast_kernel: Kernel, mode: Mode, cause: str) -> None:
    """The master goes on as if nothing had happened: its words and its targets, every millisecond."""
    begin, options = CAUSES[cause]
    board = in_motion(fast_kernel, mode, {od.QUICK_STOP_OPTION: 1, **options})
    begin(board)
    assert board.state() is QSA
    words, go_on = MOTIONS[mode].words, MOTIONS[mode].go_on
    for i in range(20):
        board.send(0x210, words[i % len(words)].to_bytes(2, "little") + bytes((mode,)))
        go_on(board)
        board.wait(1)
    assert (board.state(), running(board)) == (SOD, False)
    stands = board.value(od.POSITION_DEMAND)
    board.wait(20)
    assert board.value(od.POSITION_DEMAND) == stands


def test_a_reset_of_the_communication_is_a_loss_too(fast_kernel: Kernel) -> None:
    board = in_motion(fast_kernel, Mode.PROFILE_VELOCITY, {od.ABORT_CONNECTION_OPTION: 3})
    board.nmt(130)
    board.nmt(1)
    for _ in range(10):
        board.write(od.CONTROLWORD, 0x0F)
        board.wait(1)
    assert (board.state(), running(board)) == (SOD, False)


def test_the_group_stops_with_the_axis_that_has_a_fault(fast_kernel: Kernel) -> None:
    """Its master's word, repeated, takes nothing back: neither of the axis with the fault nor of the others."""
    board = BenchBoard(fast_kernel, axes=2)
    for axis in (0, 1):
        board.write(od.QUICK_STOP_DECELERATION, 400_000 * STEP, axis)
    board.enable()
    for axis in (0, 1):
        board.record(10 * STEP, 2 * STEP * 64, 10, 0, axis)
        board.record(20 * STEP, 2 * STEP * 64, 10, 1, axis)
    board.record(20 * STEP, 2 * STEP * 64, 10, 2, 1)
    board.start()
    for _ in range(40):
        for axis in (0, 1):
            board.write(od.CONTROLWORD, 0x1F, axis)
        board.wait(1)
    assert [board.state(axis) for axis in (0, 1)] == [FAULT, FAULT]
    assert [board.value(od.ERROR_CODE, axis) for axis in (0, 1)] == [ErrorCode.PVT_UNDERRUN, ErrorCode.GROUP_STOPPED]
