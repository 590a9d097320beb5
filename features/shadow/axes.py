"""Compare what the drive of an axis tells again and again: its state, where it is, and when it has found home.

Both sides tell it by their first PDO, or by any other that has these objects: the twin's mapping reads them. Where an
axis is, the twin is asked itself: its counter at the instant of the board's PDO.
"""

from collections.abc import Iterator
from math import copysign
from typing import Final, NamedTuple

from steptwin.features.shadow.discrepancy import SETTLED_COUNTS, DiscrepancyKind
from steptwin.protocol.cia402 import Mode, State, Status
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

JITTER_COUNTS: Final = 2 * COUNTS_PER_MS
"""Uncertainty of a time stamp, and of the instant when a waiting PDO took its value."""
TICK_COUNTS: Final = COUNTS_PER_SECOND // 4000
"""A command acts at a servo tick, which may be the next one on one side only."""
SEGMENT_S: Final = 0.016
"""Time by which a change of a profile on the way may act later on one side: it waits for the segment in execution."""
FOLLOW_S: Final = 0.01
"""Longest time between two looks at a moving axis of the twin."""
DRIFT: Final = 100e-6
"""Most by which the board's crystal and the computer's clock may differ, in parts of the time."""
STEPS: Final = 2.0
"""Difference of positions that is none, while an axis moves."""
REST_STEPS: Final = 1.0
"""Difference of positions that is none, where an axis has come to rest at its target."""
RESTS_COUNTS: Final = 150 * COUNTS_PER_MS
"""Time without motion after which an axis is at rest: its PDO comes every 100 ms."""
STILL_COUNTS: Final = 500 * COUNTS_PER_MS
"""Time without motion in which an axis has told twice where it rests, also if its twin is late."""
LOST_UNITS: Final = 2 * 16384
"""Difference of the switch's place that is none: two full steps, in wire units. A rotor that slips loses four."""
_UNSEEN_S: Final = 0.1
"""Longest time in which a board's place on its way to a switch is not told: it sends a PDO each 100 ms."""
ASTRAY_S: Final = 0.2
"""Longest time that is not known where the stamps' clock has stepped: frames of a moving machine are not so rare."""
_SAME_SPEED: Final = 0.3
"""Part by which a speed may differ that two PDOs tell."""
_TWICE: Final = 2
"""PDOs one after the other that must be too far off: one may have waited for the bus."""


_BY_PROFILE = (Mode.PROFILE_POSITION, Mode.PROFILE_VELOCITY)
_WITHOUT_TARGET = (Mode.PROFILE_VELOCITY, Mode.HOMING)
"""Modes in which jitter decides where an axis comes to rest."""


class DriveReport(NamedTuple):
    """What a PDO of the drive tells, as far as it is mapped.

    Attributes:
        statusword: 0x6041, or None.
        mode: 0x6061, or None.
        position_units: 0x6064 in wire units, or None.
    """

    statusword: int | None
    mode: int | None
    position_units: int | None


class TwinAxis(NamedTuple):
    """Where an axis of the twin is now.

    Attributes:
        position_units: 0x6064.
        velocity_units_per_s: 0x606C.
        leaving_units_per_s: speed at which a homing leaves the switch, 0x6099:02.
        ramp_units_per_s2: the steeper of a profile's two ramps, 0x6083 and 0x6084.
        relative: True if the last target counts from a place on the way, bit 6 of 0x6040.
    """

    position_units: int
    velocity_units_per_s: int
    leaving_units_per_s: int
    ramp_units_per_s2: int
    relative: bool = False


class _Leg(NamedTuple):
    """A place on the last way to a switch: instant in counts, position in wire units by the coordinates before."""

    counts: int
    units: int


class DriveSide:
    """One side's drive, as its PDOs tell it; instants are in counts of that side's own clock."""

    def __init__(self) -> None:
        self.state: str | None = None
        self.since_counts: int = 0
        self.mode: int | None = None
        self.statusword: int = 0
        self.began_counts: int | None = None
        """Start of the last homing; None before the first one."""
        self.attained_counts: int | None = None
        """End of the last homing; None while it goes on, and before the first one."""
        self.was_known: bool = False
        """True if the position was known when the last homing began."""

    def take(self, counts: int, told: DriveReport) -> None:
        """Take what a PDO tells."""
        self.mode = told.mode if told.mode is not None else self.mode
        if told.statusword is None:
            return
        before, self.statusword = self.statusword, told.statusword
        self._home(counts, told.statusword, was_known=bool(before & Status.POSITION_KNOWN))
        try:
            name = State.of(told.statusword).name
        except ValueError:
            return
        if name != self.state:
            self.state, self.since_counts = name, counts

    def _home(self, counts: int, statusword: int, *, was_known: bool) -> None:
        """Note begin and end of a homing: in progress both bits are 0 (CiA 402-2, homing mode)."""
        if self.mode != Mode.HOMING:
            return
        if not statusword & (Status.HOMING_ATTAINED | Status.TARGET_REACHED | Status.HOMING_ERROR):
            if self.began_counts is None or self.attained_counts is not None:
                self.began_counts, self.attained_counts = counts, None
                self.was_known = was_known
        elif statusword & Status.HOMING_ATTAINED and self.began_counts is not None and self.attained_counts is None:
            self.attained_counts = counts

    @property
    def rests(self) -> bool:
        """True if the drive says that a profile of its own has come to rest."""
        if self.mode == Mode.PROFILE_VELOCITY:
            return bool(self.statusword & Status.ZERO_SPEED)
        return self.mode == Mode.PROFILE_POSITION and bool(self.statusword & Status.TARGET_REACHED)

    @property
    def homing(self) -> bool:
        """True while a homing goes on."""
        return self.began_counts is not None and self.attained_counts is None and self.mode == Mode.HOMING

    @property
    def homing_counts(self) -> int:
        """How long the last homing took; only once it has ended."""
        assert self.began_counts is not None
        assert self.attained_counts is not None
        return self.attained_counts - self.began_counts


class _Finding(NamedTuple):
    kind: DiscrepancyKind
    board: str
    twin: str
    error_steps: float | None = None


class ComparedAxis:
    """An axis on both sides."""

    def __init__(self, units_per_step: float) -> None:
        """Begin; nothing is known of the board's position before both have been at the same one."""
        self.board: DriveSide = DriveSide()
        self.twin: DriveSide = DriveSide()
        self._units_per_step = units_per_step
        self._told_states: tuple[str | None, str | None] | None = None
        self._anchored = False
        self._accepted_units = 0
        """Difference that jitter has left where a motion without a target ended."""
        self._left_units = 0.0
        """Most that jitter may have left where homings and motions without a target ended since the axis has rested."""
        self._off_times = 0
        self._position_told = False
        self._moved_counts = 0
        """Instant when the twin last moved."""
        self._judged_at_rest = True
        """True once both sides' places have been compared since then."""
        self._rested_counts = 0
        """Instant when the twin began to move."""
        self._peak_units_per_s = 0
        self._last_units_per_s = 0
        self._varied_units_per_s = 0
        """Sum of all changes of the twin's velocity since it began to move."""
        self._commanded = False
        """True if a host has changed the profile since then."""
        self._ramp_units_per_s2 = 0
        """The steepest ramp of a profile since then."""
        self._astray_s = 0.0
        """Time by which the twin may be early or late since a step of the clock, until the machine has rested."""
        self._relative = False
        """True if a target since then counts from a place on the way, where the sides may be apart."""
        self._motion_mode: int | None = None
        """Mode of the twin's motion, now or last; None after a homing that has ended on both sides."""
        self._last_units: int | None = None
        self._judged_homing: int | None = None
        self._board_leg = self._board_leg_before = self._twin_leg = _Leg(0, 0)
        self._leg_units_per_s = 0.0
        """Speed of the twin at the end of its search."""
        self._left: int | None = None
        """Beginning of the board's homing for which the twin is not waited."""

    # --- states

    def states(self, now_counts: int) -> Iterator[_Finding]:
        """Yield the states, if they have differed for long enough and were not told."""
        board, twin = self.board, self.twin
        states = (board.state, twin.state)
        if board.state == twin.state:
            self._told_states = None
            return
        settled = now_counts - max(board.since_counts, twin.since_counts) >= SETTLED_COUNTS
        if settled and None not in states and states != self._told_states:
            self._told_states = states
            yield _Finding(DiscrepancyKind.STATE, _words(board.state), _words(twin.state))

    # --- positions

    def follow(self, now_counts: int, now: TwinAxis) -> None:
        """Note whether the twin moves, and where while it searches a switch."""
        before_units_per_s, self._last_units_per_s = self._last_units_per_s, now.velocity_units_per_s
        if now.velocity_units_per_s:
            pause_counts = RESTS_COUNTS if self.board.mode == Mode.HOMING else 0  # a search has several strokes
            if not before_units_per_s and now_counts - self._moved_counts > pause_counts:
                if self._motion_mode in _WITHOUT_TARGET and not self._judged_at_rest:
                    self._left_units += self._ending_units
                self._rested_counts = now_counts
                self._peak_units_per_s = self._varied_units_per_s = self._ramp_units_per_s2 = 0
                self._commanded = self._relative = False
            self._judged_at_rest = False
            self._motion_mode = self.board.mode
            self._relative |= now.relative
            self._ramp_units_per_s2 = max(self._ramp_units_per_s2, now.ramp_units_per_s2)
            self._moved_counts = now_counts
            self._peak_units_per_s = max(self._peak_units_per_s, abs(now.velocity_units_per_s))
            if self.twin.homing:
                self._twin_leg = _Leg(now_counts, now.position_units)
                self._leg_units_per_s = copysign(now.leaving_units_per_s, now.velocity_units_per_s)
        self._varied_units_per_s += abs(now.velocity_units_per_s - before_units_per_s)

    def command(self, velocity_units_per_s: int) -> None:
        """Note that a host gives the drive something while the twin moves at a velocity."""
        self._commanded |= velocity_units_per_s != 0 and self.board.mode in _BY_PROFILE

    def lose_time(self) -> None:
        """Note that the stamps' clock has stepped on the way: the sides may be apart by the time that it hid."""
        self._astray_s = ASTRAY_S

    def find_time(self) -> None:
        """Note that the machine has rested: both sides begin the next motion at the same time again."""
        self._astray_s = 0.0

    def still(self, now_counts: int) -> bool:
        """Return whether the twin has not moved for so long that the place where the board rests was told."""
        return now_counts - self._moved_counts >= STILL_COUNTS

    @property
    def _astray_units(self) -> float:
        """How far the sides may be apart because the time of a step is not known exactly."""
        return self._peak_units_per_s * self._astray_s

    @property
    def _segment_units(self) -> float:
        """How far the sides may be apart because a change of the profile waited for the next segment on one side.

        A ramp that goes on for so long there makes that side faster, by more than the twin's own changes of speed.
        These are more than was seen: between two looks the speed has gone up and down again by the ramp's.
        """
        if not self._commanded:
            return 0.0
        return (self._varied_units_per_s + self._ramp_units_per_s2 * (SEGMENT_S + 2 * FOLLOW_S)) * SEGMENT_S

    @property
    def _ending_units(self) -> float:
        """How far the sides may be apart where a motion without a target has ended."""
        return self._jitter_units(self._peak_units_per_s) + self._segment_units + self._astray_units

    def positions(self, now_counts: int, units: int, now: TwinAxis) -> Iterator[_Finding]:
        """Yield the difference of the board's position at this instant, if it is one and was not told."""
        self.follow(now_counts, now)
        repeated, self._last_units = units == self._last_units, units
        if self.board.homing:
            self._board_leg_before, self._board_leg = self._board_leg, _Leg(now_counts, units)
        if self.board.homing or self.twin.homing:
            self._off_times = 0
            return
        error_units = units - now.position_units
        rests = repeated and now_counts - self._moved_counts >= RESTS_COUNTS
        if not self._anchored:
            self._anchored = rests and abs(error_units) <= REST_STEPS * self._units_per_step
            return
        own_units = self._own_units(error_units, rests=rests)
        by_jitter_units = self._left_units + (self._astray_units if self._at_target else self._ending_units)
        if self._at_target and self._motion_mode == Mode.PROFILE_POSITION and not self._relative:
            by_jitter_units = 0.0  # the target is a place, wherever the way to it has begun
        if rests and abs(own_units) <= by_jitter_units:
            self._accepted_units, own_units = error_units, 0
        # What its highest speed has left is still there when a motion that a host ends on the way slows down.
        units_per_s = self._peak_units_per_s if self._commanded else now.velocity_units_per_s
        bound_units = self._bound_units(now_counts, units_per_s, rests=rests)
        bound_units += 0 if rests else self._left_units + self._segment_units
        if self._astray_s and not rests:
            self._off_times = 0
            return
        if rests:
            self._left_units, self._judged_at_rest = 0.0, True
        if abs(own_units) <= bound_units:
            self._off_times, self._position_told = 0, False
            return
        self._off_times += 1
        if self._off_times >= _TWICE and not self._position_told:
            self._position_told = True
            error_steps = own_units / self._units_per_step
            bound = f"at most {bound_units / self._units_per_step:.1f} are jitter"
            board = f"{abs(error_steps):.1f} steps {'ahead' if error_steps > 0 else 'behind'}, {bound}"
            at = f"at {now.position_units / self._units_per_step:.1f} steps"
            yield _Finding(DiscrepancyKind.REST if rests else DiscrepancyKind.MOVING, board, at, round(error_steps, 3))

    @property
    def later_s(self) -> float:
        """How much later than the board the twin may come to rest at a target, because it has begun farther from it."""
        if not self._peak_units_per_s:
            return 0.0
        apart_units = abs(self._accepted_units) + self._left_units + self._units_per_step + self._astray_units
        return apart_units / self._peak_units_per_s

    def _own_units(self, error_units: int, *, rests: bool) -> int:
        """Return what of a difference is not the one that was accepted.

        A way to a target makes up for that one: the sides begin it apart and end it at the same place. In between they
        are apart by a part of it, since one of them brakes earlier. A way by PVT records keeps it.
        """
        if rests:
            return min((error_units, error_units - self._accepted_units), key=abs)
        return error_units - min(max(error_units, min(self._accepted_units, 0)), max(self._accepted_units, 0))

    @property
    def _at_target(self) -> bool:
        """True where the drive has reached a target: after velocity mode and homing, jitter decides where it rests.

        By the mode of the motion: a host may have chosen the next one since.
        """
        reached = self.board.statusword & self.twin.statusword & Status.TARGET_REACHED
        return self._motion_mode not in _WITHOUT_TARGET and bool(reached)

    def _bound_units(self, now_counts: int, units_per_s: int, *, rests: bool) -> float:
        if rests:
            return REST_STEPS * self._units_per_step
        moving_counts = max(now_counts - self._rested_counts, 0)
        drift_counts = DRIFT * moving_counts
        jitter_units = self._jitter_units(units_per_s, drift_counts)
        return max(STEPS * self._units_per_step, self._units_per_step + jitter_units)  # one step is rounding

    @staticmethod
    def _jitter_units(velocity_units_per_s: int, more_counts: float = 0.0) -> float:
        """Return how far an axis goes at a speed in the time that is not known exactly."""
        return abs(velocity_units_per_s) * (JITTER_COUNTS + TICK_COUNTS + more_counts) / COUNTS_PER_SECOND

    # --- homing

    @property
    def waits_for_the_twin(self) -> bool:
        """True if the board has ended its homing, and the twin still searches.

        The end must be that of the same homing: the twin may tell the beginning of the next one before the board does.
        """
        board, twin = self.board, self.twin
        if board.attained_counts is None or twin.began_counts is None or board.began_counts == self._left:
            return False
        return twin.homing and board.attained_counts > twin.began_counts

    def leave(self) -> None:
        """Wait no more for the twin's end of this homing."""
        self._left = self.board.began_counts

    def homings(self) -> Iterator[_Finding]:
        """Yield the difference of a homing that has ended on both sides: by it the board had lost steps.

        It is that of the places of the switch in the coordinates before. Where the position was not known before, it
        says nothing: the machine stood elsewhere.
        """
        board, twin = self.board, self.twin
        if board.attained_counts is None or twin.attained_counts is None or board.began_counts == self._judged_homing:
            return
        self._judged_homing = board.began_counts
        self._anchored, self._accepted_units = True, 0
        self._left_units, self._motion_mode = self._jitter_units(self._peak_units_per_s), None
        self._off_times, self._position_told, self._last_units = 0, False, None
        places_units = (
            self._place(self._board_leg, board.attained_counts),
            self._place(self._twin_leg, twin.attained_counts),
        )
        error_units = places_units[0] - places_units[1]
        if not board.was_known or abs(error_units) <= self._lost_bound_units:
            return
        board_steps, twin_steps = (round(units / self._units_per_step) for units in places_units)
        error_steps = round(error_units / self._units_per_step, 1)
        words = f"found its switch at {board_steps} steps: some {abs(error_steps):.0f} steps were lost before"
        yield _Finding(DiscrepancyKind.HOMING, words, f"at {twin_steps}", error_steps)

    @property
    def _lost_bound_units(self) -> float:
        """Difference of the switch's place that is none: two full steps, if the board was seen leaving the switch.

        Else its way in the time when it was not seen: a search overruns the switch by more or less.
        """
        before, last = self._board_leg_before, self._board_leg
        seen_s = (last.counts - before.counts) / COUNTS_PER_SECOND
        leaving = self._leg_units_per_s
        if seen_s > 0 and abs((last.units - before.units) / seen_s - leaving) <= _SAME_SPEED * abs(leaving):
            return LOST_UNITS
        return max(LOST_UNITS, self._peak_units_per_s * _UNSEEN_S)

    def _place(self, leg: _Leg, attained_counts: int) -> float:
        """Return where a side was when it had found its switch, from where it was last seen on its way there."""
        return leg.units + self._leg_units_per_s * (attained_counts - leg.counts) / COUNTS_PER_SECOND


def _words(state: str | None) -> str:
    return "nothing" if state is None else state.replace("_", " ")
