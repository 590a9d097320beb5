"""Play a scenario on a machine: begin and end its faults at their instants, and note what answers."""

from collections import deque
from dataclasses import dataclass, field, replace
from typing import Final

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.bus.frame_filter import Strike
from steptwin.features.faults.kinds.bus import BusFault
from steptwin.features.faults.kinds.harm import Harm, MachineHarm
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.kinds.machine import BrownOut, WatchdogReset
from steptwin.features.faults.moment import Moment, moment_of
from steptwin.features.faults.reactions import concerned
from steptwin.features.faults.scenario import Fault, Scenario
from steptwin.features.faults.triggers import (
    AtPosition,
    AtRandom,
    AtState,
    AtTime,
    FrameWatch,
    OnFrame,
    PositionWatch,
    StateWatch,
    TimeWatch,
    Trigger,
    Watch,
    counts_of,
    earliest,
)
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import BusError
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol.frame import COB_EMCY, COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


class HostLostError(BusError):
    """The host's program ends here, as a scenario wants it: it does nothing any more."""


@dataclass(slots=True)
class HostCondition:
    """The faults of the host that last.

    Attributes:
        dead: whether it has ended and sends nothing any more.
        restart_counts: instant when another one takes over; None: none does.
    """

    dead: bool = False
    restart_counts: int | None = None
    _lasting: list[tuple[HostFault, bool]] = field(default_factory=list)
    """The others, and whether it is known when each ends."""

    def begin(self, fault: HostFault, now_counts: int, *, ends: bool = False) -> None:
        """Let a fault begin; `ends`: it is known when it ends."""
        if fault.kind in (HostFaultKind.DEATH, HostFaultKind.RESTART):
            self.dead = True
            if fault.kind is HostFaultKind.RESTART:
                self.restart_counts = now_counts + round(fault.by_s * COUNTS_PER_SECOND)
        else:
            self._lasting.append((fault, ends))

    def end(self, fault: HostFault) -> None:
        """Let this very fault end; a dead host stays dead."""
        self._lasting = [each for each in self._lasting if each[0] is not fault]

    def _of(self, kind: HostFaultKind) -> list[tuple[HostFault, bool]]:
        return [each for each in self._lasting if each[0].kind is kind]

    @property
    def hangs(self) -> bool:
        """Whether the program stands still."""
        return bool(self._of(HostFaultKind.HANG))

    @property
    def goes_on(self) -> bool:
        """Whether a program that stands still is known to go on."""
        return all(ends for _, ends in self._of(HostFaultKind.HANG))

    @property
    def late_s(self) -> float:
        """What each of its waits takes longer."""
        return sum(fault.by_s for fault, _ in self._of(HostFaultKind.LATE))

    @property
    def disordered(self) -> bool:
        """Whether it sends points out of order."""
        return bool(self._of(HostFaultKind.DISORDER))


EMERGENCIES_MAX: Final = 10_000
"""Number of EMCYs that are remembered, so that a board may run for ever."""
_CODE_BYTES: Final = 2


@dataclass(frozen=True, slots=True)
class Emergency:
    """An EMCY on the bus: its instant, the number of the axis, its error code; 0 says that all errors are over."""

    counts: int
    axis: int
    code: int


@dataclass(slots=True)
class Played:
    """A fault in the course of a run.

    Attributes:
        fault: the fault, with its instant drawn if it is random.
        harm: what it does; an object of its own, by which its strikes are known.
        watch: watches for its beginning, then for its end; None when neither is to come.
        began: what the machine did when it began; None before.
        strikes: number of times that it struck: once for an operation, each frame for a fault of the bus.
        first_counts: instant of the first strike.
        ended_counts: instant of its end; None if it lasts.
    """

    fault: Fault
    harm: Harm
    watch: Watch | None
    began: Moment | None = None
    strikes: int = 0
    first_counts: int | None = None
    ended_counts: int | None = None

    @property
    def struck(self) -> bool:
        """True once it has done something."""
        return self.strikes > 0


@dataclass(slots=True)
class _Changed:
    """Something that faults have changed.

    Attributes:
        undo: the operation that makes it as it was before the first of them.
        by: the operations that have changed it and last, in order of time.
    """

    undo: MachineHarm
    by: list[MachineHarm] = field(default_factory=list)


class Engine:
    """Plays one scenario; a participant of the simulation.

    After `begin` it looks at what has happened at the end of every event. An operation is executed at the very instant
    when its trigger is due; the firmware sees inputs with its next tick.
    """

    def __init__(self, scenario: Scenario, target: RobotBoards, host: HostCondition) -> None:
        """Watch for the triggers of a scenario from now on.

        Raises:
            InputError: a trigger names a joint that the robot does not have, or a fault a receiver that is not there,
                or a fault needs motors that turn with the boards.
        """
        for fault in scenario.faults:
            with prefixed(f"{fault.name}: "):
                target.check(fault.harm)
        self.scenario: Scenario = scenario.drawn()
        self.target = target
        self.emergencies: deque[Emergency] = deque(maxlen=EMERGENCIES_MAX)
        """The last EMCYs since power-up."""
        self._start: Moment | None = None
        """What the machine was like then."""
        self.start_counts: int | None = None
        """t = 0 of the motion; None before its SYNC."""
        self._host = host
        self._sync_counts: int | None = None
        """Instant of the last SYNC before the motion."""
        self.played: list[Played] = [
            Played(fault, replace(fault.harm), self._watch(fault.trigger)) for fault in self.scenario.faults
        ]
        self._waiting = list(self.played)
        self._lasting: dict[tuple[object, ...], _Changed] = {}
        """What faults have changed that may end, by its place."""
        self._bus_faults = {id(each.harm): each for each in self.played if isinstance(each.harm, BusFault)}
        target.simulation.bus.filters.reseed(scenario.seed)
        target.simulation.bus.filters.on_strike = self._note_strike
        target.simulation.bus.listen(self._hear)
        target.simulation.join(self)
        self.step(target.simulation.now_counts)  # what is due at power-up comes before the first frame

    def _watch(self, trigger: Trigger) -> Watch:
        target = self.target
        match trigger:
            case AtTime():
                watch = TimeWatch(counts_of(trigger.at_s) if trigger.from_power_up else None, trigger.at_s)
                if self.start_counts is not None:
                    watch.motion_starts(self.start_counts)
                return watch
            case AtPosition():
                period_min_counts = min(board.config.period_min_counts for board, _ in target.axes)
                return PositionWatch(trigger, target.robot, target.steps, lambda: target.moving, period_min_counts)
            case OnFrame():
                return FrameWatch(trigger)
            case AtState(joint, state):
                board, axis = target.axes[target.robot.axis_index(joint)]
                return StateWatch(state, lambda: board.firmware.nodes[axis].drive.state)
            case AtRandom():
                raise ValueError(f"{trigger}: is not drawn")

    # --- what happens

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
        """Instant when the next trigger is due or must be looked at; None while all wait for events."""
        return earliest(each.watch for each in self._waiting if each.watch is not None) if self._waiting else None

    def step(self, now_counts: int) -> None:
        """Begin and end the faults that are due; those of one instant in the scenario's order."""
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
        """Note t = 0 of the motion, the first tick after the SYNC."""
        self._sync_counts = None
        self.start_counts = -(-sync_counts // TICK_COUNTS) * TICK_COUNTS
        self._start = moment_of(self.target)
        for each in self._waiting:
            if each.watch is not None:
                each.watch.motion_starts(self.start_counts)

    def _note_strike(self, strike: Strike) -> None:
        each = self._bus_faults.get(id(strike.filter))
        if each is not None:
            each.strikes += 1
            each.first_counts = strike.counts if each.first_counts is None else each.first_counts

    # --- what is done

    def _act(self, each: Played, now_counts: int) -> None:
        if each.began is None:
            reset = isinstance(each.harm, BrownOut | WatchdogReset)
            each.began = moment_of(self.target, concerned(each.harm, self.target.board_numbers) if reset else ())
            self._begin(each, now_counts)
            each.watch = self._end_watch(each.fault, now_counts)
            if isinstance(each.harm, HostFault):
                self._host.begin(each.harm, now_counts, ends=_comes(each.watch))
        else:
            each.ended_counts = now_counts
            self._end(each)
            each.watch = None

    def _end_watch(self, fault: Fault, now_counts: int) -> Watch | None:
        until = fault.until
        if until is None and isinstance(fault.harm, HostFault) and fault.harm.kind is HostFaultKind.HANG:
            until = fault.harm.by_s or None
        if until is None:
            return None
        if isinstance(until, float | int):
            return TimeWatch(now_counts + counts_of(until))
        return self._watch(until)

    def _begin(self, each: Played, now_counts: int) -> None:
        harm = each.harm
        if not isinstance(harm, BusFault):  # one of the bus strikes when a frame comes
            each.strikes, each.first_counts = 1, now_counts
        if isinstance(harm, HostFault):
            return
        if not isinstance(harm, MachineHarm):
            harm.apply(self.target.simulation, 0)
            return
        undo = harm.undo(self.target.environment)
        if isinstance(undo, MachineHarm):
            self._lasting.setdefault(_place_of(harm), _Changed(undo)).by.append(harm)
        self.target.operate(harm)

    def counted_from(self, began: Moment) -> Moment | None:
        """Return the moment from which steps lost by a fault count: its beginning, but not before the motion's.

        Until then the host may give an axis another position. None: there was no motion where steps could be lost.
        """
        if self._start is None:
            return None
        return began if began.counts >= self._start.counts else self._start

    def repair(self) -> None:
        """End every fault that lasts; none begins any more."""
        for each in self.played:
            if each.began is not None and each.ended_counts is None:
                self._end(each)
        self._waiting = []

    def _end(self, each: Played) -> None:
        harm = each.harm
        if isinstance(harm, BusFault):
            self.target.simulation.bus.end_filter(harm, self.target.simulation.now_counts)
        elif isinstance(harm, HostFault):
            self._host.end(harm)
        elif isinstance(harm, MachineHarm):
            self._end_change(harm)

    def _end_change(self, harm: MachineHarm) -> None:
        """Undo an operation, unless a later one has replaced it; one that it has replaced and that lasts comes back."""
        changed = self._lasting.get(_place_of(harm))
        if changed is None or all(each is not harm for each in changed.by):
            return
        was_last = changed.by[-1] is harm
        changed.by = [each for each in changed.by if each is not harm]
        if not changed.by:
            del self._lasting[_place_of(harm)]
        if was_last:
            self.target.operate(changed.by[-1] if changed.by else changed.undo)


def _place_of(operation: MachineHarm) -> tuple[object, ...]:
    """Return what an operation changes: those of one place replace each other, as two voltages of one supply."""
    return (type(operation), *(getattr(operation, name, None) for name in ("axis", "input", "switch", "wire", "frame")))


def _comes(watch: Watch | None) -> bool:
    """Return whether it is known when a trigger is due."""
    return isinstance(watch, TimeWatch) and watch.next_counts is not None
