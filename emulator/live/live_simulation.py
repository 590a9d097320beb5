"""Run the simulation in real time, paced by the wall clock, whose time is an argument of each call.

A frame that arrives at an instant of the wall clock enters the simulated bus at the corresponding count, but never
before the simulated time. So a late process changes nothing on the board, only the time when others see it. Frames
enter at whole microseconds, like all other events on a bus with one of the supported bit rates. So a log in
microseconds is exact.

A `Pacer` converts between instants of the wall clock and counts of the board's 72 MHz clock, which may pause.

The lateness is measured: of each servo tick of a motion until its edges are known, and of each frame of a board until
it is passed on.

A delayed process has not read the frames that arrived meanwhile. The board must not simulate this time without them:
its clock pauses (`pause`), and the frames enter before it continues.

With motors in the loop, the rotors may lag behind the boards until a result is needed. They are simulated in small
pieces in the free time between ticks (`work`).
"""

from collections import deque
from collections.abc import Callable, Hashable
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.motion.step_config import StepConfig
from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

SPEED_MIN: Final = 0.001
SPEED_MAX: Final = 1000.0
_NS_PER_SECOND: Final = 1_000_000_000
_SPEED_PARTS: Final = 1_000_000


class Pacer:
    """Converts wall clock to counts since power-up at `start_ns`; `speed` is simulated time per wall time.

    It computes with integers, so there is no drift.

    Raises:
        ValueError: the speed is not from SPEED_MIN to SPEED_MAX.
    """

    def __init__(self, start_ns: int, speed: float = 1.0) -> None:
        if not SPEED_MIN <= speed <= SPEED_MAX:
            raise ValueError(f"speed {speed:g} is not from {SPEED_MIN:g} to {SPEED_MAX:g}")
        rate = Fraction(speed).limit_denominator(_SPEED_PARTS) * Fraction(COUNTS_PER_SECOND, _NS_PER_SECOND)
        self.start_ns = start_ns
        """Instant when the boards are switched on; may be changed before."""
        self.paused_ns: int = 0
        """Wall time for which the boards' clock has paused since."""
        self.speed = speed
        self._counts, self._per_ns = rate.numerator, rate.denominator

    def pause(self, dt_ns: int) -> None:
        """Pause the boards' clock for a duration of the wall clock: every later count begins later by it.

        An instant before the end of the pause then belongs to an earlier count than before the call.
        """
        self.paused_ns += dt_ns

    def counts_at(self, now_ns: int) -> int:
        """Convert an instant to the last count that has begun."""
        return (now_ns - self.start_ns - self.paused_ns) * self._counts // self._per_ns

    def ns_at(self, counts: int) -> int:
        """Convert a count to its first nanosecond."""
        return self.start_ns + self.paused_ns - (-counts * self._per_ns // self._counts)


_SUBDIVISION_BITS: Final = 4
"""Histogram resolution: 16 classes per octave, so a figure is at most 1/16 too high."""
_CLASSES: Final = 1 << _SUBDIVISION_BITS
STALL_NS: Final = 10_000_000
"""Longest lateness of the loop that the board catches up; beyond it, the boards' clock pauses.

It is well below the time-outs of CANopen programs, some tens of milliseconds, and well above the usual lateness of a
process with enough processor time.
"""


class Lateness:
    """Histogram of lateness in nanoseconds; an early event counts as 0."""

    def __init__(self) -> None:
        self.count: int = 0
        self.max_ns: int = 0
        self._counts: dict[int, int] = {}

    def add(self, late_ns: int) -> None:
        """Add the lateness of one event."""
        late_ns = max(late_ns, 0)
        self.count += 1
        self.max_ns = max(self.max_ns, late_ns)
        number = _class_of(late_ns)
        self._counts[number] = self._counts.get(number, 0) + 1

    def percentile_ns(self, percent: float) -> int:
        """Return a percentile of the lateness, as the upper end of its class; 0 without events."""
        seen = 0
        for number in sorted(self._counts):
            seen += self._counts[number]
            if 100 * seen >= percent * self.count:
                return min(_upper_end_ns(number), self.max_ns)
        return self.max_ns


def _class_of(late_ns: int) -> int:
    """Return the class of a lateness: below 32 ns one per nanosecond, above one per value of the first five bits."""
    shift = max(late_ns.bit_length() - _SUBDIVISION_BITS - 1, 0)
    return shift * _CLASSES + (late_ns >> shift)


def _upper_end_ns(number: int) -> int:
    shift = max(number // _CLASSES - 1, 0)
    return (number - shift * _CLASSES + 1 << shift) - 1


class Stalls:
    """Number, sum and maximum of the pauses of the boards' clock."""

    def __init__(self) -> None:
        self.count: int = 0
        self.total_ns: int = 0
        self.longest_ns: int = 0

    def add(self, dt_ns: int) -> None:
        """Add a pause."""
        self.count += 1
        self.total_ns += dt_ns
        self.longest_ns = max(self.longest_ns, dt_ns)


SLICE_COUNTS: Final = COUNTS_PER_SECOND // 100
"""Longest time that is simulated at once while catching up, so sockets are served in between."""
PIECE_NS: Final = 100_000
"""Usual upper bound of the time for one piece of rotor work: it takes 60 us on a slow computer."""
WORK_NS: Final = 100_000
"""Time of rotor work after which the sockets are checked."""
_FAR_COUNTS: Final = 1 << 62

Sender = Hashable
"""Identifies one of the senders that share the host's interface."""
Viewer = Callable[[Frame, int, Sender | None], None]
"""Called with a frame, the instant in counts when it became valid, and its sender (None for a board)."""


class _Incoming(NamedTuple):
    now_ns: int
    enter: Callable[[], None]


class LiveSimulation:
    """A simulation in real time. Several senders share the host's interface, like sockets share `can0`."""

    def __init__(self, simulation: Simulation, pacer: Pacer) -> None:
        self.simulation = simulation
        self.pacer = pacer
        self.epoch_us: int = 0
        """Time of day when the boards were switched on, in us since 1970."""
        self.view: Viewer = lambda _frame, _counts, _sender: None
        """Called with every frame on the bus."""
        self.ticks: Lateness = Lateness()
        """Lateness of the servo ticks in motion and shortly after, when events are possible."""
        self.frames: Lateness = Lateness()
        """Lateness of the boards' frames."""
        self.stalls: Stalls = Stalls()
        """Pauses of the boards' clock."""
        self._incoming: deque[_Incoming] = deque()
        self._senders: dict[Frame, deque[Sender]] = {}
        """Senders of the waiting frames; equal frames are sent in the order of their arrival."""
        self._due_counts: list[int] = []
        """Instants of the boards' frames since `settle`."""
        self._ticks = range(0)
        """Servo ticks simulated since `settle`."""
        simulation.host.receive = self._heard
        simulation.host.on_sent = self._sent

    def send(self, frame: Frame, sender: Sender, now_ns: int) -> None:
        """Queue a frame that has arrived at an instant; instants may not decrease from call to call."""
        self.call(partial(self._enter, frame, sender), now_ns)

    def call(self, action: Callable[[], None], now_ns: int) -> None:
        """Schedule an action, such as an operation on a machine, at an instant of the wall clock.

        It is called when the boards have reached this instant, in order with the frames of `send`.
        """
        self._incoming.append(_Incoming(now_ns, action))

    def _enter(self, frame: Frame, sender: Sender) -> None:
        self._senders.setdefault(frame, deque()).append(sender)
        self.simulation.host.send(frame, self.simulation.now_counts)

    def _heard(self, frame: Frame, counts: int) -> None:
        self._due_counts.append(counts)
        self.view(frame, counts, None)

    def _sent(self, frame: Frame, counts: int) -> None:
        senders = self._senders[frame]
        sender = senders.popleft()
        if not senders:
            del self._senders[frame]
        self.view(frame, counts, sender)

    # --- time

    def start(self, now_ns: int, epoch_us: int) -> None:
        """Switch the boards on now (`epoch_us` since 1970), before the first `advance`."""
        self.pacer.start_ns = now_ns
        self.epoch_us = epoch_us

    def pause(self, late_ns: int) -> bool:
        """Pause the boards' clock for the time that the process has just been delayed, minus STALL_NS.

        Afterwards, pass all frames that have arrived meanwhile before `advance`, so none of them is late by more than
        STALL_NS on the boards' clock. Because up to STALL_NS is caught up each time, a board on an overloaded computer
        runs several times as fast as its share of the processor.

        Args:
            late_ns: time since the instant for which the process had planned to read frames and `advance`.

        Returns:
            True if the clock has paused.
        """
        if late_ns <= STALL_NS:
            return False
        self.pacer.pause(late_ns - STALL_NS)
        self.stalls.add(late_ns - STALL_NS)
        return True

    def advance(self, now_ns: int) -> None:
        """Simulate up to an instant; at most one slice while the boards are busy."""
        simulation = self.simulation
        from_counts = simulation.now_counts
        moving = self.moving
        until_counts = self._until_counts(now_ns, moving=moving)
        incoming, counts_at = self._incoming, self._counts_at
        while incoming and (counts := counts_at(incoming[0].now_ns)) <= until_counts:
            enter = incoming.popleft().enter
            simulation.run_until(counts)
            enter()
        simulation.run_until(until_counts)
        if moving:
            self._ticks = range(-(-from_counts // TICK_COUNTS), -(-simulation.now_counts // TICK_COUNTS))

    def _until_counts(self, now_ns: int, *, moving: bool) -> int:
        """Return the count up to which to simulate: in motion at most one slice, at standstill the next event."""
        goal_counts = self._counts_at(now_ns)
        slice_end_counts = self.simulation.now_counts + SLICE_COUNTS
        if moving or goal_counts <= slice_end_counts:
            return min(goal_counts, slice_end_counts)
        return max(slice_end_counts, self.simulation.next_event_counts(goal_counts))

    def _counts_at(self, now_ns: int) -> int:
        """Convert an instant to the count of the last whole microsecond that has begun."""
        counts = self.pacer.counts_at(now_ns)
        return counts - counts % COUNTS_PER_US

    def settle(self, now_ns: int) -> None:
        """Record the lateness of everything simulated since the last call; by now it has been passed on."""
        for tick in self._ticks:
            self.ticks.add(now_ns - self.pacer.ns_at(tick * TICK_COUNTS))
        for counts in self._due_counts:
            self.frames.add(now_ns - self.pacer.ns_at(counts))
        self._ticks = range(0)
        self._due_counts.clear()

    def work(self, clock_ns: Callable[[], int]) -> None:
        """Simulate the motors' rotors in idle time.

        A piece of work begins if there is time for it until the next tick. If the rotors lag too far behind
        (`pressing`), one piece is done in any case: to catch up everything later would take longer than a tick.
        """
        watch = self.simulation.rotor_watch
        if watch is None or watch.work_counts > self.simulation.now_counts:
            return
        now_ns = clock_ns()
        end_ns = min(self.due_ns - PIECE_NS, now_ns + WORK_NS)
        if now_ns <= end_ns or watch.pressing:
            watch.work()
        while watch.work_counts <= self.simulation.now_counts and clock_ns() <= end_ns:
            watch.work()

    def wake_ns(self, now_ns: int) -> int:
        """Return the next known instant when `advance` or `work` has work."""
        due_ns, watch = self.due_ns, self.simulation.rotor_watch
        if watch is None:
            return due_ns
        work_ns = max(self.pacer.ns_at(watch.work_counts), now_ns)
        return work_ns if work_ns <= due_ns - PIECE_NS else due_ns

    @property
    def moving(self) -> bool:
        """True in motion and shortly after, when any tick may have an event."""
        return any(board.moving for board in self.simulation.boards)

    @property
    def due_ns(self) -> int:
        """Next known instant when `advance` has work."""
        now_counts = self.simulation.now_counts
        due_counts = _FAR_COUNTS
        if self.moving:  # a tick is simulated at its start
            due_counts = -(-now_counts // TICK_COUNTS) * TICK_COUNTS + COUNTS_PER_US
        if self._incoming:
            due_counts = min(due_counts, self._counts_at(self._incoming[0].now_ns))
        return self.pacer.ns_at(max(self.simulation.next_event_counts(due_counts), now_counts))


def warm_up(kernel: Kernel) -> None:
    """Call the kernel's functions once, because the first call loads or compiles them, which is slow."""
    motion = BoardMotion(kernel, 1)
    (axis,) = motion.axes
    axis.configure(StepConfig(1, 1_000, 1_000, 0, 0, velocity_max_units_per_s=1 << 20))
    axis.push(0, 0, 1)
    axis.start()
    motion.advance(1)
    axis.stop(1)
