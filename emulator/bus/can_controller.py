"""Model the CAN controller of the STM32F103, bxCAN (RM0008, chapter 24), and the software that fills and empties it.

Three transmit mailboxes are sent by identifier, lowest first (TXFP = 0), unless `in_order` is set. Without a free
mailbox a frame waits in a software queue. A board's firmware has its own queue (`controller/node/transmit_queue.py`)
and sends a frame only to a free mailbox. Two receive FIFOs hold three frames each; a frame for a full FIFO is lost
(RFLM = 1) and flagged as overrun. After bus-off the controller returns automatically (ABOM = 1).

The error counters determine the error states of fault confinement (ISO 11898-1). The thresholds, and the receive
counter after a good reception in error passive, are those of bxCAN (RM0008, section 24.7.6 and CAN_ESR).
"""

from bisect import insort
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Final, Protocol

from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import COB_SDO_REQUEST, NODE_ID_MAX, Frame

_WARNING_FROM = 96
_PASSIVE_ABOVE = 127
_BUS_OFF_ABOVE = 255
_COUNTER_MAX = 255
_RECEIVE_RESET = 120
"""Value to which a good reception sets a receive counter above 128."""
_SENDER_STEP = 8
_FIRST_STEP = 8


class ErrorState(Enum):
    """Error state of a controller."""

    ACTIVE = "error active"
    WARNING = "error warning"
    PASSIVE = "error passive"
    BUS_OFF = "bus-off"


class FaultConfinement:
    """Error counters TEC and REC: a failed frame adds 8 at its sender and 1 at receivers; a good frame subtracts 1.

    A receiver that detects an error first adds 8. On this bus all receivers see a disturbance at the same time, so only
    a controller with a wrong bit rate can be first.
    """

    def __init__(self) -> None:
        self.transmit_errors: int = 0
        self.receive_errors: int = 0

    @property
    def state(self) -> ErrorState:
        """Error state by the counters."""
        worst = max(self.transmit_errors, self.receive_errors)
        if self.transmit_errors > _BUS_OFF_ABOVE:
            return ErrorState.BUS_OFF
        if worst > _PASSIVE_ABOVE:
            return ErrorState.PASSIVE
        return ErrorState.WARNING if worst >= _WARNING_FROM else ErrorState.ACTIVE

    def sent(self) -> None:
        """Count a frame that was sent."""
        if self.transmit_errors:
            self.transmit_errors -= 1

    def received(self) -> None:
        """Count a frame that was received."""
        if self.receive_errors > _PASSIVE_ABOVE + 1:
            self.receive_errors = _RECEIVE_RESET
        elif self.receive_errors:
            self.receive_errors -= 1

    def sending_failed(self, *, acknowledged: bool = True) -> None:
        """Count an error in its own frame, except a missing acknowledgement in error passive: it may be alone."""
        if acknowledged or self.state is not ErrorState.PASSIVE:
            self.transmit_errors += _SENDER_STEP

    def receiving_failed(self, *, first: bool = False) -> None:
        """Count an error in another station's frame; `first`: it has detected the error before all others."""
        self.receive_errors = min(self.receive_errors + (_FIRST_STEP if first else 1), _COUNTER_MAX)

    def force_bus_off(self) -> None:
        """Set the counters as after 32 failed attempts in a row."""
        self.transmit_errors = _BUS_OFF_ABOVE + 1

    def reset(self) -> None:
        """Reset the counters, as after power-up or bus-off."""
        self.transmit_errors = self.receive_errors = 0


MAILBOXES: Final = 3
FIFO_DEPTH: Final = 3
RECOVERY_SEQUENCES: Final = 128
"""Sequences of 11 recessive bits until a controller leaves bus-off (ISO 11898-1; RM0008, 24.7.6)."""

_NEVER_SEQUENCES: Final = 1 << 40
"""More recessive sequences than ever occur: a controller without power does not return by itself."""

_SDO_REQUESTS: Final = range(COB_SDO_REQUEST + 1, COB_SDO_REQUEST + NODE_ID_MAX + 1)

Receiver = Callable[[Frame, int], None]
Filter = Callable[[int], bool]


class ErrorListener(Protocol):
    """Called when an error of the controller begins and when it ends."""

    def __call__(self, code: ErrorCode, now_counts: int, /, *, active: bool) -> None: ...


BusOffListener = Callable[[int], None]
"""Called with the instant when the controller goes into bus-off."""


def unheard(_frame: Frame, _now_counts: int) -> None:
    """Ignore frames; for a station that does not receive, or does not need its sent frames."""


def _everything(_cob_id: int) -> bool:
    return True


def _at_ease(_now_counts: int) -> None:
    """Ignore bus-off."""


def _nothing(_code: ErrorCode, _now_counts: int, *, active: bool) -> None:
    """Ignore errors of the controller."""


class CanController:
    """CAN controller of one station. The bus calls `connect`; the station calls `poll` at `next_due_counts`."""

    def __init__(
        self,
        receive: Receiver,
        on_error: ErrorListener = _nothing,
        passes: Filter = _everything,
        read_latency_counts: int = 0,
        on_sent: Receiver = unheard,
        *,
        on_bus_off: BusOffListener = _at_ease,
        in_order: bool = False,
    ) -> None:
        """Connect a processor.

        Args:
            receive: called with each received frame and the instant.
            on_error: called at overrun, error passive and return from bus-off.
            passes: acceptance filter: returns True for a COB-ID that is received.
            read_latency_counts: time from a frame's arrival until it is read from its FIFO. With 0 (an interrupt
                without delay) there is no overrun.
            on_sent: called with each sent frame of this station and the instant.
            on_bus_off: called at bus-off, like the interrupt BOFF.
            in_order: True to send mailboxes in the order of filling (TXFP = 1), not by identifier.
        """
        self.errors: FaultConfinement = FaultConfinement()
        self.state: ErrorState = ErrorState.ACTIVE
        self.on_bus: bool = True
        """True while the station sends, receives and acknowledges; False in bus-off."""
        self.read_latency_counts = read_latency_counts
        self.mailboxes: list[Frame] = []
        """Frames that wait for the bus, in the order of sending.

        All identifiers differ. If two mailboxes had the same one, bxCAN would send the lower mailbox first, which may
        hold the newer frame. So a frame waits in the queue until no mailbox has its identifier."""
        self.idle_since_counts: int = 0
        """Instant when the station's last frame was sent."""
        self.submitted: Callable[[int], None] = lambda _now_counts: None
        """Called when there is a frame to send; the bus sets it by `connect`."""
        self.bitrate: int | None = None
        """Bit rate in bit/s; None for the nominal rate of the bus."""
        self._retuned: Callable[[], None] = lambda: None
        self._on_wire: Callable[[CanController], Frame | None] = lambda _: None
        self.silent: bool = False
        """True for a station that only listens: it neither acknowledges frames nor sends error flags."""
        self.silent_until_counts = 0
        """Instant before which the station does not start a transmission."""
        self.recovery_sequences_left: int = 0
        """Remaining sequences of 11 recessive bits in bus-off."""
        self.overruns: int = 0
        """Number of frames lost because their FIFO was full."""
        self.receive = receive
        self.on_sent = on_sent
        self._in_order = in_order
        self._on_error = on_error
        self._on_bus_off = on_bus_off
        self._active: set[ErrorCode] = set()
        """Active errors."""
        self._passes = passes
        self._queue: deque[Frame] = deque()
        self._fifos: tuple[deque[Frame], deque[Frame]] = (deque(), deque())
        self._overrun = False
        """True while a FIFO's overrun flag is set (FOVR)."""
        self.next_due_counts: int | None = None
        """Instant when the processor empties the FIFOs; None while they are empty."""

    # --- out

    def connect(
        self,
        submitted: Callable[[int], None],
        retuned: Callable[[], None],
        on_wire: "Callable[[CanController], Frame | None]",
    ) -> None:
        """Connect the bus.

        Args:
            submitted: announces a frame to send.
            retuned: announces a change of bit rate or presence.
            on_wire: returns the frame that a station is sending; None if it sends none.
        """
        self.submitted, self._retuned, self._on_wire = submitted, retuned, on_wire

    @property
    def waiting(self) -> int:
        """Number of frames that wait for the bus."""
        return len(self.mailboxes) + len(self._queue)

    @property
    def has_free_mailbox(self) -> bool:
        """True if a mailbox is free."""
        return len(self.mailboxes) < MAILBOXES

    def send(self, frame: Frame, now_counts: int) -> None:
        """Send a frame as soon as possible; without a free mailbox it waits in an unlimited queue."""
        if self.mailboxes:
            self._queue.append(frame)
            self._fill_mailboxes()
        else:  # then the queue is empty, too
            self.mailboxes.append(frame)
        self.submitted(now_counts)

    def _fill_mailboxes(self) -> None:
        queue, mailboxes = self._queue, self.mailboxes
        while queue and len(mailboxes) < MAILBOXES:
            if mailboxes and any(frame.cob_id == queue[0].cob_id for frame in mailboxes):
                return
            if self._in_order:
                mailboxes.append(queue.popleft())
            else:
                insort(mailboxes, queue.popleft())

    def sent(self, frame: Frame, now_counts: int) -> None:
        """Remove a frame that has been sent and acknowledged."""
        self.mailboxes.remove(frame)
        self.idle_since_counts = now_counts
        if self.on_sent is not unheard:
            self.on_sent(frame, now_counts)
        if self._queue:
            self._fill_mailboxes()
        if self.errors.transmit_errors or self._active:
            self.errors.sent()
            self._note_good_frame(now_counts)

    # --- in

    def received(self, frame: Frame, now_counts: int) -> None:
        """Receive a valid frame, unless the filter rejects it."""
        if self.errors.receive_errors or self._active:
            self.errors.received()
            self._note_good_frame(now_counts)
        if not self._passes(frame.cob_id):
            return
        if not self.read_latency_counts:
            self.receive(frame, now_counts)
        else:
            self._store(frame, now_counts)

    def _store(self, frame: Frame, now_counts: int) -> None:
        """Store a frame in its FIFO: SDO requests in FIFO 1, so they do not displace process data in FIFO 0."""
        number = int(frame.cob_id in _SDO_REQUESTS)
        if len(self._fifos[number]) == FIFO_DEPTH:
            self.overruns += 1
            self._overrun = True
            return
        self._fifos[number].append(frame)
        if self.next_due_counts is None:
            self.next_due_counts = now_counts + self.read_latency_counts

    def poll(self, now_counts: int) -> None:
        """Let the processor read both FIFOs if that is due. An overrun ends when its flag is clear."""
        if self.next_due_counts is None or self.next_due_counts > now_counts:
            return
        self.next_due_counts = None
        overrun, self._overrun = self._overrun, False
        if overrun:
            self._note_error(ErrorCode.CAN_OVERRUN, now_counts, active=True)
        for fifo in self._fifos:
            while fifo:
                self.receive(fifo.popleft(), now_counts)
        if not overrun:
            self._note_error(ErrorCode.CAN_OVERRUN, now_counts, active=False)

    # --- errors

    def sending_failed(self, now_counts: int, *, acknowledged: bool = True) -> None:
        """Count an error in a frame of this station; the frame stays in its mailbox and is repeated (NART = 0)."""
        self.errors.sending_failed(acknowledged=acknowledged)
        self._note_worse_state(now_counts)

    def receiving_failed(self, now_counts: int, *, first: bool = False) -> None:
        """Count an error in another station's frame; `first`: it has detected the error before all others."""
        self.errors.receiving_failed(first=first)
        self._note_worse_state(now_counts)

    def power_down(self) -> None:
        """Lose power or enter reset: no sending, receiving or acknowledging until `power_up`."""
        self.on_bus = False
        self.recovery_sequences_left = _NEVER_SEQUENCES

    def power_up(self) -> None:
        """Return to the bus; the caller attaches the controller again."""
        self.on_bus = True
        self.recovery_sequences_left = 0

    def fall_silent(self) -> None:
        """Leave the bus until `tune`, like a controller in initialisation; a frame on the wire still ends."""
        self.power_down()
        self._retuned()

    def tune(self, bitrate: int | None) -> None:
        """Return to the bus with this bit rate (None: the present one) and without errors."""
        self.bitrate = bitrate or self.bitrate
        self.errors.reset()
        self.state = ErrorState.ACTIVE
        self.power_up()
        self._retuned()

    def force_bus_off(self, now_counts: int) -> None:
        """Go into bus-off, as after too many failed attempts."""
        self.errors.force_bus_off()
        self._note_worse_state(now_counts)

    def _note_worse_state(self, now_counts: int) -> None:
        before, self.state = self.state, self.errors.state
        if self.state is before:
            return
        if self.state is ErrorState.PASSIVE:
            self._note_error(ErrorCode.CAN_ERROR_PASSIVE, now_counts, active=True)
        elif self.state is ErrorState.BUS_OFF:
            self.on_bus = False
            self.recovery_sequences_left = RECOVERY_SEQUENCES
            self._on_bus_off(now_counts)

    def _note_good_frame(self, now_counts: int) -> None:
        self.state = self.errors.state
        if self.state is not ErrorState.PASSIVE:
            self._note_error(ErrorCode.CAN_ERROR_PASSIVE, now_counts, active=False)
        self._note_error(ErrorCode.CAN_BUS_OFF_RECOVERED, now_counts, active=False)

    def recover(self, now_counts: int) -> None:
        """Become error active after bus-off; report this as an error until a frame has been transferred."""
        self.errors.reset()
        self.state = ErrorState.ACTIVE
        self.on_bus = True
        self._note_error(ErrorCode.CAN_BUS_OFF_RECOVERED, now_counts, active=True)
        self._note_error(ErrorCode.CAN_ERROR_PASSIVE, now_counts, active=False)

    def _note_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Report the begin or end of an error to the processor, once."""
        if active is (code in self._active):
            return
        if active:
            self._active.add(code)
        else:
            self._active.remove(code)
        self._on_error(code, now_counts, active=active)
