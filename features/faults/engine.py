"""Play a scenario on a machine: begin and end its faults at their instants, and record the reactions."""

from collections import deque
from dataclasses import dataclass, field, replace
from typing import Final

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.bus.frame_filter import Strike
from steptwin.features.faults.fault import Fault, MachineFault
from steptwin.features.faults.kinds.host import HostCondition
from steptwin.features.faults.moment import Moment, moment_of
from steptwin.features.faults.scenario import Scenario, TriggeredFault
from steptwin.features.faults.triggers import AtTime, TimeWatch, Trigger, Watch, counts_of, earliest
from steptwin.host.common.bad_input import prefixed
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol.frame import COB_EMCY, COB_SYNC, FIRST_NODE_ID, Frame

EMERGENCIES_MAX: Final = 10_000
"""Number of EMCYs that are kept; bounds the memory of a board that runs forever."""
_CODE_BYTES: Final = 2


@dataclass(frozen=True, slots=True)
class Emergency:
    """An EMCY on the bus: instant, number of the axis, error code; 0 means that all errors have ended."""

    counts: int
    axis: int
    code: int


@dataclass(slots=True)
class Played:
    """State of a fault in a run.

    Attributes:
        triggered: fault with its trigger; a random instant has been drawn.
        fault: fault itself, an object of its own that identifies its strikes.
        watch: watches for its beginning, then for its end; None if neither is pending.
        began: state of the machine at its beginning; None before.
        strikes: number of strikes: one for an operation, one for each frame for a bus fault.
        first_counts: instant of the first strike.
        ended_counts: instant of its end; None if it lasts.
    """

    triggered: TriggeredFault
    fault: Fault
    watch: Watch | None
    began: Moment | None = None
    strikes: int = 0
    first_counts: int | None = None
    ended_counts: int | None = None

    @property
    def struck(self) -> bool:
        """True once it has struck."""
        return self.strikes > 0


@dataclass(slots=True)
class _Changed:
    """A change of the machine by faults.

    Attributes:
        undo: operation that restores the state before the first of them.
        by: lasting operations that have changed it, in order of time.
    """

    undo: MachineFault
    by: list[MachineFault] = field(default_factory=list)


class Engine:
    """Plays one scenario; a participant of the simulation.

    After `begin` it examines all events at their end. An operation is executed at the exact instant of its trigger; the
    firmware sees inputs with its next tick.
    """

    def __init__(self, scenario: Scenario, target: RobotBoards, host: HostCondition) -> None:
        """Start watching for the triggers of a scenario.

        Raises:
            InputError: the robot lacks a trigger's joint or a fault's receiver, or a fault needs motors that turn with
                the boards.
        """
        for fault in scenario.faults:
            with prefixed(f"{fault.name}: "):
                target.check(fault.fault)
        self.scenario: Scenario = scenario.drawn()
        self.target = target
        self.emergencies: deque[Emergency] = deque(maxlen=EMERGENCIES_MAX)
        """Last EMCYs since power-up."""
        self._start: Moment | None = None
        """State of the machine at the motion's start."""
        own = all(board.runs_own for board in target.simulation.boards)
        self.start_counts: int | None = None if own else 0
        """Instant of the motion's t = 0; None before its SYNC. With another firmware it is power-up."""
        self.host = host
        """Condition of the host by faults."""
        self._sync_counts: int | None = None
        """Instant of the last SYNC before the motion."""
        self.played: list[Played] = [
            Played(each, replace(each.fault), each.trigger.watch(self)) for each in self.scenario.faults
        ]
        self._waiting = list(self.played)
        self._lasting: dict[tuple[object, ...], _Changed] = {}
        """Lasting changes by faults that may end, by `MachineFault.changes`."""
        self._by_fault = {id(each.fault): each for each in self.played}
        target.simulation.bus.filters.reseed(scenario.seed)
        target.simulation.bus.filters.on_strike = self._note_strike
        target.simulation.bus.listen(self._hear)
        target.simulation.join(self)
        self.step(target.simulation.now_counts)  # faults due at power-up come before the first frame

    # --- events

    def _hear(self, frame: Frame, now_counts: int) -> None:
        cob_id = frame.cob_id
        axis = cob_id - COB_EMCY - FIRST_NODE_ID
        if cob_id == COB_SYNC and self.start_counts is None:
            self._sync_counts = now_counts
        elif 0 <= axis < len(self.target.axes) and len(frame.data) >= _CODE_BYTES:
            self.emergencies.append(Emergency(now_counts, axis, int.from_bytes(frame.data[:_CODE_BYTES], "little")))
        for each in self._waiting:
            if each.watch is not None:
                each.watch.hear(cob_id)

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the next trigger or look; None while all wait for events."""
        return earliest(each.watch for each in self._waiting if each.watch is not None) if self._waiting else None

    def step(self, now_counts: int) -> None:
        """Begin and end due faults; those of one instant in the scenario's order."""
        if self._sync_counts is not None and self.target.interpolating:
            self._note_start(self._sync_counts)
        if self._waiting:
            for each in self._waiting:
                if each.watch is not None and each.watch.is_due(now_counts):
                    self._act(each, now_counts)
            self._waiting = [each for each in self._waiting if each.watch is not None]
        if not self._waiting and self.start_counts is not None:
            self.target.simulation.leave(self)  # nothing is left to do: each event would cost another look

    def _note_start(self, sync_counts: int) -> None:
        """Register the motion's t = 0, the first tick after the SYNC."""
        self._sync_counts = None
        self.start_counts = -(-sync_counts // TICK_COUNTS) * TICK_COUNTS
        self._start = moment_of(self.target)
        for each in self._waiting:
            if each.watch is not None:
                each.watch.motion_starts(self.start_counts)

    def _note_strike(self, strike: Strike) -> None:
        each = self._by_fault.get(id(strike.filter))
        if each is not None:
            each.strikes += 1
            each.first_counts = strike.counts if each.first_counts is None else each.first_counts

    # --- faults

    def _act(self, each: Played, now_counts: int) -> None:
        if each.began is None:
            taken_down = each.fault.concerned(self.target.board_numbers) if each.fault.takes_down else ()
            each.began = moment_of(self.target, taken_down)
            if each.fault.strikes:
                each.strikes, each.first_counts = 1, now_counts
            until = each.triggered.until if each.triggered.until is not None else each.fault.lasts_s
            each.fault.begin(self, ends=self._is_known(until))
            each.watch = self._end_watch(until, now_counts)
        else:
            each.ended_counts = now_counts
            each.fault.end(self)
            each.watch = None

    def _is_known(self, until: Trigger | float | None) -> bool:
        """Return whether the end of a fault that begins now is known."""
        if isinstance(until, AtTime):
            return until.from_power_up or self.start_counts is not None
        return isinstance(until, float | int)

    def _end_watch(self, until: Trigger | float | None, now_counts: int) -> Watch | None:
        if isinstance(until, float | int):
            return TimeWatch(now_counts + counts_of(until))
        return None if until is None else until.watch(self)

    def change(self, fault: MachineFault) -> None:
        """Operate the machine by a fault; `restore` can undo it."""
        undo = fault.undo(self.target.environment)
        if isinstance(undo, MachineFault):
            self._lasting.setdefault(fault.changes, _Changed(undo)).by.append(fault)
        self.target.operate(fault)

    def restore(self, fault: MachineFault) -> None:
        """Undo an operation, unless a later one has replaced it; a lasting one that it had replaced returns."""
        changed = self._lasting.get(fault.changes)
        if changed is None or all(each is not fault for each in changed.by):
            return
        was_last = changed.by[-1] is fault
        changed.by = [each for each in changed.by if each is not fault]
        if not changed.by:
            del self._lasting[fault.changes]
        if was_last:
            self.target.operate(changed.by[-1] if changed.by else changed.undo)

    def counted_from(self, began: Moment) -> Moment | None:
        """Return the moment from which steps lost by a fault count: its beginning, but not before the motion's.

        Before the motion, the host may give an axis another position. None: no steps can be lost without a motion.
        """
        if self._start is None:
            return None
        return began if began.counts >= self._start.counts else self._start

    def repair(self) -> None:
        """End all lasting faults; no more begin."""
        for each in self.played:
            if each.began is not None and each.ended_counts is None:
                each.fault.end(self)
        self._waiting = []
