"""bxCAN's registers: modes, mailboxes, filters, FIFOs, errors and interrupts, by RM0008, section 24."""

import pytest

from steptwin.features.stm32.chip import can
from steptwin.features.stm32.chip import cells as c
from tests.features.stm32.conftest import Bench

_MCR, _MSR, _TSR, _RF0R, _RF1R, _IER, _ESR, _BTR = (can.CAN + 4 * word for word in range(8))
_MAILBOX, _RECEIVED, _FMR = can.CAN + 0x180, can.CAN + 0x1B0, can.CAN + 0x200
_FM1R, _FS1R, _FFA1R, _FA1R, _BANK = (can.CAN + at for at in (0x204, 0x20C, 0x214, 0x21C, 0x240))
_PENDING = 0xE000E200
_TIMING = 0x001C0003
"""BS1 of 13, BS2 of 2 quanta and a prescaler of 4: 16 quanta of 1/9 us, 562.5 kbit/s."""
_BIT_COUNTS = 128


def _normal(bench: Bench, *, mode: int = 0, control: int = 0) -> None:
    bench.write(_MCR, can.INRQ)
    bench.write(_BTR, mode | _TIMING)
    bench.write(_MCR, control)
    bench.run(11 * _BIT_COUNTS)
    assert bench.read(_MSR) & 3 == 0


def _pass_all(bench: Bench) -> None:
    bench.write(_FMR, 1)
    bench.write(_FS1R, 1)
    bench.write(_FA1R, 1)
    bench.write(_FMR, 0)


def _request(bench: Bench, mailbox: int, identifier: int, data: bytes = b"") -> None:
    place = _MAILBOX + 16 * mailbox
    bench.write(place + 4, len(data))
    bench.write(place + 8, int.from_bytes(data[:4], "little"))
    bench.write(place + 12, int.from_bytes(data[4:], "little"))
    bench.write(place, identifier << 21 | 1)


def _arrive(bench: Bench, identifier: int, data: int = 0) -> None:
    bench.chip.act(can.receive_can, identifier << 21, 1, data, 0, 0)


def _pending(bench: Bench) -> set[int]:
    return {irq for irq in (19, 20, 21, 22) if bench.read(_PENDING) >> irq & 1}


# --- modes and bit timing


def test_the_registers_have_their_reset_values(bench: Bench) -> None:
    values = [bench.read(each) for each in (_MCR, _MSR, _TSR, _RF0R, _RF1R, _IER, _ESR, _BTR, _FMR)]
    assert values == [0x00010002, 0x00000C02, 0x1C000000, 0, 0, 0, 0, 0x01230000, 0x2A1C0E01]


def test_it_leaves_sleep_for_initialisation_at_once_and_that_after_11_recessive_bits(bench: Bench) -> None:
    bench.write(_MCR, can.INRQ)
    assert bench.read(_MSR) & 3 == can.INAK
    bench.write(_BTR, _TIMING)
    bench.write(_MCR, 0)
    bench.run(11 * _BIT_COUNTS - 1)
    assert bench.read(_MSR) & 3 == can.INAK
    bench.run(1)
    assert bench.read(_MSR) & 3 == 0
    bench.write(_BTR, 0x01230000)
    assert bench.read(_BTR) == _TIMING  # BTR is locked outside of initialisation
    bench.write(_MCR, can.SLEEP)
    assert bench.read(_MSR) & 3 == can.SLAK


@pytest.mark.parametrize(
    ("timing", "kbit"), [(0x001C0003, 562.5), (0x00050008, 500), (0x01230000, 36_000 / 8), (0x001E0001, 1000)]
)
def test_a_bit_has_its_quanta_of_pclk1(bench: Bench, timing: int, kbit: float) -> None:
    bench.write(_MCR, can.INRQ)
    bench.write(_BTR, timing)
    assert 72_000 * c.GRAINS / can.can_bit_grains(bench.chip.cells) == pytest.approx(kbit, rel=1e-12)


def test_a_master_reset_ends_in_sleep(bench: Bench) -> None:
    _normal(bench, control=can.ABOM | can.TXFP)
    bench.write(_MCR, can.RESET)
    assert (bench.read(_MCR), bench.read(_MSR) & 3) == (0x00010002, can.SLAK)


# --- mailboxes


@pytest.mark.parametrize(("control", "order"), [(0, [1, 2, 0]), (can.TXFP, [0, 1, 2])])
def test_mailboxes_are_sent_by_identifier_or_in_the_order_of_requests(
    bench: Bench, control: int, order: list[int]
) -> None:
    _normal(bench, control=control)
    for mailbox, identifier in enumerate((0x300, 0x100, 0x200)):
        _request(bench, mailbox, identifier)
    sent = []
    for _ in range(3):
        bench.chip.cells[c.CAN_SENDING] = can.next_mailbox(bench.chip.cells)
        sent.append(bench.chip.cells[c.CAN_SENDING])
        bench.chip.act(can.can_sent, 0)
    assert sent == order
    assert bench.read(_TSR) == 0x1C030303


def test_of_equal_identifiers_the_lower_mailbox_is_sent_first(bench: Bench) -> None:
    _normal(bench)
    _request(bench, 1, 0x100)
    _request(bench, 0, 0x100)
    assert can.next_mailbox(bench.chip.cells) == 0


def test_code_and_low_tell_the_free_mailbox_or_that_of_lowest_priority(bench: Bench) -> None:
    _normal(bench)
    assert bench.read(_TSR) >> 24 == 0x1C
    _request(bench, 0, 0x300)
    assert bench.read(_TSR) >> 24 == 0x18 | 1
    _request(bench, 1, 0x100)
    assert bench.read(_TSR) >> 24 == 0x20 | 0x10 | 2
    _request(bench, 2, 0x200)
    assert bench.read(_TSR) >> 24 == 0x20


def test_a_pending_mailbox_cannot_be_written_and_is_aborted_at_once(bench: Bench) -> None:
    _normal(bench)
    bench.write(_IER, 1)
    _request(bench, 0, 0x100, b"\x01")
    bench.write(_MAILBOX + 8, 5)
    assert bench.read(_MAILBOX + 8) == 1
    bench.write(_TSR, can.ABRQ)
    assert bench.read(_TSR) == 0x1C000000 | can.RQCP
    assert bench.read(_MAILBOX) & 1 == 0
    assert _pending(bench) == {19}
    bench.write(_TSR, can.RQCP)
    assert bench.read(_TSR) == 0x1C000000


@pytest.mark.parametrize(("fails", "flags"), [(False, can.RQCP | can.TXOK), (True, can.RQCP | can.TERR)])
def test_an_abort_of_a_frame_on_the_wire_waits_for_its_end(bench: Bench, fails: bool, flags: int) -> None:
    _normal(bench)
    _request(bench, 0, 0x100)
    bench.chip.cells[c.CAN_SENDING] = 0
    bench.write(_TSR, can.ABRQ)
    assert bench.read(_TSR) & 0xFF == can.ABRQ
    if fails:
        bench.chip.act(can.can_failed, 0, can.TERR)
    else:
        bench.chip.act(can.can_sent, 0)
    assert bench.read(_TSR) == 0x1C000000 | flags


@pytest.mark.parametrize(("control", "status"), [(0, 0x18000000 | can.ALST), (can.NART, 0x1C000000 | 5)])
def test_a_lost_arbitration_is_repeated_unless_nart_forbids(bench: Bench, control: int, status: int) -> None:
    _normal(bench, control=control)
    _request(bench, 0, 0x100)
    bench.chip.act(can.can_failed, 0, can.ALST)
    assert bench.read(_TSR) & ~0x03000000 == status


def test_initialisation_waits_for_the_end_of_an_own_frame(bench: Bench) -> None:
    _normal(bench)
    _request(bench, 0, 0x100)
    bench.chip.cells[c.CAN_SENDING] = 0
    bench.write(_MCR, can.INRQ)
    assert bench.read(_MSR) & 3 == 0
    bench.chip.act(can.can_sent, 0)
    assert bench.read(_MSR) & 3 == can.INAK


# --- filters


def _filters(bench: Bench, *, lists: int, wide: int, fifo1: int, active: int, words: dict[int, int]) -> None:
    bench.write(_FMR, 1)
    for place, value in ((_FM1R, lists), (_FS1R, wide), (_FFA1R, fifo1), (_FA1R, active)):
        bench.write(place, value)
    for word, value in words.items():
        bench.write(_BANK + 4 * word, value)
    bench.write(_FMR, 0)


def _accepted(bench: Bench, identifier: int) -> tuple[int, int] | None:
    found = can.accepting_filter(bench.chip.cells, identifier)
    return None if found < 0 else (found >> 8, found & 0xFF)


def test_filters_pass_by_scale_mode_and_number_with_their_match_index(bench: Bench) -> None:
    # banks: 0: 32 bits, mask; 1: 32 bits, list; 2: 16 bits, mask, FIFO 1; 3: 16 bits, list; 4: off; 5: as 1
    _filters(
        bench,
        lists=0b101010,
        wide=0b110011,
        fifo1=0b000100,
        active=0b101111,
        words={
            0: 0x120 << 21,
            1: 0x7F0 << 21,
            2: 0x125 << 21,
            3: 0x1ABCDEF0 << 3 | can.IDE,
            4: 0x7E0 << 21 | 0x700 << 5,
            5: 0x7E0 << 21 | 0x600 << 5,
            6: 0x301 << 21 | 0x300 << 5,
            7: 0x303 << 21 | 0x302 << 5,
            10: 0x703 << 21,
            11: 0x704 << 21 | can.RTR,
        },
    )
    # FIFO 0: bank 0 has index 0, bank 1 has 1 and 2, bank 3 has 3 to 6, bank 4 7, bank 5 8 and 9
    assert _accepted(bench, 0x121 << 21) == (0, 0)
    assert _accepted(bench, 0x125 << 21) == (0, 1)  # a list comes before a mask
    assert _accepted(bench, 0x125 << 21 | can.RTR) == (0, 0)
    assert _accepted(bench, 0x1ABCDEF0 << 3 | can.IDE) == (0, 2)
    assert [_accepted(bench, each << 21) for each in (0x300, 0x301, 0x302, 0x303)] == [(0, 3), (0, 4), (0, 5), (0, 6)]
    assert _accepted(bench, 0x71F << 21) == (1, 0)
    assert _accepted(bench, 0x61F << 21) == (1, 1)
    assert _accepted(bench, 0x703 << 21) == (0, 8)  # 32 bits before 16
    assert _accepted(bench, 0x704 << 21 | can.RTR) == (0, 9)
    assert _accepted(bench, 0x400 << 21) is None
    bench.write(_FMR, 1)
    assert _accepted(bench, 0x121 << 21) is None


def test_a_filter_is_written_while_finit_is_set_or_its_bank_is_off(bench: Bench) -> None:
    _filters(bench, lists=0, wide=1, fifo1=0, active=1, words={0: 5})
    bench.write(_BANK, 7)
    bench.write(_BANK + 8, 7)
    bench.write(_FS1R, 0)
    assert (bench.read(_BANK), bench.read(_BANK + 8), bench.read(_FS1R)) == (5, 7, 1)


# --- FIFOs


def test_three_frames_wait_and_the_newest_is_overwritten(bench: Bench) -> None:
    _normal(bench)
    _pass_all(bench)
    bench.write(_IER, 0b1110)
    for data in range(1, 4):
        _arrive(bench, 0x100 + data, data)
    assert (bench.read(_RF0R), _pending(bench)) == (3 | can.FULL, {20})
    _arrive(bench, 0x104, 4)
    assert bench.read(_RF0R) == 3 | can.FULL | can.FOVR
    read = []
    for _ in range(3):
        read.append((bench.read(_RECEIVED) >> 21, bench.read(_RECEIVED + 4), bench.read(_RECEIVED + 8)))
        bench.write(_RF0R, can.RFOM)
    assert read == [(0x101, 1, 1), (0x102, 1, 2), (0x104, 1, 4)]
    bench.write(_RF0R, can.FULL | can.FOVR)
    assert bench.read(_RF0R) == 0


def test_a_locked_fifo_keeps_its_three_frames(bench: Bench) -> None:
    _normal(bench, control=can.RFLM)
    _pass_all(bench)
    for data in range(1, 5):
        _arrive(bench, 0x100, data)
    for _ in range(2):
        bench.write(_RF0R, can.RFOM)
    assert (bench.read(_RECEIVED + 8), bench.read(_RF0R)) == (3, 1 | can.FULL | can.FOVR)


# --- loopback


def test_in_loopback_a_frame_comes_back_through_the_filters_after_its_bits(bench: Bench) -> None:
    _normal(bench, mode=can.LBKM | can.SILM)
    _pass_all(bench)
    bench.write(_IER, 0b11)
    _request(bench, 0, 0x123, b"\x01\x02\x03\x04\x05")
    bench.run((47 + 40) * _BIT_COUNTS - 1)
    assert bench.read(_RF0R) == 0
    bench.run(1)
    assert (bench.read(_RF0R), bench.read(_TSR), _pending(bench)) == (1, 0x1C000003, {19, 20})
    assert [bench.read(_RECEIVED + at) for at in (0, 4, 8, 12)] == [0x123 << 21, 5, 0x04030201, 0x05]


# --- errors


@pytest.mark.parametrize(
    ("transmit", "receive", "flags"),
    [(95, 0, 0), (96, 0, 1), (0, 127, 1), (0, 128, 3), (255, 0, 3), (256, 0, 7)],
)
def test_the_error_flags_follow_the_counters_and_ask_for_sce(
    bench: Bench, transmit: int, receive: int, flags: int
) -> None:
    _normal(bench)
    bench.write(_IER, 1 << 15 | 7 << 8)
    bench.chip.act(can.set_can_errors, transmit, receive, can.STUFF_ERROR)
    assert bench.read(_ESR) == flags | 0x10 | (transmit & 0xFF) << 16 | receive << 24
    assert _pending(bench) == ({22} if flags else set())
    bench.write(_MSR, can.ERRI)
    assert bench.read(_MSR) & can.ERRI == 0
