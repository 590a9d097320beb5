"""The interface between an emulated board and its firmware, which is StepTwin's or a user's library.

The board passes frames, input levels and time. The firmware returns frames, pin changes and pulse edges. Instants are
in counts of the board's timer. Pulses may be computed ahead of time, in whole servo ticks.
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
        """Number of pulses since the last drain."""
        ...

    def quiet_ticks(self, steps: int) -> int:
        """Return the number of ticks in which the running axis certainly makes fewer than `steps` steps."""
        ...

    def take_edges(self) -> PinEdges:
        """Return the axis' edges since the last call."""
        ...


class BoardPulses(Protocol):
    """The pulses of all axes of a board."""

    @property
    def axes(self) -> Sequence[PulseSource]:
        """The axes."""
        ...

    @property
    def tick(self) -> int:
        """First servo tick that is not computed yet."""
        ...

    @property
    def starts(self) -> int:
        """Number of axis starts. While it does not change, no further axis has begun to run."""
        ...

    @property
    def running_axes(self) -> Collection[int]:
        """Axes that may make pulses."""
        ...

    @property
    def events(self) -> Sized:
        """Events at the start of `tick` that need the firmware's attention."""
        ...

    @property
    def room_ticks(self) -> int:
        """Number of ticks whose edges certainly fit before they must be taken."""
        ...

    def take_edges(self) -> Sequence[PinEdges]:
        """Return all edges since the last call, by axis."""
        ...


class FrameQueue(Protocol):
    """Frames that wait for a mailbox of the CAN controller."""

    @property
    def due_counts(self) -> int | None:
        """End of a pause in which `take` withholds frames; None if there is no pause."""
        ...

    @property
    def services(self) -> Sized:
        """Waiting frames that have priority."""
        ...

    @property
    def process_data(self) -> Sized:
        """Waiting frames of process data."""
        ...

    def take(self, mailboxes: Collection[Frame], idle_since_counts: int, now_counts: int) -> Frame | None:
        """Return the frame to put into a free mailbox now; None if all must wait.

        Args:
            mailboxes: frames in the other mailboxes.
            idle_since_counts: instant when the last mailbox became empty, if all are empty.
            now_counts: present instant.
        """
        ...


class BoardFirmware(Protocol):
    """The firmware from one power-up to the next."""

    @property
    def motion(self) -> BoardPulses:
        """The pulses of all axes."""
        ...

    @property
    def transmit(self) -> FrameQueue:
        """The frames to send."""
        ...

    @property
    def pins(self) -> Sequence[PinChange]:
        """Pin changes since the last `take_pins`."""
        ...

    @property
    def due_counts(self) -> int | None:
        """Next instant when the firmware has work without a frame, input or motion event; None for never."""
        ...

    @property
    def next_due_counts(self) -> int | None:
        """Next instant when the firmware has work without a frame or input; None for never."""
        ...

    def boot(self, now_counts: int) -> None:
        """Boot after power-up or reset."""
        ...

    def receive(self, frame: Frame, now_counts: int) -> None:
        """Process a frame from the bus."""
        ...

    def hears(self, cob_id: int) -> bool:
        """Return whether the CAN controller's filters pass an identifier."""
        ...

    def on_can_error(self, code: ErrorCode, now_counts: int, *, active: bool) -> None:
        """Handle an error of the CAN controller, or its end."""
        ...

    def on_bus_off(self, now_counts: int) -> None:
        """Handle the bus-off of the CAN controller."""
        ...

    def set_inputs(self, inputs: Sequence[DigitalInput], now_counts: int) -> None:
        """Set the input levels of all axes at the start of the present servo tick."""
        ...

    def measure(self, supply_10mv: int, temperature_decidegc: int, now_counts: int) -> None:
        """Set the readings of the analogue inputs."""
        ...

    def advance(self, until_counts: int) -> int:
        """Advance time; return the instant reached.

        It is earlier than `until_counts` if frames or pin changes may be waiting, or if the edges must be taken.
        """
        ...

    def poll(self, now_counts: int) -> None:
        """Do the work that is due by now."""
        ...

    def take_pins(self) -> Sequence[PinChange]:
        """Return the pin changes since the last call, in order."""
        ...


class BoardProgram(Protocol):
    """The program in the flash of a board's processor."""

    def start(self, board: "Board") -> BoardFirmware:
        """Return the firmware after a power-up or reset; it does nothing before `boot`."""
        ...

    def connect(self, board: "Board") -> None:
        """Connect the firmware to the rest of the board: its drivers and a new CAN controller."""
        ...


class OtherFirmwareError(Exception):
    """A caller needs StepTwin's firmware, but the board runs another one."""


class FirmwareError(Exception):
    """A board's firmware cannot be loaded, has crashed, hangs, or violates the interface."""
