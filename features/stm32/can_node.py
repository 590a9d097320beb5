"""The station on the emulated bus that a chip's bxCAN is: mailboxes go out, frames and errors come in."""

from collections.abc import Callable
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from steptwin.emulator.bus.can_controller import RECOVERY_SEQUENCES, CanController, ErrorState, unheard
from steptwin.emulator.bus.can_timing import VALID_BEFORE_END_BITS, frame_bits
from steptwin.features.stm32.chip import can
from steptwin.features.stm32.chip import cells as c
from steptwin.protocol.frame import BITRATES, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.features.stm32.firmware import ImageFirmware

_GRAINS_PER_SECOND: Final = COUNTS_PER_SECOND * c.GRAINS
_DATA_MAX: Final = 8


class ImageStation(CanController):
    """The station of an image's chip, from one power-up to the next.

    Attributes:
        bus_offs: how often it went into bus-off.
        joined: how often it began to take part in the bus' traffic.
    """

    def __init__(self, firmware: "ImageFirmware") -> None:
        """Begin off the bus, asleep as bxCAN after a reset."""
        super().__init__(unheard)
        self._firmware = firmware
        self._offered = -1
        """The mailbox whose frame is in `mailboxes`."""
        self._offered_counts = 0
        self._takes_part = False
        self._began_counts = 0
        self.bus_offs: int = 0
        self.joined: int = 0
        super().power_down()

    def power_up(self) -> None:
        """Stay off the bus: the firmware decides when to join it."""

    # --- from the chip

    def follow(self, now_counts: int) -> None:
        """Take over what the firmware has done, and tell the chip whether its frame is on the wire."""
        chip = self._firmware.chip
        if chip is None:
            return
        s = chip.cells
        if not s[can.BASE + can.BTR] & can.LBKM:
            s[c.CAN_SENDING] = self._offered if self._on_wire(self) is not None else -1
        if not s[c.CAN_CHANGED]:
            return
        s[c.CAN_CHANGED] = 0
        takes_part = can.can_takes_part(s) and not s[can.BASE + can.BTR] & can.LBKM
        self.silent = bool(s[can.BASE + can.BTR] & can.SILM)
        if takes_part and not self._takes_part:
            self._join(now_counts)
        elif self._takes_part and not takes_part:
            self.fall_silent()
        elif takes_part and self.bitrate != self.rate_of(chip.cells):
            self.bitrate = self.rate_of(chip.cells)
            self._retuned()
        self._takes_part = takes_part
        self._offer(now_counts)

    def _join(self, now_counts: int) -> None:
        assert self._firmware.chip is not None
        self.bitrate = self.rate_of(self._firmware.chip.cells)
        self._began_counts = now_counts
        self.joined += 1
        if self.state is ErrorState.BUS_OFF:
            self.recovery_sequences_left = RECOVERY_SEQUENCES
        else:
            super().power_up()
        self._retuned()

    def _offer(self, now_counts: int) -> None:
        """Put the frame into `mailboxes` that is sent next; remote and extended frames are none of this bus'."""
        assert self._firmware.chip is not None
        s = self._firmware.chip.cells
        number = can.next_mailbox(s) if self._takes_part and not self.silent else -1
        place = can.BASE + can.TI0R + 4 * number
        if number < 0 or s[place] & (can.IDE | can.RTR):
            self.mailboxes, self._offered = [], -1
            return
        data = s[place + 2].to_bytes(4, "little") + s[place + 3].to_bytes(4, "little")
        frame = Frame(s[place] >> 21, data[: min(s[place + 1] & 15, _DATA_MAX)])
        if number != self._offered or self.mailboxes != [frame]:
            self.mailboxes, self._offered, self._offered_counts = [frame], number, now_counts
        if self.on_bus:
            clock = self._firmware.clock
            self.submitted(now_counts if clock is None else clock.now_counts)

    # --- to the chip

    def sent(self, frame: Frame, now_counts: int) -> None:
        """Empty the mailbox of a frame that has been sent and acknowledged."""
        self.errors.sent()
        self.state = self.errors.state
        self._tell(can.can_sent, self._stamp(frame, now_counts))
        self._tell_errors(0)
        self._offered, self.mailboxes = -1, []
        self.idle_since_counts = now_counts

    def received(self, frame: Frame, now_counts: int) -> None:
        """Receive a valid frame, unless it began before the controller listened; an own frame has lost to it."""
        if self._began(frame, now_counts) < self._began_counts:
            return
        self.errors.received()
        self.state = self.errors.state
        if self._offered >= 0 and self._offered_counts <= self._began(frame, now_counts):
            self._tell(can.can_failed, self._offered, can.ALST)
        data = frame.data.ljust(_DATA_MAX, b"\0")
        low, high = (int.from_bytes(data[at : at + 4], "little") for at in (0, 4))
        self._tell(can.receive_can, frame.cob_id << 21, len(frame.data), low, high, self._stamp(frame, now_counts))
        self._tell_errors(0)

    def sending_failed(self, now_counts: int, *, acknowledged: bool = True) -> None:
        """Count an error in its own frame, which is repeated unless the firmware has forbidden that."""
        mailbox = self._offered
        super().sending_failed(now_counts, acknowledged=acknowledged)
        if mailbox >= 0:
            self._tell(can.can_failed, mailbox, can.TERR)
        self._tell_errors(can.RECESSIVE_ERROR if acknowledged else can.ACKNOWLEDGE_ERROR)

    def receiving_failed(self, now_counts: int, *, first: bool = False) -> None:
        """Count an error in another station's frame."""
        super().receiving_failed(now_counts, first=first)
        self._tell_errors(can.STUFF_ERROR)

    def force_bus_off(self, now_counts: int) -> None:
        """Go into bus-off."""
        super().force_bus_off(now_counts)
        self._tell_errors(0)

    def recover(self, now_counts: int) -> None:
        """Become error active after bus-off."""
        super().recover(now_counts)
        self._tell_errors(0)

    def _note_worse_state(self, now_counts: int) -> None:
        before = self.state
        super()._note_worse_state(now_counts)
        chip = self._firmware.chip
        if self.state is ErrorState.BUS_OFF and before is not ErrorState.BUS_OFF and chip is not None:
            self.bus_offs += 1
            if not chip.cells[can.BASE + can.MCR] & can.ABOM:
                self.power_down()  # until the firmware enters and leaves initialisation (RM0008, 24.7.6)

    def _tell_errors(self, code: int) -> None:
        self._tell(can.set_can_errors, self.errors.transmit_errors, self.errors.receive_errors, code)

    def _tell(self, function: Callable[..., object], *arguments: int) -> None:
        if self._firmware.chip is not None:
            self._firmware.chip.act(function, *arguments)

    # --- bit timing

    def _began(self, frame: Frame, now_counts: int) -> int:
        """Return when a frame began that has become valid now."""
        bits = frame_bits(frame) - VALID_BEFORE_END_BITS
        return now_counts - bits * COUNTS_PER_SECOND // (self.bitrate or BITRATES[-1])

    def _stamp(self, frame: Frame, now_counts: int) -> int:
        """Return the time stamp of a frame: the bit time of its beginning."""
        return self._began(frame, now_counts) * (self.bitrate or BITRATES[-1]) // COUNTS_PER_SECOND & 0xFFFF

    @staticmethod
    def rate_of(s: c.Cells) -> int:
        """Return the bit rate in bit/s: one of the bus' if the difference is in the tolerance of the segments.

        A controller resynchronises by SJW quanta in 10 bits, and must be right after an error flag (ISO 11898-1).
        """
        rate = Fraction(_GRAINS_PER_SECOND, can.can_bit_grains(s))
        timing = s[can.BASE + can.BTR]
        segment1, segment2, jump = (timing >> 16 & 15) + 1, (timing >> 20 & 7) + 1, (timing >> 24 & 3) + 1
        quanta = 1 + segment1 + segment2
        tolerance = min(Fraction(jump, 10 * quanta), Fraction(min(segment1, segment2), 13 * quanta - segment2))
        return next((each for each in BITRATES if abs(rate / each - 1) <= tolerance), round(rate))

    def error(self, bus_bitrate: int) -> str:
        """Return what was wrong with the firmware's communication at a bus' bit rate; empty if nothing was."""
        chip = self._firmware.chip
        if not self.joined or chip is None:
            return ""
        if (rate := self.rate_of(chip.cells)) == bus_bitrate:
            return f"CAN: the controller went into bus-off, {self.bus_offs} times" if self.bus_offs else ""
        timing = chip.cells[can.BASE + can.BTR]
        quanta = 3 + (timing >> 16 & 15) + (timing >> 20 & 7)
        clock_hz = rate * quanta * ((timing & 0x3FF) + 1)
        return (
            f"CAN: BTR = 0x{timing:08X} makes {rate} bit/s of PCLK1 = {clock_hz / 1e6:.6g} MHz; the bus has"
            f" {bus_bitrate} bit/s, so no frame can be sent or received"
        )
