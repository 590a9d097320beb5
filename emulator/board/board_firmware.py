"""What a board asks of the firmware that its processor runs: our own is one, a user's library another.

The board passes frames, input levels and time; the firmware answers with frames, pin changes and pulse edges. Instants
are in counts of the board's timer. Pulses may be computed ahead of time, in whole servo ticks.
"""

from collections.abc import Collection, Sequence, Sized
from typing import TYPE_CHECKING, Protocol

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.node.pins import PinChange
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.frame import Frame

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board


class PulseSource(Protocol):
    """The pulses of one axis."""

    @property
    def running(self) -> bool:
        """True while the axis may make pulses."""
        ...

    @property
    def undrained_pulses(self) -> int:
        """Number of pulses begun since the last drain."""
        ...

    def quiet_ticks(self, steps: int) -> int:
        """Return for how many ticks the running axis certainly makes fewer steps than these."""
        ...

    def take_edges(self) -> PinEdges:
        """Return the axis' edges that have not been taken."""
        ...


class BoardPulses(Protocol):
    """The pulses of all axes of a board."""

    @property
    def axes(self) -> Sequence[PulseSource]:
        """The axes."""
        ...

    @property
    def tick(self) -> int:
        """The first servo tick not yet computed; after an `advance` to a count before a tick, it is that tick."""
        ...

    @property
    def starts(self) -> int:
        """Number of times that an axis has begun to run: while it stays the same, no other axis does."""
        ...

    @property
    def running_axes(self) -> Collection[int]:
        """The axes that may make pulses."""
        ...

    @property
    def events(self) -> Sized:
        """What asks for the firmware's attention at the start of `tick`."""
        ...

    @property
    def room_ticks(self) -> int:
        """Number of ticks whose edges are sure to find room before they must be taken."""
        ...

    def take_edges(self) -> Sequence[PinEdges]:
        """Return all edges that have not been taken, by axis."""
        ...


class FrameQueue(Protocol):
    """The frames that wait for a mailbox of the CAN controller."""

    @property
    def due_counts(self) -> int | None:
        """Instant when `take` gives a frame that it now withholds, if a mailbox is free; None if it withholds none."""
        ...

    @property
    def services(self) -> Sized:
        """Frames that wait and go first."""
        ...

    @property
    def process_data(self) -> Sized:
        """Frames that wait and go last."""
        ...

    def take(self, mailboxes: Collection[Frame], idle_since_counts: int, now_counts: int) -> Frame | None:
        """Return the frame to put into a free mailbox now; None if all must wait.

        Args:
            mailboxes: the frames in the other mailboxes.
            idle_since_counts: if there are none, the instant when the last one was sent.
            now_counts: the present instant.
        """
        ...


class BoardFirmware(Protocol):
    """The firmware from one power-up to the next."""

    @property
    def motion(self) -> BoardPulses:
        """Its pulses."""
        ...

    @property
    def transmit(self) -> FrameQueue:
        """Its frames."""
        ...

    @property
    def pins(self) -> Sequence[PinChange]:
        """Pin changes since the last `take_pins`."""
        ...

    @property
    def due_counts(self) -> int | None:
        """The next known instant when it has work without a frame, an input or an event of its motion; None: never."""
        ...

    @property
    def next_due_counts(self) -> int | None:
        """The same, of its motion's events, too."""
        ...

    def boot(self, now_counts: int) -> None:
        """Begin."""
        ...

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Take a frame from the bus."""
        ...

    def hears(self, cob_id: int) -> bool:
        """Return whether the CAN controller's filters pass an identifier."""
        ...

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Take note of an error of the CAN controller, or of its end."""
        ...

    def on_bus_off(self, now_counts: int) -> None:
        """Take note that the CAN controller has left the bus."""
        ...

    def set_inputs(self, inputs: Sequence[DigitalInput], now_counts: int) -> None:
        """Take the levels of all axes' inputs, as of the servo tick that begins now."""
        ...

    def measure(self, supply_10mv: int, temperature_decidegc: int, now_counts: int) -> None:
        """Take the readings of the analogue inputs."""
        ...

    def advance(self, until_counts: int) -> int:
        """Let time pass; return the instant reached.

        That is an earlier one if frames or pin changes may be waiting, or if the edges must be taken.
        """
        ...

    def poll(self, now_counts: int) -> None:
        """Do the work that is due by now."""
        ...

    def take_pins(self) -> Sequence[PinChange]:
        """Return the pin changes since the last call, in order."""
        ...


class BoardProgram(Protocol):
    """What stands in the flash of a board's processor, and outlives the power."""

    def start(self, board: "Board") -> BoardFirmware:
        """Return the firmware that begins at power-up or after a reset; it does nothing before `boot`."""
        ...

    def connect(self, board: "Board") -> None:
        """Take note of the rest of the board that this firmware has: its drivers, and a new CAN controller."""
        ...


class OtherFirmwareError(Exception):
    """A caller asks for what only our own firmware has, on a board that runs another."""


class FirmwareError(Exception):
    """A board's firmware cannot be loaded, has crashed or hangs, or has broken the interface; one sentence says it."""
