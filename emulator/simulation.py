"""Simulate boards and a bus in virtual time: one clock, one thread, events in order; equal inputs give equal bytes.

The host is not part of the simulation: it sends frames, advances time and receives frames. All boards are switched on
together and count the same 72 MHz. Real boards have crystals that differ by some 20 ppm; see `DriftingBoard`.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, Protocol

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import CanController, unheard
from steptwin.emulator.operations import BoardStart, Consequence, Operation, Schedule, Scheduled
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_SILENCE_MAX_S: Final = 1
"""Longest wait until the bus is idle after a frame: some 1000 frames at 125 kbit/s."""


class Participant(Protocol):
    """Part of a feature that takes part in simulated time."""

    @property
    def next_due_counts(self) -> int | None:
        """Instant of its next step without an event; None while it waits only for events."""
        ...

    def step(self, now_counts: int) -> None:
        """Process events up to this instant and act; it may operate machines, but not advance time."""
        ...


class TurningRotors(Participant, Protocol):
    """Simulated rotors of the machine's motors, which may slip.

    Attributes:
        stretch_ticks: largest number of servo ticks per step of the simulation while an axis moves.
        payload_kg: mass of the payload.
    """

    stretch_ticks: int
    payload_kg: float

    def positions_full_steps(self) -> list[float]:
        """Return the position of each rotor since power-up, board by board."""
        ...

    def load(self, payload_kg: float) -> None:
        """Set the mass of the payload."""
        ...

    @property
    def work_counts(self) -> int:
        """Instant from which `work` may be called next."""
        ...

    @property
    def pressing(self) -> bool:
        """True if `work` should be called in each tick, instead of later for all ticks together."""
        ...

    def work(self) -> None:
        """Simulate the rotors for one short piece of time; a call takes some 50 us."""
        ...


_BUSY_FRAMES: Final = 500
"""Least number of frames in _SILENCE_MAX_S on a busy bus: frames have up to 135 bits, the bus at least 125 kbit/s."""


class BusOverloadError(Exception):
    """The bus does not become idle: the boards' frames keep it busy, or a frame cannot be sent."""


class Simulation:
    """Boards and a host on one bus; `now_counts` is the time in 72 MHz counts since the boards were switched on."""

    def __init__(
        self,
        boards: Sequence[Board],
        bus: Bus,
        schedule: Iterable[Scheduled] = (),
        joining: Iterable["Joining"] = (),
    ) -> None:
        """Switch the boards on.

        Args:
            boards: the boards.
            bus: bus that connects them.
            schedule: operations on their machines, with their instants.
            joining: functions that create further participants before the boards boot, in the order of their steps.
        """
        self._schedule = Schedule(schedule)
        self._down_until_counts: dict[int, int] = {}
        """By number of a board that is down, instant before which it does not start."""
        self.boards: tuple[Board, ...] = tuple(boards)
        self._lone_board = None if self.boards[1:] else self.boards[0]
        """The board, if there is only one."""
        self._late_readers = [board for board in self.boards if board.config.read_latency_counts]
        """Boards whose processors read received frames with a delay."""
        self._drifting = any(board.own_clock for board in self.boards)
        """True if the boards' servo ticks are not synchronous."""
        self.bus = bus
        self.now_counts: int = 0
        self.host: CanController = CanController(unheard, in_order=True)
        """CAN interface of the host: it receives every frame at once and sends in order, like SocketCAN's drivers.

        The host sets its callbacks `receive` and `on_sent`."""
        bus.attach(self.host)
        for board in self.boards:
            bus.attach(board.can)
        self.rotor_watch: TurningRotors | None = None
        """The rotors, as the participant that turns them has set it; None: they are where the drivers' steps put them.
        """
        self._rogue_controller: CanController | None = None
        self.rogue_frames: list[tuple[int, Frame]] = []
        """Frames that the rogue node has sent, with the instant when each became valid."""
        self._participants: tuple[Participant, ...] = ()
        """Participants in the order of their steps. The tuple is replaced, never changed."""
        self._step_at_once = False
        """True if the participants must be stepped although no time passes."""
        self.on_operation: Callable[[Scheduled], None] = lambda _: None
        """Called with each executed operation, except those that a participant executes by `apply`."""
        for join in joining:
            if (participant := join(self)) is not None:
                self.join(participant)
        for board in self.boards:
            board.boot(0)

    def join(self, participant: Participant) -> None:
        """Add a participant; it is stepped after all others."""
        self._participants = (*self._participants, participant)

    def leave(self, participant: Participant) -> None:
        """Remove a participant."""
        self._participants = tuple(each for each in self._participants if each is not participant)

    def power_cycle(self, number: int = 0) -> None:
        """Switch a board off and on again; the other boards, the host and the clock continue."""
        self._exchanging(number, lambda board, now_counts: board.power_cycle(now_counts))
        self._step_at_once = True

    def _exchanging(self, number: int, act: Callable[[Board, int], None]) -> None:
        """Call `act` on a board and attach the board's new CAN controller, if it has one, to the bus."""
        board = self.boards[number]
        before = board.can
        act(board, self.now_counts)
        self.bus.exchange(before, board.can, self.now_counts)

    def operate(self, operation: Operation, number: int = 0) -> None:
        """Execute a requested operation on a board or the bus now."""
        self.apply(operation, number)
        self.on_operation(Scheduled(self.now_counts, operation, number))

    def apply(self, operation: Operation, number: int) -> None:
        """Execute an operation that was not requested, such as an input change by a sensor."""
        operation.apply(self, number)
        self.boards[number].poll(self.now_counts)
        if self.rotor_watch is not None:
            self.rotor_watch.step(self.now_counts)

    def start(self, number: int) -> None:
        """Start a board that is down, unless it must stay down longer."""
        if self.boards[number].down and self.now_counts >= self._down_until_counts.get(number, 0):
            self._exchanging(number, lambda board, now_counts: board.start(now_counts))

    def take_down(self, number: int, act: Callable[[Board, int], None], for_ms: int | None) -> None:
        """Take a board down by `act`, or keep it down, for a time; None for no end."""
        self._exchanging(number, act)
        until_counts = self.now_counts + (for_ms or 0) * COUNTS_PER_MS
        self._down_until_counts[number] = max(until_counts, self._down_until_counts.get(number, 0))
        if for_ms is not None:
            self.schedule([Consequence(until_counts, BoardStart(), number)])

    @property
    def rogue_node(self) -> CanController:
        """A station that is no part of the machine; it is on the bus from its first frame on."""
        if self._rogue_controller is None:
            self._rogue_controller = CanController(
                unheard, in_order=True, on_sent=lambda frame, counts: self.rogue_frames.append((counts, frame))
            )
            self.bus.attach(self._rogue_controller)
        return self._rogue_controller

    def schedule(self, scheduled: Iterable[Scheduled]) -> None:
        """Add operations to the schedule."""
        self._schedule.add(scheduled)

    def cancel(self, which: Callable[[Operation], bool]) -> None:
        """Cancel the consequences of earlier operations for which `which` is true."""
        self._schedule.cancel(which)

    @property
    def now_s(self) -> float:
        """Seconds since the boards were switched on."""
        return self.now_counts / COUNTS_PER_SECOND

    def send(self, frame: Frame) -> None:
        """Send a frame as the host and run until the bus is idle: answers have then arrived.

        Raises:
            BusOverloadError: the bus does not become idle, because the boards send more frames than it can carry, or
                because no station acknowledges a frame.
        """
        was_silent = not self.bus.busy
        self.host.send(frame, self.now_counts)
        if was_silent:
            self._skip_intermission()
        give_up_counts, frames = self.now_counts + _SILENCE_MAX_S * COUNTS_PER_SECOND, self.bus.frames
        rogue = len(self.rogue_frames)
        while self.bus.busy or any(board.can.next_due_counts is not None for board in self._late_readers):
            if self.now_counts > give_up_counts:
                raise BusOverloadError(self._why_no_silence(self.bus.frames - frames, len(self.rogue_frames) - rogue))
            self._advance_to(give_up_counts + 1)

    def _why_no_silence(self, frames: int, rogue: int) -> str:
        """Return why the bus is not silent though so many frames, and so many of a rogue node, have become valid."""
        if frames < _BUSY_FRAMES:
            return f"a frame has waited {_SILENCE_MAX_S} s for the bus: it is held back, or no station acknowledges it"
        if 2 * rogue > frames:
            return (
                f"a rogue node's frames 0x{self.rogue_frames[-1][1].cob_id:03X} fill the bus: "
                f"no pause for {_SILENCE_MAX_S} s; they end with the last of them, or with the repair of the bus"
            )
        return (
            f"the nodes' own frames keep the bus busy at {self.bus.bitrate // 1000} kbit/s: "
            f"no pause for {_SILENCE_MAX_S} s; longer heartbeat and event times or a higher bit rate help"
        )

    def _skip_intermission(self) -> None:
        """Advance to the end of the intermission, where the sent frame begins, if no board has an event before."""
        begin_counts = self.bus.next_event_counts
        if begin_counts is None:
            return
        scheduled_counts = self._schedule.next_counts
        undisturbed = not self._step_at_once and (scheduled_counts is None or scheduled_counts > begin_counts)
        if begin_counts > self.now_counts and undisturbed:
            for participant in self._participants:
                due_counts = participant.next_due_counts
                if due_counts is not None and due_counts <= begin_counts:
                    return
            for board in self.boards:
                if not board.quiet_until(begin_counts):
                    return
            self.now_counts = begin_counts
        self.bus.step(self.now_counts)

    def run_until(self, until_counts: int) -> None:
        """Advance time to an instant."""
        while self.now_counts < until_counts:
            self._advance_to(until_counts)

    def next_event_counts(self, until_counts: int) -> int:
        """Return the instant of the next known event, at most `until_counts`."""
        goal, event_counts = until_counts, self.bus.next_event_counts
        if event_counts is not None and event_counts < goal:
            goal = event_counts
        scheduled_counts = self._schedule.next_counts
        if scheduled_counts is not None and scheduled_counts < goal:
            goal = scheduled_counts
        for board in self.boards:
            due_counts = board.next_due_counts
            if due_counts is not None and due_counts < goal:
                goal = due_counts
        for participant in self._participants:
            due_counts = participant.next_due_counts
            if due_counts is not None and due_counts < goal:
                goal = due_counts
        if self._step_at_once:
            goal = self.now_counts
        return goal

    def _advance_to(self, until_counts: int) -> None:
        """Advance to the next event, at most to `until_counts`, and do the work that is due there."""
        goal_counts = self.next_event_counts(until_counts)
        # Needed even if no time passes: a tick that was just computed may have left work.
        goal_counts = goal_counts if goal_counts > self.now_counts else self.now_counts
        lone_board = self._lone_board
        now_counts = self._advance_boards(goal_counts) if lone_board is None else lone_board.advance(goal_counts)
        self.now_counts = now_counts
        self.bus.step(now_counts)
        if self._schedule.next_counts is not None:
            for item in self._schedule.take_due(now_counts):
                if not isinstance(item, Consequence):
                    self.on_operation(item._replace(counts=now_counts))
                item.operation.apply(self, item.board)
        for board in self.boards:
            board.poll(now_counts)
        self._step_at_once = False
        for participant in self._participants:
            participant.step(now_counts)

    def rotors_full_steps(self) -> list[float]:
        """Return the position of each rotor since power-up, board by board."""
        if self.rotor_watch is not None:
            return self.rotor_watch.positions_full_steps()
        return [full_steps for board in self.boards for full_steps in board.positions_full_steps()]

    def _advance_boards(self, goal_counts: int) -> int:
        """Advance all boards; return the instant that all of them have reached.

        A motion may need attention at any tick, which is known only after the tick is computed. So boards that move at
        the same time advance tick by tick. If only one board moves, it advances first, and the boards at standstill
        follow to the instant that it has reached.
        """
        by_motion = sorted(self.boards, key=lambda board: not board.moving)
        if by_motion[1].moving:
            if self._drifting:
                goal_counts = min(goal_counts, *(each.next_tick_counts(self.now_counts) for each in self.boards))
            else:
                goal_counts = min(goal_counts, (self.now_counts // TICK_COUNTS + 1) * TICK_COUNTS)
        reached_counts = goal_counts
        for board in by_motion:
            reached_counts = board.advance(reached_counts)
        return reached_counts


Joining = Callable[[Simulation], Participant | None]
"""Creates a participant of a simulation before its boards have power; returns None if there is none."""
