"""Virtual time: one clock, one thread, events in order. The same inputs give the same bytes.

The host stands outside: it sends frames, lets time pass and is handed the frames that reach it.
"""

from collections.abc import Callable, Iterable

from controller.motion import COUNTS_PER_SECOND
from emulator.board import Board
from emulator.bus import Bus
from emulator.operations import Operation, Schedule, Scheduled
from protocol.frame import Frame

_HOST_PORT, _BOARD_PORT = 0, 1
_SILENCE_MAX_S = 1
"""How long a frame and its answers may take until the bus is silent: some 1000 frames at 125 kbit/s."""

Listener = Callable[[Frame, int], None]


class BusOverloadError(Exception):
    """The board alone keeps the bus busy for ever."""


class Simulation:
    """A board and a host on one bus. `now_counts` is 72 MHz counts since the board was switched on."""

    def __init__(self, board: Board, bus: Bus, schedule: Iterable[Scheduled] = ()) -> None:
        """Switch the board on; `schedule` says what will happen to its machine, and when."""
        self._schedule = Schedule(schedule)
        self.board = board
        self.bus = bus
        self.now_counts = 0
        self.on_frame: Listener = lambda _frame, _counts: None
        """Called with every frame that reaches the host and when it did."""
        board.boot(0)
        self._submit_board_frames()

    def power_cycle(self) -> None:
        """Switch the board off and on again; the host and its clock go on."""
        self.board.power_cycle(self.now_counts)
        self._submit_board_frames()

    def operate(self, operation: Operation) -> None:
        """Do something to the machine, now."""
        self.board.operate(operation, self.now_counts)
        self._submit_board_frames()

    @property
    def now_s(self) -> float:
        """Seconds since the board was switched on."""
        return self.now_counts / COUNTS_PER_SECOND

    def send(self, frame: Frame) -> None:
        """Send a frame as the host and run on until the bus is silent again: answers have then arrived.

        Raises:
            BusOverloadError: the bus does not fall silent, because the board has more to say than fits on it.
        """
        self.bus.submit(_HOST_PORT, frame, self.now_counts)
        give_up_counts = self.now_counts + _SILENCE_MAX_S * COUNTS_PER_SECOND
        while self.bus.next_event_counts is not None:
            if self.now_counts > give_up_counts:
                raise BusOverloadError(
                    f"the nodes' own frames keep the bus busy at {self.bus.bitrate // 1000} kbit/s: "
                    f"no pause for {_SILENCE_MAX_S} s; longer heartbeat and event times or a higher bit rate help"
                )
            self._advance_to(self.bus.next_event_counts)

    def run_until(self, until_counts: int) -> None:
        """Let time pass to an instant."""
        while self.now_counts < until_counts:
            self._advance_to(until_counts)

    def _advance_to(self, until_counts: int) -> None:
        """Go to the next event, but not beyond an instant, and do what is due there."""
        goal = until_counts
        for event in (self.bus.next_event_counts, self.board.next_due_counts, self._schedule.next_counts):
            if event is not None:
                goal = min(goal, event)
        goal = max(goal, self.now_counts)
        self.now_counts = self.board.advance(goal)
        if self.now_counts == goal:
            arrived = self.bus.step(goal)
            if arrived:
                self._deliver(*arrived)
        for operation in self._schedule.take_due(self.now_counts):
            self.board.operate(operation, self.now_counts)
        self.board.poll(self.now_counts)
        self._submit_board_frames()

    def _deliver(self, port: int, frame: Frame) -> None:
        if port == _HOST_PORT:
            self.board.receive(frame, self.now_counts)
        else:
            self.on_frame(frame, self.now_counts)

    def _submit_board_frames(self) -> None:
        for frame in self.board.take_frames():
            self.bus.submit(_BOARD_PORT, frame, self.now_counts)
