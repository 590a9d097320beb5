"""A CAN bus in virtual time: arbitration by identifier, exact frame lengths, errors, bus-off, log."""

from array import array
from collections.abc import Callable
from enum import Enum, auto
from typing import Final

from steptwin.emulator.bus.can_controller import CanController, ErrorState
from steptwin.emulator.bus.can_timing import INTERMISSION_BITS, UNSTUFFED_TAIL_BITS, VALID_BEFORE_END_BITS, frame_bits
from steptwin.emulator.bus.frame_filter import FiltersInForce, FrameFilter, StrikeEffect
from steptwin.protocol.frame import BITRATES, COB_ID_MASK, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

_ACK_SLOT_END_BITS: Final = UNSTUFFED_TAIL_BITS - 2
"""Bits from the end of the ACK slot to the end of the frame."""
_FLAG_BITS: Final = 6
_ECHOED_FLAG_BITS: Final = 7
"""Bits of the sender's error flag and of the receivers' flags that follow it, which end one bit later."""
_DELIMITER_BITS: Final = 8
_SUSPEND_BITS: Final = 8
"""Additional bits that an error passive station waits after its own frame (ISO 11898-1, suspend transmission)."""
_RECESSIVE_SEQUENCE_BITS: Final = 11
_STUFF_ERROR_BITS: Final = 6
"""Number of consecutive equal bits that every station detects as an error."""


Log = Callable[[Frame, int], None]


class _Outcome(Enum):
    """Result of a transmission."""

    VALID = auto()
    DOUBLED = auto()
    """Valid for the receivers, but not for the senders, which repeat it."""
    DISTURBED = auto()
    UNACKNOWLEDGED = auto()


_DELIVERED: Final = (_Outcome.VALID, _Outcome.DOUBLED)
"""Outcomes in which the receivers have the frame."""
_NO_EFFECT: Final = StrikeEffect()
"""Effect on an attempt without a filter strike."""


class Bus:
    """The wire between the stations.

    It works by events: `next_event_counts` is the instant of the next event, and `step` executes it and delivers valid
    frames. The methods share the state of one transmission and the list of stations in bus-off. Frame lengths, error
    counters and filters are in `can_timing`, `can_controller` and `frame_filter`.
    """

    def __init__(self, bitrate: int, log: Log | None = None) -> None:
        """Create a bus without stations.

        Args:
            bitrate: one of BITRATES.
            log: called with each frame and the instant when it became valid; by default the bus stores them.
        """
        if bitrate not in BITRATES:
            raise ValueError(f"bit rate {bitrate} is not one of {', '.join(map(str, BITRATES))}")
        self.bitrate: Final = bitrate
        """Nominal bit rate of the bus."""
        self.bit_counts: int = COUNTS_PER_SECOND // bitrate
        """Duration of a bit at the host's bit rate."""
        self.host_bitrate: int = bitrate
        """Bit rate of the host's station."""
        self._log = log or self._keep
        self.log_counts: array[int] = array("q")
        """Instants when the frames became valid at their receivers; empty if `log` was given."""
        self.log_frames: list[Frame] = []
        self.frames: int = 0
        """Number of frames that became valid."""
        self.error_frames: int = 0
        """Number of transmissions that ended in an error frame."""
        self._busy_counts = 0
        """Time during which frames and error frames have occupied the wire."""
        self.next_event_counts: int | None = None
        """Instant of the next event: end of a transmission, arbitration, or a station's return from bus-off."""
        self.busy: bool = False
        """True while a frame is on the wire, or waits for the wire or for the end of a bus-off."""
        self.filters: FiltersInForce = FiltersInForce()
        """Active filters, which may delay, disturb, double or lose frames."""
        self._waiting: list[tuple[Frame, type[FrameFilter] | None]] = []
        """Waiting frames that a filter has struck, with its class, if that strikes a frame only once."""
        self._stations: list[CanController] = []
        self._off: list[CanController] = []
        """Stations in bus-off."""
        self._detuned: list[CanController] = []
        """Stations on the bus with another bit rate than the host."""
        self._on_bus = 0
        """Number of stations on the bus with the host's bit rate that acknowledge frames."""
        self._frame: Frame | None = None
        """Frame on the wire; None while the wire is idle."""
        self._decided_counts = 0
        """Instant when the frame becomes valid, or its error flag ends."""
        self._outcome = _Outcome.VALID
        self._senders: list[CanController] = []
        self._outdone: list[CanController] = []
        """Stations that have begun to send a different frame with the same identifier."""
        self._missed_by: list[CanController] = []
        self._struck_by: type[FrameFilter] | None = None
        """Class of the filter that has struck last; None before the first strike."""
        self._free_counts = 0
        self._idle_since_counts = 0
        """Instant up to which recessive bits have been counted for the stations in bus-off."""

    @property
    def busy_bits(self) -> int:
        """Time during which frames and error frames have occupied the wire, in bits at the nominal rate."""
        return self._busy_counts * self.bitrate // COUNTS_PER_SECOND

    @property
    def free_counts(self) -> int:
        """Earliest start of the next frame: the end of the last intermission."""
        return self._free_counts

    def attach(self, station: CanController) -> None:
        """Connect a station's controller to the wire."""
        self._stations.append(station)
        self._connect(station)
        self._note_who_is_off()

    def _connect(self, station: CanController) -> None:
        station.bitrate = station.bitrate or self.bitrate
        station.connect(self._submitted, self._retuned, self._sent_by)

    def _sent_by(self, station: CanController) -> Frame | None:
        return self._frame if station in self._senders or station in self._outdone else None

    def _retuned(self) -> None:
        """Update the stations after one has left the bus, or has returned, perhaps with another bit rate."""
        self._note_who_is_off()
        if self._frame is None:
            self._schedule()

    def set_host_bitrate(self, host: CanController, bitrate: int) -> None:
        """Change the bit rate of the host's station to one of BITRATES, from the next frame on.

        Stations with another rate than the host see each of its frames as an error, and vice versa. The bus has one
        rate at a time: two stations with the same other rate do not understand each other either.
        """
        self.host_bitrate, self.bit_counts = bitrate, COUNTS_PER_SECOND // bitrate
        host.tune(bitrate)

    def listen(self, listener: Log) -> None:
        """Call a listener with each frame that becomes valid from now on, before the receivers."""
        log = self._log

        def log_and_tell(frame: Frame, now_counts: int) -> None:
            log(frame, now_counts)
            listener(frame, now_counts)

        self._log = log_and_tell

    def _submitted(self, now_counts: int) -> None:
        """Schedule an arbitration for a station that has a frame to send."""
        if self._frame is None and not (self.busy and self.next_event_counts == self._free_counts):
            self._free_counts = now_counts if now_counts > self._free_counts else self._free_counts
            self._schedule()

    def _schedule(self) -> None:
        """Determine the next event of an idle wire."""
        next_counts, self.busy = None, False
        for station in self._stations:
            if station.mailboxes:
                self.busy = True
            elif station.on_bus:
                continue
            if station.on_bus:
                silent_counts = station.silent_until_counts
                event_counts = silent_counts if silent_counts > self._free_counts else self._free_counts
            else:
                event_counts = self._recovery_counts(station)
            if next_counts is None or event_counts < next_counts:
                next_counts = event_counts
        self.next_event_counts = next_counts

    def step(self, now_counts: int) -> None:
        """Execute the due event: end of a transmission, return from bus-off, or arbitration."""
        if self.next_event_counts is None or self.next_event_counts > now_counts:
            return
        if self._frame:
            self._end(self._frame, self._decided_counts)
        else:
            if self._off:
                self._recover(now_counts)
            self._arbitrate(now_counts)
        if self._frame is None:
            self._schedule()

    # --- a transmission

    def _arbitrate(self, now_counts: int) -> None:
        """Let the frame with the lowest identifier win; stations with equal identifiers continue together.

        If their bits differ later, the stations with a recessive bit detect a bit error. The error flag of an error
        active station destroys the frame; that of an error passive station is recessive and has no effect.
        """
        if self._free_counts > now_counts:
            return
        ready: list[CanController] = []
        for station in self._stations:
            if station.mailboxes and station.on_bus and station.silent_until_counts <= now_counts:
                ready = [*ready, station]
        if not ready:
            return
        frame = ready[0].mailboxes[0]
        senders, outdone = ready, []
        if ready[1:]:
            frame = min((station.mailboxes[0] for station in ready), key=_bits_in_order)
            senders = [station for station in ready if station.mailboxes[0] == frame]
            outdone = [
                station
                for station in ready
                if station.mailboxes[0].cob_id == frame.cob_id and station.mailboxes[0] != frame
            ]
        effect = self._strike(frame, now_counts) if self.filters.in_force else _NO_EFFECT
        if effect.hold_counts:
            for station in senders:
                station.silent_until_counts = max(station.silent_until_counts, now_counts + effect.hold_counts)
        elif effect.sender_off:
            for station in senders:
                self.throw_off(station, now_counts)
        else:
            self._begin(frame, senders, outdone, effect, now_counts)

    def _strike(self, frame: Frame, now_counts: int) -> StrikeEffect:
        """Return the effect of a filter on an attempt. Waiting frames are compared by identity, as bytes may repeat."""
        struck_by = self.filters.strike(frame, now_counts, [kind for each, kind in self._waiting if each is frame])
        if struck_by is None:
            return _NO_EFFECT
        effect, self._struck_by = struck_by.effect(), type(struck_by)
        if effect.hold_counts:
            self._waiting.append((frame, self._struck_by))
        return effect

    def end_filter(self, ended: FrameFilter, now_counts: int) -> None:
        """Remove a filter, if it is active."""
        self.filters.end(ended)
        if ended.effect().hold_counts:
            self._release(now_counts)

    def end_filters(self, now_counts: int) -> None:
        """Remove all filters."""
        self.filters.end_all()
        self._release(now_counts)

    def _release(self, now_counts: int) -> None:
        """Let delayed stations take part in the next arbitration, after at most the pause of error passive stations."""
        latest_counts = now_counts + _SUSPEND_BITS * self.bit_counts
        for station in self._stations:
            station.silent_until_counts = min(station.silent_until_counts, latest_counts)
        if self._frame is None:
            self._schedule()

    def _judge(self, senders: list[CanController], outdone: list[CanController], effect: StrikeEffect) -> _Outcome:
        if effect.disturbed:
            return _Outcome.DISTURBED
        for station in self._detuned:  # a sender's wrong bit rate is an error for all others
            sends_flag = station.state is not ErrorState.PASSIVE and not station.silent
            if station in senders or station in outdone or sends_flag:
                return _Outcome.DISTURBED  # or a receiver's error flag, which is dominant unless it is error passive
        if outdone and any(station.state is not ErrorState.PASSIVE for station in outdone):
            return _Outcome.DISTURBED
        if self._on_bus == len(senders) + len(outdone):  # no other station can acknowledge
            return _Outcome.UNACKNOWLEDGED
        return _Outcome.DOUBLED if effect.doubled else _Outcome.VALID

    def _begin(
        self,
        frame: Frame,
        senders: list[CanController],
        outdone: list[CanController],
        effect: StrikeEffect,
        now_counts: int,
    ) -> None:
        """Begin the transmission of a frame.

        A disturbance is detected at the end of the CRC, which costs most time. A disturbance that doubles the frame is
        in the last bit of EOF, for which receivers do not wait (ISO 11898-1).
        """
        bits = frame_bits(frame)
        decided_bits = bits - VALID_BEFORE_END_BITS
        self._outcome = _Outcome.VALID
        if effect is not _NO_EFFECT or outdone or senders[1:] or self._on_bus == 1 or self._detuned:
            self._outcome = self._judge(senders, outdone, effect)
        if self._outcome is _Outcome.DOUBLED:
            bits += _ECHOED_FLAG_BITS + _DELIMITER_BITS
        elif self._outcome is not _Outcome.VALID:
            if self._outcome is _Outcome.DISTURBED:
                decided_bits = bits - UNSTUFFED_TAIL_BITS + _ECHOED_FLAG_BITS
            else:
                decided_bits = bits - _ACK_SLOT_END_BITS + _FLAG_BITS
            bits = decided_bits + _DELIMITER_BITS + INTERMISSION_BITS
        if self._off:
            self._count_idle(now_counts)
        duration_counts = bits * self.bit_counts
        self._busy_counts += duration_counts
        self._free_counts = now_counts + duration_counts
        self.next_event_counts = self._decided_counts = now_counts + decided_bits * self.bit_counts
        self._frame, self._senders, self._outdone = frame, senders, outdone
        self._missed_by = [] if effect is _NO_EFFECT else self._stations[effect.lost_by]
        if self._detuned:
            self._missed_by = self._missed_by + self._detuned

    def _end(self, frame: Frame, now_counts: int) -> None:
        self._frame = None
        senders, outdone = self._senders, self._outdone
        if self._outcome in _DELIVERED:
            self._deliver(frame, now_counts)
        else:
            self._fail(now_counts)
        for station in senders + outdone:
            if station.state is ErrorState.PASSIVE:
                station.silent_until_counts = self._free_counts + _SUSPEND_BITS * self.bit_counts
        # Delimiter, end of frame and intermission, or error delimiter and intermission: 11 recessive bits.
        if self._off:
            self._count_recessive(1)
        self._idle_since_counts = self._free_counts

    def _deliver(self, frame: Frame, now_counts: int) -> None:
        senders, outdone, missed_by = self._senders, self._outdone, self._missed_by
        if self._waiting:
            self._waiting = [each for each in self._waiting if each[0] is not frame]
        self.frames += 1
        doubled = self._outcome is _Outcome.DOUBLED
        if doubled:
            self.error_frames += 1
            self._waiting.append((frame, self._struck_by))
        self._log(frame, now_counts)
        for station in self._stations:
            if station in senders:
                if doubled:
                    station.sending_failed(now_counts)
                else:
                    station.sent(frame, now_counts)
            elif station in outdone:
                station.sending_failed(now_counts)
            elif station.on_bus and station not in missed_by:
                station.received(frame, now_counts)
        if outdone or doubled:
            self._note_who_is_off()

    def _keep(self, frame: Frame, now_counts: int) -> None:
        self.log_counts.append(now_counts)
        self.log_frames.append(frame)

    def _fail(self, now_counts: int) -> None:
        senders, outdone = self._senders, self._outdone
        acknowledged = self._outcome is not _Outcome.UNACKNOWLEDGED
        self.error_frames += 1
        for station in self._stations:
            if station in senders:
                station.sending_failed(now_counts, acknowledged=acknowledged)
            elif station in outdone:
                station.sending_failed(now_counts)
            elif station.on_bus:
                station.receiving_failed(now_counts, first=station in self._detuned)
        self._note_who_is_off()

    # --- power

    def exchange(self, gone: CanController, fresh: CanController, now_counts: int) -> None:
        """Replace the controller of a station after a power cycle.

        A frame that the station was sending breaks off. A frame on the wire does not reach the new controller.
        """
        self._stations[self._stations.index(gone)] = fresh
        self._connect(fresh)
        self._note_who_is_off()
        if self._frame:
            self._drop_out(gone, fresh, now_counts)
        else:
            self._free_counts = max(self._free_counts, now_counts)
            self._schedule()

    def _drop_out(self, gone: CanController, fresh: CanController, now_counts: int) -> None:
        """Remove a station from the present transmission.

        Without its only sender the wire stays recessive, which is a stuff error within the stuffed part of the frame.
        """
        self._senders = [station for station in self._senders if station is not gone]
        self._outdone = [station for station in self._outdone if station is not gone]
        self._missed_by = [*self._missed_by, fresh]
        tail_bits = UNSTUFFED_TAIL_BITS - VALID_BEFORE_END_BITS
        stuffed_until_counts = self._decided_counts - tail_bits * self.bit_counts
        if self._senders or self._outcome not in _DELIVERED or now_counts >= stuffed_until_counts:
            return
        broken_counts = now_counts + (_STUFF_ERROR_BITS + _FLAG_BITS) * self.bit_counts
        free_counts = broken_counts + (_DELIMITER_BITS + INTERMISSION_BITS) * self.bit_counts
        self._busy_counts += free_counts - self._free_counts
        self._free_counts = free_counts
        self._outcome = _Outcome.DISTURBED
        self.next_event_counts = self._decided_counts = broken_counts

    # --- recovery from bus-off

    def _count_recessive(self, sequences: int) -> None:
        for station in self._off:
            station.recovery_sequences_left -= sequences

    def _count_idle(self, now_counts: int) -> None:
        """Count the complete recessive sequences of an idle wire up to now."""
        idle_counts = now_counts - self._idle_since_counts
        self._count_recessive(idle_counts // (_RECESSIVE_SEQUENCE_BITS * self.bit_counts))
        self._idle_since_counts = now_counts

    def _recovery_counts(self, station: CanController) -> int:
        """Return the instant when a station leaves bus-off if the wire stays idle."""
        bits = _RECESSIVE_SEQUENCE_BITS * max(station.recovery_sequences_left, 0)
        return self._idle_since_counts + bits * self.bit_counts

    def _recover(self, now_counts: int) -> None:
        for station in self._off:
            if self._recovery_counts(station) <= now_counts:
                station.recover(now_counts)
        self._note_who_is_off()

    def throw_off(self, station: CanController, now_counts: int) -> None:
        """Force a station into bus-off; a frame that it is sending breaks off."""
        if not station.on_bus:
            return
        if self._frame:
            self._drop_out(station, station, now_counts)
        else:
            self._count_idle(now_counts)
        station.force_bus_off(now_counts)
        self._note_who_is_off()
        if self._frame is None:
            self._schedule()

    def _note_who_is_off(self) -> None:
        self._off = [station for station in self._stations if not station.on_bus]
        self._detuned = [
            station for station in self._stations if station.on_bus and station.bitrate != self.host_bitrate
        ]
        self._on_bus = sum(
            station.on_bus and not station.silent and station not in self._detuned for station in self._stations
        )


def _bits_in_order(frame: Frame) -> tuple[int, int, int, bytes]:
    """Return the fields of a frame in their order on the wire; the lower of two frames has the first dominant bit."""
    return frame.cob_id & COB_ID_MASK, frame.cob_id, len(frame.data), frame.data
