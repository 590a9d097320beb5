"""bxCAN's registers: modes, mailboxes, filters, FIFOs, errors, interrupts (RM0008, section 24).

The frames on the wire are those of the emulated bus: `can_node` tells what happens there. Loopback, which no bus sees,
is here; a frame then takes its bits without stuff bits.
"""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.bookkeeping import note_strange
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.nvic import set_line

CAN: Final = 0x40006400
BASE: Final = c.VALUE + (CAN - c.PERIPHERALS) // 4
MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR = range(8)
TI0R, RI0R, RI1R, FMR, FM1R, FS1R, FFA1R, FA1R, F0R1 = 96, 108, 112, 128, 129, 131, 133, 135, 144
INRQ, SLEEP, TXFP, RFLM, NART, ABOM, TTCM, RESET = 1, 2, 4, 8, 16, 64, 128, 1 << 15
INAK, SLAK, ERRI, WKUI, SLAKI = 1, 2, 4, 8, 16
RQCP, TXOK, ALST, TERR, ABRQ = 1, 2, 4, 8, 128
"""Bits of TSR for mailbox 0; those of the others are 8 and 16 bits higher."""
TME0: Final = 1 << 26
FMP, FULL, FOVR, RFOM = 3, 8, 16, 32
EWGF, EPVF, BOFF = 1, 2, 4
LBKM, SILM = 1 << 30, 1 << 31
IDE, RTR, TXRQ = 4, 2, 1
STUFF_ERROR, ACKNOWLEDGE_ERROR, RECESSIVE_ERROR = 1, 3, 4
"""Values of LEC."""
_FACT_BANKS: Final = 14
_TX_IRQ, _RX0_IRQ, _SCE_IRQ = 19, 20, 22
_SYNCHRONISE_BITS: Final = 11
"""Recessive bits that a controller waits for before it takes part (24.4.2)."""
_FRAME_BITS: Final = 47


@integer
def can_bit_grains(s: Cells) -> int:
    """Return the length of a bit: its quanta of SYNC_SEG, BS1 and BS2, each of BRP + 1 cycles of PCLK1 (24.7.7)."""
    divider = s[c.VALUE + (0x40021004 - c.PERIPHERALS) // 4] >> 8 & 7
    timing = s[BASE + BTR]
    quanta = 3 + (timing >> 16 & 15) + (timing >> 20 & 7)
    return quanta * ((timing & 0x3FF) + 1) * (s[c.CYCLE] << max(divider - 3, 0))


@integer
def can_takes_part(s: Cells) -> bool:
    """Return whether the controller is in normal mode, perhaps silent or in loopback."""
    return s[BASE + MSR] & (INAK | SLAK) == 0


@integer
def tell_can(s: Cells) -> None:
    """End the stretch of time that is run, because the bus must know of a change."""
    s[c.CAN_CHANGED], s[c.UNTIL] = 1, 0


@integer
def set_can_lines(s: Cells) -> None:
    """Ask for the interrupts TX, RX0, RX1 and SCE (24.8)."""
    enabled, status = s[BASE + IER], s[BASE + MSR]
    set_line(s, _TX_IRQ, 1 if enabled & 1 and s[BASE + TSR] & 0x010101 else 0)
    for fifo in range(2):
        bits, state = enabled >> 1 + 3 * fifo, s[BASE + RF0R + fifo]
        asked = (bits & 1 and state & FMP) or (bits & 2 and state & FULL) or (bits & 4 and state & FOVR)
        set_line(s, _RX0_IRQ + fifo, 1 if asked else 0)
    changed = (
        (enabled >> 15 & 1 and status & ERRI)
        or (enabled >> 16 & 1 and status & WKUI)
        or (enabled >> 17 & 1 and status & SLAKI)
    )
    set_line(s, _SCE_IRQ, 1 if changed else 0)


# --- modes


@integer
def set_can_mode(s: Cells) -> None:
    """Follow SLEEP and INRQ, once no frame of this controller is on the wire (24.4)."""
    wanted, status = s[BASE + MCR] & (SLEEP | INRQ), s[BASE + MSR]
    if wanted and s[c.CAN_SENDING] >= 0:
        return
    if wanted:
        mode = SLAK if wanted & SLEEP else INAK
        if status & (SLAK | INAK) == mode and s[c.DUES + c.CAN_DUE] == c.NEVER:
            return
        s[BASE + MSR] = status & ~(SLAK | INAK) | mode
        if mode == SLAK and s[BASE + IER] >> 17 & 1:
            s[BASE + MSR] |= SLAKI
        s[c.DUES + c.CAN_DUE] = c.NEVER
        tell_can(s)
    elif status & (SLAK | INAK) and s[c.DUES + c.CAN_DUE] == c.NEVER:
        s[c.DUES + c.CAN_DUE] = s[c.AT] + _SYNCHRONISE_BITS * can_bit_grains(s)


@integer
def can_event(s: Cells) -> None:
    """Enter normal mode, or end a frame in loopback."""
    s[c.DUES + c.CAN_DUE] = c.NEVER
    if not can_takes_part(s):
        s[BASE + MSR] &= ~(SLAK | INAK)
        tell_can(s)
    elif s[c.CAN_SENDING] >= 0:
        place = BASE + TI0R + 4 * s[c.CAN_SENDING]
        sent_id, control, low, high = s[place], s[place + 1], s[place + 2], s[place + 3]
        can_sent(s, 0)
        receive_can(s, sent_id & ~TXRQ, min(control & 15, 8), low, high, 0)
    _loop_back(s)
    set_can_lines(s)


@integer
def _loop_back(s: Cells) -> None:
    """Begin the next frame in loopback, if one waits and the mode is that."""
    if s[BASE + BTR] & LBKM and can_takes_part(s) and s[c.DUES + c.CAN_DUE] == c.NEVER:
        s[c.CAN_SENDING] = next_mailbox(s)
        if s[c.CAN_SENDING] >= 0:
            control = s[BASE + TI0R + 4 * s[c.CAN_SENDING] + 1]
            s[c.DUES + c.CAN_DUE] = s[c.AT] + (_FRAME_BITS + 8 * min(control & 15, 8)) * can_bit_grains(s)


@integer
def reset_can(s: Cells) -> None:
    """Take the master reset: sleep, and MCR and the FIFOs as after power-up (24.9.2)."""
    s[BASE + MCR] = 0x00010002
    for fifo in range(2):
        s[BASE + RF0R + fifo] = 0
    set_can_mode(s)


# --- out


@integer
def _rank(s: Cells, mailbox: int) -> int:
    """Return a number that is the lower the earlier a mailbox is sent: by request with TXFP, else by identifier."""
    if s[BASE + MCR] & TXFP:
        return s[c.CAN_REQUESTED + mailbox]
    identifier = s[BASE + TI0R + 4 * mailbox]
    base, extension = identifier >> 21, identifier >> 3 & 0x3FFFF
    # on the wire: 11 bits, RTR or SRR, IDE, then 18 bits and RTR
    if identifier & IDE:
        bits = base << 21 | 3 << 19 | extension << 1 | identifier >> 1 & 1
    else:
        bits = base << 21 | (identifier >> 1 & 1) << 20
    return 4 * bits + mailbox


@integer
def next_mailbox(s: Cells) -> int:
    """Return the pending mailbox that is sent next; -1 for none."""
    best, found = c.NEVER, -1
    for mailbox in range(3):
        if not s[BASE + TSR] & TME0 << mailbox and _rank(s, mailbox) < best:
            best, found = _rank(s, mailbox), mailbox
    return found


@integer
def _last_mailbox(s: Cells) -> int:
    worst, found = -1, -1
    for mailbox in range(3):
        if not s[BASE + TSR] & TME0 << mailbox and _rank(s, mailbox) > worst:
            worst, found = _rank(s, mailbox), mailbox
    return found


@integer
def _end_request(s: Cells, mailbox: int, result: int) -> None:
    """Empty a mailbox, with RQCP and the flags of how its request has ended."""
    status = s[BASE + TSR] & ~((TXOK | ALST | TERR | ABRQ) << 8 * mailbox)
    s[BASE + TSR] = status | (RQCP | result) << 8 * mailbox | TME0 << mailbox
    s[BASE + TI0R + 4 * mailbox] &= ~TXRQ


@integer
def can_sent(s: Cells, time: int) -> None:
    """End the frame on the wire as sent, with the bit time of its beginning."""
    mailbox = s[c.CAN_SENDING]
    _end_request(s, mailbox, TXOK)
    if s[BASE + MCR] & TTCM:
        s[BASE + TI0R + 4 * mailbox + 1] = s[BASE + TI0R + 4 * mailbox + 1] & 0xFFFF | time << 16
    s[BASE + ESR] &= ~0x70
    s[c.CAN_SENDING] = -1
    set_can_mode(s)
    set_can_lines(s)
    tell_can(s)


@integer
def can_failed(s: Cells, mailbox: int, why: int) -> None:
    """Note that a mailbox' frame was not sent: TERR or ALST; it is repeated unless NART or ABRQ forbids that."""
    s[c.CAN_SENDING] = -1
    if s[BASE + MCR] & NART or s[BASE + TSR] & ABRQ << 8 * mailbox:
        _end_request(s, mailbox, why)
    else:
        s[BASE + TSR] |= why << 8 * mailbox
    set_can_mode(s)
    set_can_lines(s)
    tell_can(s)


# --- in


@integer
def accepting_filter(s: Cells, identifier: int) -> int:
    """Return 256 * FIFO + filter match index for an identifier as in RIxR; -1 if no filter passes it (24.7.4).

    Of several filters a wide one comes first, then one with a list, then the lowest number.
    """
    if s[BASE + FMR] & 1:
        return -1
    short = identifier >> 21 << 5 | (identifier & RTR) << 3 | (identifier & IDE) << 1 | identifier >> 18 & 7
    index0 = index1 = 0
    best, found = 4, -1
    for bank in range(_FACT_BANKS):
        lists, wide = s[BASE + FM1R] >> bank & 1, s[BASE + FS1R] >> bank & 1
        fifo = s[BASE + FFA1R] >> bank & 1
        first = index1 if fifo else index0
        count = (2 if lists else 1) if wide else (4 if lists else 2)
        rank = 2 * (1 - wide) + 1 - lists
        if s[BASE + FA1R] >> bank & 1 and rank < best:
            for number in range(count):
                if _passes(s, bank, number, lists, wide, identifier & ~1 if wide else short):
                    best, found = rank, 256 * fifo + first + number
                    break
        if fifo:
            index1 += count
        else:
            index0 += count
    return found


@integer
def _passes(s: Cells, bank: int, number: int, lists: int, wide: int, identifier: int) -> bool:
    place = BASE + F0R1 + 2 * bank
    if wide:
        if lists:
            return s[place + number] & ~1 == identifier
        return (s[place] ^ identifier) & s[place + 1] & ~1 == 0
    if lists:
        return s[place + number // 2] >> 16 * (number % 2) & 0xFFFF == identifier
    return (s[place + number] ^ identifier) & s[place + number] >> 16 & 0xFFFF == 0


@integer
def receive_can(s: Cells, identifier: int, length: int, low: int, high: int, time: int) -> None:
    """Take a valid frame into the FIFO of the filter that passes it; a full FIFO is overrun (24.7.3)."""
    s[BASE + ESR] &= ~0x70
    accepted = accepting_filter(s, identifier)
    if accepted < 0:
        return
    fifo = accepted >> 8
    state = BASE + RF0R + fifo
    count = s[state] & FMP
    if count == 3:
        s[state] |= FOVR
        count = 2
        if s[BASE + MCR] & RFLM:
            set_can_lines(s)
            return
    place = c.CAN_FIFO + 12 * fifo + 4 * count
    s[place], s[place + 2], s[place + 3] = identifier, low, high
    s[place + 1] = length | (accepted & 0xFF) << 8 | (time << 16 if s[BASE + MCR] & TTCM else 0)
    s[state] = s[state] & ~FMP | count + 1
    if count == 2:
        s[state] |= FULL
    set_can_lines(s)


@integer
def _release(s: Cells, fifo: int) -> None:
    """Release the frame that is read, and let the next one follow."""
    state, place = BASE + RF0R + fifo, c.CAN_FIFO + 12 * fifo
    if s[state] & FMP:
        for i in range(8):
            s[place + i] = s[place + i + 4]
        s[state] -= 1


# --- errors


@integer
def set_can_errors(s: Cells, transmit_errors: int, receive_errors: int, code: int) -> None:
    """Take over the error counters, and LEC unless it is 0; ask for SCE if that is new and enabled (24.7.6)."""
    before, enabled = s[BASE + ESR], s[BASE + IER]
    worst = max(transmit_errors, receive_errors)
    flags = (EWGF if worst >= 96 else 0) | (EPVF if worst > 127 else 0) | (BOFF if transmit_errors > 255 else 0)
    last = code << 4 if code else before & 0x70
    s[BASE + ESR] = flags | last | (transmit_errors & 0xFF) << 16 | receive_errors << 24
    if flags & ~before & (enabled >> 8 & 7) or (code and enabled >> 11 & 1):
        s[BASE + MSR] |= ERRI
    set_can_lines(s)


# --- the processor's accesses


@integer
def read_can(s: Cells, word: int) -> int:
    """Return a register."""
    if RI0R <= word < RI1R + 4:
        return s[c.CAN_FIFO + 12 * ((word - RI0R) // 4) + (word - RI0R) % 4]
    value = s[BASE + word]
    if word == TSR:
        pending = 3 - (value >> 26 & 1) - (value >> 27 & 1) - (value >> 28 & 1)
        last = _last_mailbox(s)
        if pending > 1:
            value |= 1 << 29 + last
        if pending == 3:
            value |= last << 24
        elif value & TME0 == 0:
            value |= (1 if value & TME0 << 1 else 2) << 24
    return value


@integer
def write_can(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already, at the instant `AT`; a write that bxCAN refuses is undone."""
    if word == MCR:
        if value & RESET:
            reset_can(s)
        else:
            set_can_mode(s)
    elif word == MSR:
        s[BASE + MSR] = before & ~(value & (ERRI | WKUI | SLAKI))
    elif word == TSR:
        _write_status(s, value, before)
    elif word in (RF0R, RF1R):
        s[BASE + word] = before & ~(value & (FULL | FOVR))
        if value & RFOM:
            _release(s, word - RF0R)
    elif word == BTR:
        if not s[BASE + MSR] & INAK:
            s[BASE + BTR] = before
    elif TI0R <= word < RI0R:
        _write_mailbox(s, (word - TI0R) // 4, word, value, before)
    elif word in (FM1R, FS1R, FFA1R):
        if not s[BASE + FMR] & 1:
            s[BASE + word] = before
    elif word >= F0R1 and s[BASE + FA1R] >> (word - F0R1) // 2 & 1 and not s[BASE + FMR] & 1:
        s[BASE + word] = before
    set_can_lines(s)


@integer
def _write_status(s: Cells, value: int, before: int) -> None:
    """Clear the flags of requests that have ended, and abort requests; one on the wire goes on (24.7.1)."""
    s[BASE + TSR] = before
    for mailbox in range(3):
        bits = value >> 8 * mailbox
        if bits & RQCP:
            s[BASE + TSR] &= ~((RQCP | TXOK | ALST | TERR) << 8 * mailbox)
        if bits & ABRQ and not s[BASE + TSR] & TME0 << mailbox:
            if s[c.CAN_SENDING] == mailbox:
                s[BASE + TSR] |= ABRQ << 8 * mailbox
            else:
                _end_request(s, mailbox, 0)
                tell_can(s)


@integer
def _write_mailbox(s: Cells, mailbox: int, word: int, value: int, before: int) -> None:
    """Write to a mailbox, unless it is pending; TXRQ makes it that."""
    if not s[BASE + TSR] & TME0 << mailbox:
        s[BASE + word] = before
        return
    if word != TI0R + 4 * mailbox or not value & TXRQ:
        return
    if value & (IDE | RTR) and not s[BASE + BTR] & LBKM:
        note_strange(s, CAN + 4 * word, c.STRANGE_BITS)
    s[BASE + TSR] &= ~((RQCP | TXOK | ALST | TERR) << 8 * mailbox | TME0 << mailbox)
    s[c.CAN_REQUESTS] += 1
    s[c.CAN_REQUESTED + mailbox] = s[c.CAN_REQUESTS]
    _loop_back(s)
    tell_can(s)
