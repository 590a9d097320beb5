"""A board with a crystal error: its time passes faster or slower than that of the simulation.

Inside of such a board all instants, edges and pin changes included, are in counts of its own timer. Simulation and bus
use the simulation's time. The methods here convert between both.
"""

from collections.abc import Callable

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.board.board_firmware import BoardProgram
from steptwin.emulator.board.local_clock import LocalClock
from steptwin.emulator.bus.can_controller import CanController
from steptwin.emulator.operations import BoardOperation
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.frame import Frame


def make_board(
    config: BoardConfig, kernel: Kernel, flash: list[FlashPage] | None = None, program: BoardProgram | None = None
) -> Board:
    """Return a board without power: a `DriftingBoard` if its crystal has an error, else a `Board`."""
    kind = DriftingBoard if config.crystal_ppm else Board
    return kind(config, kernel, flash, program)


class DriftingController(CanController):
    """CAN controller of a drifting board: the bus uses the simulation's time, the processor its own.

    The crystal does not affect the bit timing: a controller synchronises to the edges of each sender.
    """

    def __init__(self, clock: LocalClock, board: Board) -> None:
        """Connect the controller to a board's firmware, as for a board with an exact crystal."""
        firmware = board.running
        super().__init__(
            firmware.receive,
            firmware.on_can_error,
            firmware.hears,
            board.config.read_latency_counts,
            on_bus_off=firmware.on_bus_off,
        )
        self._clock = clock

    def connect(
        self,
        submitted: Callable[[int], None],
        retuned: Callable[[], None],
        on_wire: Callable[[CanController], Frame | None],
    ) -> None:
        """Connect the bus, which receives instants in its own time."""
        clock = self._clock
        super().connect(lambda _local_counts: submitted(clock.now_counts), retuned, on_wire)

    def sent(self, frame: Frame, now_counts: int) -> None:
        """Remove a frame that was sent and acknowledged."""
        super().sent(frame, self._clock.enter(now_counts))

    def received(self, frame: Frame, now_counts: int) -> None:
        """Receive a valid frame, unless the filter rejects it."""
        super().received(frame, self._clock.enter(now_counts))

    def sending_failed(self, now_counts: int, *, acknowledged: bool = True) -> None:
        """Count an error in a frame of this station."""
        super().sending_failed(self._clock.enter(now_counts), acknowledged=acknowledged)

    def receiving_failed(self, now_counts: int, *, first: bool = False) -> None:
        """Count an error in another station's frame."""
        super().receiving_failed(self._clock.enter(now_counts), first=first)

    def force_bus_off(self, now_counts: int) -> None:
        """Leave the bus as after too many failed attempts."""
        super().force_bus_off(self._clock.enter(now_counts))

    def recover(self, now_counts: int) -> None:
        """Become error active again after bus-off."""
        super().recover(self._clock.enter(now_counts))


class DriftingBoard(Board):
    """A board with a crystal error. Arguments are in the simulation's time; traces and pin changes in the board's."""

    def __init__(
        self,
        config: BoardConfig,
        kernel: Kernel,
        flash: list[FlashPage] | None = None,
        program: BoardProgram | None = None,
    ) -> None:
        """Create a board without power, like `Board`, with a crystal error of `config.crystal_ppm`."""
        self._clock = LocalClock(config.crystal_ppm)
        super().__init__(config, kernel, flash, program)

    @property
    def own_clock(self) -> LocalClock | None:
        """The board's clock."""
        return self._clock

    def _make_controller(self) -> CanController:
        return DriftingController(self._clock, self)

    def boot(self, now_counts: int) -> None:
        """Switch the board on."""
        super().boot(self._clock.enter(now_counts))

    def power_down(self, now_counts: int) -> None:
        """Switch the supply off until `start`; the clock continues, as if the crystal had power."""
        super().power_down(self._clock.enter(now_counts))

    def reset(self, now_counts: int) -> None:
        """Hold the processor in reset until `start`."""
        super().reset(self._clock.enter(now_counts))

    def start(self, now_counts: int) -> None:
        """Start the firmware of a board that is down."""
        super().start(self._clock.enter(now_counts))

    def operate(self, operation: BoardOperation, now_counts: int) -> None:
        """Operate the machine."""
        super().operate(operation, self._clock.enter(now_counts))

    def advance(self, until_counts: int) -> int:
        """Advance time; return the instant reached.

        With a fast crystal a tick may begin between two instants of the simulation. A board that stops there returns
        the second instant before its counter has reached it. The next call, perhaps at the same instant, completes it.
        """
        clock = self._clock
        until_local_counts = clock.local_counts(until_counts)
        reached_local_counts = super().advance(until_local_counts)
        if reached_local_counts < until_local_counts:
            until_counts = max(clock.instant(reached_local_counts), clock.now_counts)
        clock.go_to(until_counts, reached_local_counts)
        return until_counts

    def poll(self, now_counts: int) -> None:
        """Do the processor's due work."""
        super().poll(self._clock.enter(now_counts))

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the board's next work without external events; None if there is none."""
        due_local_counts = super().next_due_counts
        return None if due_local_counts is None else self._clock.instant(due_local_counts)

    def quiet_until(self, counts: int) -> bool:
        """Return whether nothing can happen up to an instant, because it is within a computed tick."""
        due_counts = self.next_due_counts
        computed = self._clock.local_counts(counts) < self.motion.tick * TICK_COUNTS
        return computed and (due_counts is None or due_counts > counts)

    @property
    def computed_counts(self) -> int:
        """Instant up to which all pulses are computed, at the start of a servo tick."""
        return self._clock.instant(super().computed_counts)

    def next_tick_counts(self, now_counts: int) -> int:
        """Return the first instant after now when the board has begun its next servo tick."""
        tick = self._clock.local_counts(now_counts) // TICK_COUNTS + 1
        return self._clock.instant(tick * TICK_COUNTS)
