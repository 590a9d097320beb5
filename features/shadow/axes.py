"""Compare an axis of the real board with its twin: the drive's state, the position, and the end of each homing.

The state comes from the PDOs of both sides that contain the statusword (0x6041) and the mode (0x6061); the twin's PDO
mapping decodes them. The board's position comes from its PDO (0x6064); the twin's position is read from its step
counter at the instant of that PDO.
"""

from collections.abc import Iterator
from math import copysign
from typing import Final, NamedTuple

from steptwin.features.shadow.discrepancy import SETTLED_COUNTS, DiscrepancyKind
from steptwin.protocol.cia402 import Mode, State, Status
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

JITTER_COUNTS: Final = 2 * COUNTS_PER_MS
"""Uncertainty of a time stamp, and of the instant when a PDO that waits for the bus sampled its value."""
TICK_COUNTS: Final = COUNTS_PER_SECOND // 4000
"""One servo tick: a command may act one tick later on one side than on the other."""
SEGMENT_DELAY_S: Final = 0.016
"""Longest delay with which a changed profile acts on one side only: it waits for the end of the current segment."""
SAMPLE_S: Final = 0.01
"""Longest time between two samples of a moving axis of the twin."""
CLOCK_DRIFT: Final = 100e-6
"""Largest relative difference between the board's crystal and the computer's clock."""
MOVING_TOLERANCE_STEPS: Final = 2.0
"""Position differences up to this are ignored while an axis moves."""
STANDSTILL_TOLERANCE_STEPS: Final = 1.0
"""Position differences up to this are ignored when an axis has stopped at its target."""
STANDSTILL_COUNTS: Final = 150 * COUNTS_PER_MS
"""Time without motion after which an axis counts as at rest; its PDO comes every 100 ms."""
REPORTED_STANDSTILL_COUNTS: Final = 500 * COUNTS_PER_MS
"""Time at standstill after which an axis has sent its final position at least twice, even with a late twin."""
LOST_TOLERANCE_UNITS: Final = 2 * 16384
"""Switch positions that differ by at most two full steps, in wire units, are equal; a slipping rotor loses four."""
_PDO_PERIOD_S: Final = 0.1
"""Longest time between two positions of the board while it searches a switch: it sends a PDO every 100 ms."""
CLOCK_STEP_UNCERTAINTY_S: Final = 0.2
"""Uncertainty of time after a step of the time stamps' clock; a moving machine sends frames more often than this."""
_SPEED_TOLERANCE: Final = 0.3
"""Relative tolerance of a speed that is computed from two PDOs."""
_PDOS_TO_REPORT: Final = 2
"""Number of consecutive PDOs beyond the tolerance before it is reported: a single one may have waited for the bus."""


_BY_PROFILE = (Mode.PROFILE_POSITION, Mode.PROFILE_VELOCITY)
_WITHOUT_TARGET = (Mode.PROFILE_VELOCITY, Mode.HOMING)
"""Modes without a target position: where the axis stops depends on jitter."""


class DriveReport(NamedTuple):
    """The drive's objects in one PDO; an object that is not mapped is None.

    Attributes:
        statusword: 0x6041, or None.
        mode: 0x6061, or None.
        position_units: 0x6064 in wire units, or None.
    """

    statusword: int | None
    mode: int | None
    position_units: int | None


class TwinAxis(NamedTuple):
    """Position and motion of an axis of the twin at one instant.

    Attributes:
        position_units: 0x6064.
        velocity_units_per_s: 0x606C.
        leaving_units_per_s: homing speed off the switch, 0x6099:02.
        ramp_units_per_s2: the larger of profile acceleration and deceleration, 0x6083 and 0x6084.
        relative: True if the last target is relative, bit 6 of 0x6040.
    """

    position_units: int
    velocity_units_per_s: int
    leaving_units_per_s: int
    ramp_units_per_s2: int
    relative: bool = False


class _Leg(NamedTuple):
    """A sample of the last move onto a switch: instant in counts, position in wire units before the new zero."""

    counts: int
    units: int


class DriveSide:
    """The state of the drive on one side, taken from its PDOs; instants are in counts of that side's own clock."""

    def __init__(self) -> None:
        self.state: str | None = None
        self.since_counts: int = 0
        self.mode: int | None = None
        self.statusword: int = 0
        self.began_counts: int | None = None
        """Start of the last homing; None before the first one."""
        self.attained_counts: int | None = None
        """End of the last homing; None during a homing and before the first one."""
        self.was_known: bool = False
        """True if the position was known when the last homing began."""

    def take(self, counts: int, told: DriveReport) -> None:
        """Process the objects of one PDO."""
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
        """Register the start and the end of a homing: both bits are 0 while it runs (CiA 402-2, homing mode)."""
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
        """True if the statusword reports the end of the drive's position or velocity profile."""
        if self.mode == Mode.PROFILE_VELOCITY:
            return bool(self.statusword & Status.ZERO_SPEED)
        return self.mode == Mode.PROFILE_POSITION and bool(self.statusword & Status.TARGET_REACHED)

    @property
    def homing(self) -> bool:
        """True during a homing."""
        return self.began_counts is not None and self.attained_counts is None and self.mode == Mode.HOMING

    @property
    def homing_counts(self) -> int:
        """Duration of the last homing; only valid after its end."""
        assert self.began_counts is not None
        assert self.attained_counts is not None
        return self.attained_counts - self.began_counts


class _Difference(NamedTuple):
    kind: DiscrepancyKind
    board: str
    twin: str
    error_steps: float | None = None


class ComparedAxis:
    """An axis of the real board and of its twin, and the tolerance of their difference."""

    def __init__(self, units_per_step: float) -> None:
        """Start without a common position: positions are compared once both sides have stopped at the same one."""
        self.board: DriveSide = DriveSide()
        self.twin: DriveSide = DriveSide()
        self._units_per_step = units_per_step
        self._reported_states: tuple[str | None, str | None] | None = None
        self._anchored = False
        self._accepted_units = 0
        """Position difference that was accepted as jitter at the end of a motion without a target."""
        self._left_units = 0.0
        """Largest possible jitter of all homings and motions without a target since the last comparison at rest."""
        self._off_times = 0
        self._position_reported = False
        self._moved_counts = 0
        """Last instant when the twin moved."""
        self._compared_at_rest = True
        """True if the positions have been compared at rest since then."""
        self._started_counts = 0
        """Instant when the twin started to move."""
        self._peak_units_per_s = 0
        self._last_units_per_s = 0
        self._varied_units_per_s = 0
        """Sum of all changes of the twin's velocity since it started to move."""
        self._commanded = False
        """True if a host has changed the profile since the start of the motion."""
        self._ramp_units_per_s2 = 0
        """The steepest profile ramp since the start of the motion."""
        self._uncertain_s = 0.0
        """Time by which the twin may be early or late after a step of the clock, until the machine is at rest."""
        self._relative = False
        """True if a target since the start of the motion was relative: the sides may have started it apart."""
        self._motion_mode: int | None = None
        """Mode of the twin's current or last motion; None after a homing that has ended on both sides."""
        self._last_units: int | None = None
        self._judged_homing: int | None = None
        self._board_leg = self._board_leg_before = self._twin_leg = _Leg(0, 0)
        self._leg_units_per_s = 0.0
        """The twin's velocity at the end of its homing."""
        self._skipped_homing: int | None = None
        """Start of a homing of the board whose end on the twin is not awaited."""

    # --- states

    def states(self, now_counts: int) -> Iterator[_Difference]:
        """Yield a difference of the states once, after they have differed for `SETTLED_COUNTS`."""
        board, twin = self.board, self.twin
        states = (board.state, twin.state)
        if board.state == twin.state:
            self._reported_states = None
            return
        settled = now_counts - max(board.since_counts, twin.since_counts) >= SETTLED_COUNTS
        if settled and None not in states and states != self._reported_states:
            self._reported_states = states
            yield _Difference(DiscrepancyKind.STATE, _words(board.state), _words(twin.state))

    # --- positions

    def follow(self, now_counts: int, now: TwinAxis) -> None:
        """Register the twin's motion, and its position while it searches a switch."""
        before_units_per_s, self._last_units_per_s = self._last_units_per_s, now.velocity_units_per_s
        if now.velocity_units_per_s:
            pause_counts = STANDSTILL_COUNTS if self.board.mode == Mode.HOMING else 0  # a search has several strokes
            if not before_units_per_s and now_counts - self._moved_counts > pause_counts:
                if self._motion_mode in _WITHOUT_TARGET and not self._compared_at_rest:
                    self._left_units += self._stop_spread_units
                self._started_counts = now_counts
                self._peak_units_per_s = self._varied_units_per_s = self._ramp_units_per_s2 = 0
                self._commanded = self._relative = False
            self._compared_at_rest = False
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
        """Register a host's command to the drive; it matters if the twin moves by a profile."""
        self._commanded |= velocity_units_per_s != 0 and self.board.mode in _BY_PROFILE

    def lose_time(self) -> None:
        """Register a step of the time stamps' clock during a motion: the sides may differ by the missed time."""
        self._uncertain_s = CLOCK_STEP_UNCERTAINTY_S

    def find_time(self) -> None:
        """Register a standstill of the machine: both sides start the next motion at the same time again."""
        self._uncertain_s = 0.0

    def still(self, now_counts: int) -> bool:
        """Return whether the twin has been still for so long that the board must have sent its final position."""
        return now_counts - self._moved_counts >= REPORTED_STANDSTILL_COUNTS

    @property
    def _uncertain_units(self) -> float:
        """Largest distance between the sides that the uncertain size of a clock step explains."""
        return self._peak_units_per_s * self._uncertain_s

    @property
    def _segment_units(self) -> float:
        """Largest distance between the sides if one side applies a changed profile one segment later.

        Until then that side follows the old ramp and gains speed. The twin's true changes of velocity may exceed the
        sampled ones, because the velocity may rise and fall between two samples: the ramp bounds them.
        """
        if not self._commanded:
            return 0.0
        return (self._varied_units_per_s + self._ramp_units_per_s2 * (SEGMENT_DELAY_S + 2 * SAMPLE_S)) * SEGMENT_DELAY_S

    @property
    def _stop_spread_units(self) -> float:
        """Largest distance between the sides at the end of a motion without a target."""
        return self._jitter_units(self._peak_units_per_s) + self._segment_units + self._uncertain_units

    def positions(self, now_counts: int, units: int, now: TwinAxis) -> Iterator[_Difference]:
        """Yield a difference of the positions at this instant once, if it is beyond the tolerance."""
        self.follow(now_counts, now)
        repeated, self._last_units = units == self._last_units, units
        if self.board.homing:
            self._board_leg_before, self._board_leg = self._board_leg, _Leg(now_counts, units)
        if self.board.homing or self.twin.homing:
            self._off_times = 0
            return
        error_units = units - now.position_units
        rests = repeated and now_counts - self._moved_counts >= STANDSTILL_COUNTS
        if not self._anchored:
            self._anchored = rests and abs(error_units) <= STANDSTILL_TOLERANCE_STEPS * self._units_per_step
            return
        own_units = self._own_units(error_units, rests=rests)
        by_jitter_units = self._left_units + (self._uncertain_units if self._at_target else self._stop_spread_units)
        if self._at_target and self._motion_mode == Mode.PROFILE_POSITION and not self._relative:
            by_jitter_units = 0.0  # the target is absolute, wherever the motion has started
        if rests and abs(own_units) <= by_jitter_units:
            self._accepted_units, own_units = error_units, 0
        # If a host ends a motion early, the difference from its highest speed remains while the axis slows down.
        units_per_s = self._peak_units_per_s if self._commanded else now.velocity_units_per_s
        bound_units = self._bound_units(now_counts, units_per_s, rests=rests)
        bound_units += 0 if rests else self._left_units + self._segment_units
        if self._uncertain_s and not rests:
            self._off_times = 0
            return
        if rests:
            self._left_units, self._compared_at_rest = 0.0, True
        if abs(own_units) <= bound_units:
            self._off_times, self._position_reported = 0, False
            return
        self._off_times += 1
        if self._off_times >= _PDOS_TO_REPORT and not self._position_reported:
            self._position_reported = True
            error_steps = own_units / self._units_per_step
            bound = f"at most {bound_units / self._units_per_step:.1f} are jitter"
            board = f"{abs(error_steps):.1f} steps {'ahead' if error_steps > 0 else 'behind'}, {bound}"
            at = f"at {now.position_units / self._units_per_step:.1f} steps"
            yield _Difference(
                DiscrepancyKind.REST if rests else DiscrepancyKind.MOVING, board, at, round(error_steps, 3)
            )

    @property
    def later_s(self) -> float:
        """Largest delay of the twin's stop at a target: it may have started farther away from it than the board."""
        if not self._peak_units_per_s:
            return 0.0
        apart_units = abs(self._accepted_units) + self._left_units + self._units_per_step + self._uncertain_units
        return apart_units / self._peak_units_per_s

    def _own_units(self, error_units: int, *, rests: bool) -> int:
        """Return a position difference without the part that was accepted as jitter before.

        A move to an absolute target removes the accepted part: the sides start apart and stop at the same position.
        During the move a part of it remains, because one side brakes earlier. A move by PVT records keeps all of it.
        """
        if rests:
            return min((error_units, error_units - self._accepted_units), key=abs)
        return error_units - min(max(error_units, min(self._accepted_units, 0)), max(self._accepted_units, 0))

    @property
    def _at_target(self) -> bool:
        """True if both drives have reached a target; False after velocity mode and homing, which have no target.

        The mode of the motion counts, not the current one: a host may have set another mode since.
        """
        reached = self.board.statusword & self.twin.statusword & Status.TARGET_REACHED
        return self._motion_mode not in _WITHOUT_TARGET and bool(reached)

    def _bound_units(self, now_counts: int, units_per_s: int, *, rests: bool) -> float:
        if rests:
            return STANDSTILL_TOLERANCE_STEPS * self._units_per_step
        moving_counts = max(now_counts - self._started_counts, 0)
        drift_counts = CLOCK_DRIFT * moving_counts
        jitter_units = self._jitter_units(units_per_s, drift_counts)
        return max(
            MOVING_TOLERANCE_STEPS * self._units_per_step, self._units_per_step + jitter_units
        )  # one step is rounding

    @staticmethod
    def _jitter_units(velocity_units_per_s: int, more_counts: float = 0.0) -> float:
        """Return how far an axis moves at a velocity in the uncertainty of the time."""
        return abs(velocity_units_per_s) * (JITTER_COUNTS + TICK_COUNTS + more_counts) / COUNTS_PER_SECOND

    # --- homing

    @property
    def waits_for_the_twin(self) -> bool:
        """True if the board has ended its homing and the twin still searches.

        Both must be in the same homing: the twin's PDO may report the start of the next one before the board's does.
        """
        board, twin = self.board, self.twin
        if board.attained_counts is None or twin.began_counts is None or board.began_counts == self._skipped_homing:
            return False
        return twin.homing and board.attained_counts > twin.began_counts

    def leave(self) -> None:
        """Stop waiting for the end of this homing on the twin."""
        self._skipped_homing = self.board.began_counts

    def homings(self) -> Iterator[_Difference]:
        """Yield the steps that the board had lost before a homing that has now ended on both sides.

        They are the difference of the switch's positions in the coordinates before the homing. If the position was
        not known before the homing, nothing is yielded.
        """
        board, twin = self.board, self.twin
        if board.attained_counts is None or twin.attained_counts is None or board.began_counts == self._judged_homing:
            return
        self._judged_homing = board.began_counts
        self._anchored, self._accepted_units = True, 0
        self._left_units, self._motion_mode = self._jitter_units(self._peak_units_per_s), None
        self._off_times, self._position_reported, self._last_units = 0, False, None
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
        yield _Difference(DiscrepancyKind.HOMING, words, f"at {twin_steps}", error_steps)

    @property
    def _lost_bound_units(self) -> float:
        """Tolerance of the switch's position: two full steps if two PDOs show the board moving off the switch.

        Otherwise it is the distance travelled in one PDO period, because the search overruns the switch by a variable
        distance.
        """
        before, last = self._board_leg_before, self._board_leg
        seen_s = (last.counts - before.counts) / COUNTS_PER_SECOND
        leaving = self._leg_units_per_s
        if seen_s > 0 and abs((last.units - before.units) / seen_s - leaving) <= _SPEED_TOLERANCE * abs(leaving):
            return LOST_TOLERANCE_UNITS
        return max(LOST_TOLERANCE_UNITS, self._peak_units_per_s * _PDO_PERIOD_S)

    def _place(self, leg: _Leg, attained_counts: int) -> float:
        """Return a side's position at the end of its homing, extrapolated from its last sample."""
        return leg.units + self._leg_units_per_s * (attained_counts - leg.counts) / COUNTS_PER_SECOND


def _words(state: str | None) -> str:
    return "nothing" if state is None else state.replace("_", " ")
