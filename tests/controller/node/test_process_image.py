"""Values that arrive together act as one process image: in one frame or with one SYNC, in either order, in every mode.

Each case gives two of six entries new values. The right outcome follows from the values alone: the case is played in
both orders of the mapping, and in both orders of two receive PDOs.
"""

from collections.abc import Callable, Iterable
from itertools import combinations
from typing import Final

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, State
from steptwin.protocol.frame import COB_ID_INVALID
from steptwin.protocol.objects import ENTRIES
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

CONTROL, TARGET, PROFILE_VELOCITY, VELOCITY, MODE, MAX_VELOCITY = (
    od.CONTROLWORD,
    od.TARGET_POSITION,
    od.PROFILE_VELOCITY,
    od.TARGET_VELOCITY,
    od.MODE_OF_OPERATION,
    od.MAX_PROFILE_VELOCITY,
)
PAIRS: Final = list(combinations((CONTROL, TARGET, PROFILE_VELOCITY, VELOCITY, MODE, MAX_VELOCITY), 2))
PP, PV, HM, IP, CSP, CSV = (
    Mode.PROFILE_POSITION,
    Mode.PROFILE_VELOCITY,
    Mode.HOMING,
    Mode.INTERPOLATED_POSITION,
    Mode.CYCLIC_SYNCHRONOUS_POSITION,
    Mode.CYCLIC_SYNCHRONOUS_VELOCITY,
)
BEFORE: Final = {
    TARGET: -40 * STEP,
    PROFILE_VELOCITY: 2_000 * STEP,
    VELOCITY: 0,
    MAX_VELOCITY: 100_000 * STEP,
}
NEAR: Final = 256
"""A way that the axis makes in a millisecond at every speed limit here."""
SYNC: Final = 0x080
ENABLED, STARTED, HALTED = 0x0F, 0x1F, 0x10F
RPDO_1: Final = 0x200


def new_values(mode: Mode) -> dict[int, int]:
    """Return the values that an image gives the entries."""
    starts = mode in (PP, HM, IP)
    velocity = 1_000 * NEAR if mode is CSV else 3_000 * STEP
    return {
        CONTROL: STARTED if starts else ENABLED,
        TARGET: NEAR if mode is CSP else 20 * STEP,
        PROFILE_VELOCITY: 4_000 * STEP,
        VELOCITY: velocity,
        MODE: mode,
        MAX_VELOCITY: 1_000 * STEP,
    }


def configure(board: BenchBoard, rpdos: list[list[int]], transmission: int) -> None:
    """Let RPDO1 and, if two are given, RPDO2 carry these entries; the others are off."""
    board.nmt(128)
    for number in range(4):
        communication, mapping = od.RPDO_COMMUNICATION[number] << 8, od.RPDO_MAPPING[number] << 8
        cob_id = 0x210 + 0x100 * number
        assert board.write(communication | od.PDO_COB_ID, cob_id | COB_ID_INVALID) == 0
        if number >= len(rpdos):
            continue
        assert board.write(communication | od.PDO_TRANSMISSION_TYPE, transmission) == 0
        assert board.write(mapping, 0) == 0
        for place, address in enumerate(rpdos[number], start=1):
            assert board.write(mapping | place, address << 8 | 8 * ENTRIES[address].data_type.size) == 0
        assert board.write(mapping, len(rpdos[number])) == 0
        assert board.write(communication | od.PDO_COB_ID, cob_id) == 0
    board.nmt(1)


def encoded(address: int, value: int) -> bytes:
    data_type = ENTRIES[address].data_type
    return value.to_bytes(data_type.size, "little", signed=data_type.signed)


def send(board: BenchBoard, rpdos: list[list[int]], values: dict[int, int], transmission: int) -> None:
    for number, addresses in enumerate(rpdos):
        board.send(RPDO_1 + 0x100 * number + 0x10, b"".join(encoded(each, values[each]) for each in addresses))
    if transmission <= 240:
        board.send(SYNC, b"")


def stand_ready(board: BenchBoard, mode: Mode, pair: Iterable[int]) -> None:
    """Enable the drive at position 0 with the values of before; the image is what starts or ends a halt."""
    board.write(CONTROL, 0)
    board.write(MODE, HM)
    board.write(od.HOMING_METHOD, 37)
    board.write(od.HOME_OFFSET, 0)
    board.write(od.BUFFER_CLEAR, 0)
    for address, value in BEFORE.items():
        assert board.write(address, value) == 0
    for controlword in (0x06, 0x07, ENABLED, STARTED, ENABLED):
        assert board.write(CONTROL, controlword) == 0
    assert board.value(od.POSITION_DEMAND) == 0
    if mode is IP:
        for address, value in ((od.PVT_DISPLACEMENT, 10 * STEP), (od.PVT_END_VELOCITY, 0), (od.PVT_DURATION_MS, 20)):
            assert board.write(address, value) == 0
        assert board.write(od.PVT_SEQUENCE, 0) == 0
    if mode is HM:
        board.write(od.HOME_OFFSET, 7 * STEP)
    assert board.write(MODE, Mode.NONE if MODE in pair else mode) == 0
    if mode in (PV, CSP, CSV) and CONTROL in pair and MODE not in pair:
        assert board.write(CONTROL, HALTED) == 0
        if mode is PV:
            assert board.write(VELOCITY, 500 * STEP) == 0
    elif mode in (CSP, CSV) and MODE not in pair:
        board.send(SYNC, b"")
        board.wait(1)


def profile_position_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    board.wait(10)
    target = given.get(TARGET, BEFORE[TARGET]) if CONTROL in given else 0
    speed = min(given.get(PROFILE_VELOCITY, BEFORE[PROFILE_VELOCITY]), given.get(MAX_VELOCITY, BEFORE[MAX_VELOCITY]))
    sign = (target > 0) - (target < 0)
    if abs(target) > speed // 50:  # it cruises
        assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(sign * speed, rel=0.02)
    board.wait(50)
    assert board.value(od.POSITION_DEMAND) == target


def profile_velocity_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    held = 500 * STEP if CONTROL in given and MODE not in given else 0
    wanted = min(given.get(VELOCITY, held), given.get(MAX_VELOCITY, BEFORE[MAX_VELOCITY]))
    board.wait(10)
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(wanted, rel=0.02)


def homing_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    board.wait(2)
    assert board.value(od.POSITION_DEMAND) == (7 * STEP if CONTROL in given else 0)


def interpolation_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    board.wait(25)
    assert board.value(od.POSITION_DEMAND) == (10 * STEP if CONTROL in given else 0)


def cyclic_position_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    """The image's SYNC, or the one after a frame of its own, takes the set-point; later ones bring none."""
    for _ in range(3):
        board.send(SYNC, b"")
        board.wait(1)
    assert board.value(CONTROL) == ENABLED
    wanted = given.get(TARGET, 0)
    assert (board.value(od.POSITION_DEMAND) > 0) is (wanted > 0)


def cyclic_velocity_is_right(board: BenchBoard, given: dict[int, int]) -> None:
    board.send(SYNC, b"")
    for _ in range(4):
        board.wait(1)
        board.send(SYNC, b"")
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(given.get(VELOCITY, 0), rel=0.02)


RIGHT: Final[dict[Mode, Callable[[BenchBoard, dict[int, int]], None]]] = {
    PP: profile_position_is_right,
    PV: profile_velocity_is_right,
    HM: homing_is_right,
    IP: interpolation_is_right,
    CSP: cyclic_position_is_right,
    CSV: cyclic_velocity_is_right,
}


LAYOUTS: Final = [
    (1, False),
    (1, True),
    (240, False),
    (240, True),
    (254, False),
    (254, True),
    (255, False),
    (255, True),
]
"""Transmission types, and whether the two values come by two receive PDOs."""
ARRIVING: Final = (MAX_VELOCITY, PROFILE_VELOCITY, MODE, TARGET, VELOCITY, CONTROL)
ARRIVING_CYCLIC: Final = (MAX_VELOCITY, PROFILE_VELOCITY, MODE, CONTROL, TARGET, VELOCITY)
"""The order in which frames of asynchronous PDOs must come, since each is an image of its own."""


@pytest.fixture
def board(fast_kernel: Kernel) -> BenchBoard:
    """An axis that starts and stops fast."""
    board = BenchBoard(fast_kernel)
    for address in (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION):
        assert board.write(address, 2_000_000 * STEP) == 0
    for address in (od.STEPLEN_NS, od.STEPSPACE_NS):
        assert board.write(address, 4_000) == 0
    assert board.write(od.INTERPOLATION_PERIOD, 1) == 0
    return board


@pytest.mark.parametrize("mode", RIGHT)
@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: f"{pair[0] >> 8:X}+{pair[1] >> 8:X}")
def test_two_values_act_together(board: BenchBoard, pair: tuple[int, int], mode: Mode) -> None:
    given = {address: new_values(mode)[address] for address in pair}
    for transmission, several in LAYOUTS:
        for mapped in (pair, pair[::-1]):
            arriving = sorted(mapped, key=(ARRIVING_CYCLIC if mode in (CSP, CSV) else ARRIVING).index)
            addresses = arriving if several and transmission > 240 else list(mapped)
            rpdos = [[address] for address in addresses] if several else [addresses]
            configure(board, rpdos, transmission)
            stand_ready(board, mode, pair)
            refused = board.value(od.RPDO_VALUES_REFUSED)
            send(board, rpdos, given, transmission)
            RIGHT[mode](board, given)
            assert board.value(od.RPDO_VALUES_REFUSED) == refused
            assert board.state() is State.OPERATION_ENABLED


def test_the_default_pdos_with_one_sync(board: BenchBoard) -> None:
    """RPDO3 brings the target, RPDO2 the controlword, whose number is lower; one SYNC makes both valid."""
    board.enable(PP)
    for target in (100 * STEP, -50 * STEP, 25 * STEP):
        board.send(0x410, encoded(TARGET, target))
        board.send(0x310, encoded(CONTROL, STARTED))
        board.send(SYNC, b"")
        board.wait(200)
        assert board.value(od.POSITION_DEMAND) == target
        board.send(0x310, encoded(CONTROL, ENABLED))
        board.send(SYNC, b"")


RECORD: Final = [od.PVT_DISPLACEMENT, od.PVT_END_VELOCITY, od.PVT_DURATION_MS, od.PVT_SEQUENCE]


@pytest.mark.parametrize("fields", [RECORD, RECORD[::-1]], ids=["number last", "number first"])
def test_records_of_one_sync_are_queued_in_the_order_of_their_pdos(board: BenchBoard, fields: list[int]) -> None:
    configure(board, [fields, fields], transmission=1)
    board.enable(IP)
    records = [(2 * STEP, 100 * 64, 10, 0), (3 * STEP, 0, 20, 1)]
    for number, record in enumerate(records):
        values = dict(zip(RECORD, record, strict=True))
        board.send(RPDO_1 + 0x100 * number + 0x10, b"".join(encoded(each, values[each]) for each in fields))
    board.send(SYNC, b"")
    assert board.value(od.PVT_NEXT_SEQUENCE) == 2
    assert board.write(CONTROL, STARTED) == 0
    board.wait(10.25)
    assert board.value(od.POSITION_DEMAND) == pytest.approx(2 * STEP, abs=0.05 * STEP)
    board.wait(25)
    assert board.value(od.POSITION_DEMAND) == 5 * STEP


@pytest.mark.parametrize("number_first", [False, True])
def test_a_record_may_come_by_two_pdos(board: BenchBoard, *, number_first: bool) -> None:
    rpdos = [RECORD[:2], RECORD[2:]]
    rpdos = rpdos[::-1] if number_first else rpdos
    configure(board, rpdos, transmission=1)
    board.enable(IP)
    send(board, rpdos, dict(zip(RECORD, (4 * STEP, 0, 10, 0), strict=True)), transmission=1)
    assert board.write(CONTROL, STARTED) == 0
    board.wait(15)
    assert board.value(od.POSITION_DEMAND) == 4 * STEP


def test_a_whole_set_point_in_one_frame_that_chooses_the_mode(board: BenchBoard) -> None:
    """The controlword is the first in the frame, the mode the last."""
    fields = [CONTROL, TARGET, MODE]
    configure(board, [fields], transmission=255)
    stand_ready(board, PP, [MODE])
    send(board, [fields], {CONTROL: STARTED, TARGET: 30 * STEP, MODE: PP}, transmission=255)
    board.wait(50)
    assert board.value(od.POSITION_DEMAND) == 30 * STEP


@pytest.mark.parametrize("fields", [[CONTROL, VELOCITY], [VELOCITY, CONTROL]])
def test_a_velocity_that_comes_with_the_word_that_enables_starts_nothing(board: BenchBoard, fields: list[int]) -> None:
    """It was given before the drive was enabled; that of the next frame counts."""
    configure(board, [fields], transmission=255)
    stand_ready(board, PV, [VELOCITY])
    assert board.write(CONTROL, 0x07) == 0
    values = {CONTROL: ENABLED, VELOCITY: 1_000 * STEP}
    send(board, [fields], values, transmission=255)
    board.wait(10)
    assert (board.state(), board.value(od.VELOCITY_ACTUAL)) == (State.OPERATION_ENABLED, 0)
    send(board, [fields], values, transmission=255)
    board.wait(10)
    assert board.value(od.VELOCITY_ACTUAL) == pytest.approx(1_000 * STEP, rel=0.02)


@pytest.mark.parametrize(("mode", "other"), [(CSP, VELOCITY), (CSV, TARGET)])
def test_the_other_modes_target_is_no_set_point(board: BenchBoard, mode: Mode, other: int) -> None:
    """A target velocity does not let an old target position count, nor the other way round."""
    configure(board, [[other]], transmission=1)
    stand_ready(board, mode, [other])
    for value in (5 * STEP, 6 * STEP):
        send(board, [[other]], {other: value}, transmission=1)
        board.wait(1)
    assert (board.state(), board.value(od.POSITION_DEMAND)) == (State.OPERATION_ENABLED, 0)


def test_a_set_point_written_in_a_halt_is_old_when_it_ends(board: BenchBoard) -> None:
    configure(board, [[CONTROL], [TARGET]], transmission=1)
    stand_ready(board, CSP, [CONTROL])
    board.send(0x310, encoded(TARGET, NEAR))
    board.send(SYNC, b"")
    board.wait(1)
    board.send(0x210, encoded(CONTROL, ENABLED))
    for _ in range(4):
        board.send(SYNC, b"")
        board.wait(1)
    assert board.value(od.POSITION_DEMAND) == 0


def test_a_limit_repeated_by_pdo_keeps_the_records_that_wait(board: BenchBoard) -> None:
    """While the drive is off another limit drops them."""
    configure(board, [[MAX_VELOCITY]], transmission=255)
    board.nmt(1)
    for address, value in zip(RECORD, (4 * STEP, 0, 10, 0), strict=True):
        assert board.write(address, value) == 0
    limit = board.value(MAX_VELOCITY)
    send(board, [[MAX_VELOCITY]], {MAX_VELOCITY: limit}, transmission=255)
    assert board.value(od.BUFFER_POSITION) == 1
    send(board, [[MAX_VELOCITY]], {MAX_VELOCITY: limit - 1}, transmission=255)
    assert board.value(od.BUFFER_POSITION) == 0
