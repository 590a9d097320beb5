"""Find the edge of the home or limit switch that defines an axis' home, from any start.

Every method takes the same way: search for the switch fast, move in front of the edge that counts, cross it slowly. So
the axis always crosses the edge in the same direction and at the same speed. The step counter is latched in the servo
tick when the inputs show the edge; then the axis ramps down and stands a little behind it.
"""

from enum import Enum, auto
from typing import NamedTuple

from steptwin.controller.modes.profile import Limits
from steptwin.controller.modes.profile_feed import ProfileFeed
from steptwin.controller.motion.kernel import I32_MAX
from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol.cia402 import DigitalInput, HomingError
from steptwin.protocol.homing_methods import NEGATIVE, POSITIVE, HomingMethod


class Phase(Enum):
    """The phases of a search."""

    START = auto()
    SEARCH = auto()
    """Move fast until the switch closes."""
    LEAVE = auto()
    """Move fast in the edge's direction, from within the switch until it opens."""
    TURN = auto()
    """Brake at a limit switch, before searching in the other direction."""
    BRAKE = auto()
    """Brake after an edge of the switch."""
    BACK = auto()
    """Move fast against the edge's direction, until the edge is crossed."""
    EDGE = auto()
    """Move slowly in the edge's direction, until the edge is crossed and the step counter latched."""
    LATCHED = auto()
    """Brake behind the edge that counts."""
    DONE = auto()
    FAILED = auto()


class SearchEvent(Enum):
    """The events of a search."""

    AWAY = auto()
    """The axis stands and the switch is open; the side of the switch is unknown."""
    IN_FRONT = auto()
    """The axis stands in front of the edge, seen in the direction that the axis must cross it in."""
    BEHIND = auto()
    """The axis stands behind the edge."""
    CROSSED = auto()
    """The switch has changed to the level that the phase waits for."""
    LIMIT = auto()
    """The limit switch ahead is closed, and the search may still reverse."""
    DEAD_END = auto()
    """The axis cannot go on: a limit switch or the end of the i32 range."""
    WRONG_LIMIT = auto()
    """The limit switch behind the axis has closed: the limit switches may be exchanged."""
    TIMEOUT = auto()


_STROKES = (Phase.SEARCH, Phase.LEAVE, Phase.BACK, Phase.EDGE)

TRANSITIONS: dict[tuple[Phase, SearchEvent], Phase | HomingError] = {
    (Phase.START, SearchEvent.AWAY): Phase.SEARCH,
    (Phase.START, SearchEvent.IN_FRONT): Phase.LEAVE,
    (Phase.START, SearchEvent.BEHIND): Phase.BACK,
    (Phase.SEARCH, SearchEvent.CROSSED): Phase.BRAKE,
    (Phase.SEARCH, SearchEvent.LIMIT): Phase.TURN,
    (Phase.TURN, SearchEvent.AWAY): Phase.SEARCH,
    (Phase.TURN, SearchEvent.IN_FRONT): Phase.LEAVE,
    (Phase.TURN, SearchEvent.BEHIND): Phase.BACK,
    (Phase.LEAVE, SearchEvent.CROSSED): Phase.BRAKE,
    (Phase.BRAKE, SearchEvent.IN_FRONT): Phase.EDGE,
    (Phase.BRAKE, SearchEvent.BEHIND): Phase.BACK,
    (Phase.BACK, SearchEvent.CROSSED): Phase.BRAKE,
    (Phase.EDGE, SearchEvent.CROSSED): Phase.LATCHED,
    (Phase.LATCHED, SearchEvent.IN_FRONT): Phase.DONE,
    (Phase.LATCHED, SearchEvent.BEHIND): Phase.DONE,
    (Phase.SEARCH, SearchEvent.DEAD_END): HomingError.NOT_FOUND,
    (Phase.LEAVE, SearchEvent.DEAD_END): HomingError.STUCK,
    (Phase.BACK, SearchEvent.DEAD_END): HomingError.STUCK,
    (Phase.EDGE, SearchEvent.DEAD_END): HomingError.STUCK,
    **{(phase, SearchEvent.WRONG_LIMIT): HomingError.WRONG_SWITCH for phase in _STROKES},
    **{(phase, SearchEvent.TIMEOUT): HomingError.TIMEOUT for phase in (*_STROKES, Phase.TURN, Phase.BRAKE)},
}
"""The phase that follows each event; any other event changes nothing. An error leads to FAILED."""

_LIMIT_SWITCHES = DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT
_LIMIT_AHEAD = {POSITIVE: DigitalInput.POSITIVE_LIMIT, NEGATIVE: DigitalInput.NEGATIVE_LIMIT}


class Speeds(NamedTuple):
    """The limits of fast and slow strokes, and how the axis moves when the switches are passed upwards: 1 or -1."""

    fast: Limits
    slow: Limits
    sign: int


class SwitchSearch:
    """One search, from standstill to standstill. Its owner reads `phase` after every call."""

    def __init__(
        self,
        context: AxisContext,
        feed: ProfileFeed,
        method: HomingMethod,
        speeds: Speeds,
        inputs: DigitalInput,
    ) -> None:
        self.phase: Phase = Phase.START
        self.error: HomingError = HomingError.NONE
        """The reason for FAILED."""
        self.latched_step: int = 0
        """The step counter when the edge was seen; valid from LATCHED on."""
        self._motion = context.motion
        self._feed = feed
        self._method = method
        self._inputs = inputs
        self._strokes = {
            Phase.SEARCH: (method.search_direction, speeds.fast),
            Phase.LEAVE: (method.edge_direction, speeds.fast),
            Phase.BACK: (-method.edge_direction, speeds.fast),
            Phase.EDGE: (method.edge_direction, speeds.slow),
        }
        self._sign = speeds.sign
        self._direction = method.search_direction
        """Direction of the stroke in progress or just ended, as the switches are passed."""

    # --- events

    def begin(self) -> None:
        """Begin, from standstill."""
        self._stopped()

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """Handle new input levels."""
        before, self._inputs = self._inputs, inputs
        closed = inputs & ~before
        if (inputs ^ before) & self._method.switch and self._closed is self._wanted:
            self._happens(SearchEvent.CROSSED)
        elif closed & self._limit_ahead:
            self._happens(self._end_of_way)
        elif closed & _LIMIT_SWITCHES & ~self._method.switch:
            self._happens(SearchEvent.WRONG_LIMIT)

    def finished(self) -> None:
        """Handle the end of a motion: the axis is at rest."""
        if self.phase in _STROKES:
            self._happens(SearchEvent.DEAD_END)
        else:
            self._stopped()

    def time_out(self) -> None:
        """Fail: the timeout is over."""
        self._happens(SearchEvent.TIMEOUT)

    def _stopped(self) -> None:
        self._happens(self._place)

    @property
    def _place(self) -> SearchEvent:
        """The event that says where the axis stands.

        With the switch open, an axis that has just crossed it stands on the side that it was moving to.
        """
        if self._closed:
            return SearchEvent.BEHIND if self._method.closes else SearchEvent.IN_FRONT
        if self.phase in (Phase.START, Phase.TURN):
            return SearchEvent.AWAY
        return SearchEvent.BEHIND if self._direction == self._method.edge_direction else SearchEvent.IN_FRONT

    @property
    def _closed(self) -> bool:
        return bool(self._inputs & self._method.switch)

    @property
    def _wanted(self) -> bool:
        """True if the stroke in progress waits for the switch to close, False if for it to open."""
        if self.phase is Phase.SEARCH:
            return True
        return self._method.closes is not (self.phase is Phase.BACK)

    @property
    def _limit_ahead(self) -> DigitalInput:
        """The limit switch that the axis moves towards, unless it is the switch searched for."""
        return _LIMIT_AHEAD[self._direction] & ~self._method.switch

    @property
    def _end_of_way(self) -> SearchEvent:
        """The event that the limit switch ahead causes."""
        may_turn = self._method.turns and self._direction == self._method.search_direction
        return SearchEvent.LIMIT if self.phase is Phase.SEARCH and may_turn else SearchEvent.DEAD_END

    # --- reactions

    def _happens(self, event: SearchEvent) -> None:
        target = TRANSITIONS.get((self.phase, event))
        if target is None:
            return
        if isinstance(target, HomingError):
            self.error = target
            self._brake(Phase.FAILED)
        elif target in _STROKES:
            self._move(target, turned=self.phase is Phase.TURN)
        elif target is Phase.DONE:
            self.phase = target
        else:
            self._brake(target)

    def _move(self, phase: Phase, *, turned: bool) -> None:
        """Begin a stroke, which lasts until an event, at the latest until the end of the i32 range."""
        direction, limits = self._strokes[phase]
        self.phase = phase
        self._direction = -direction if turned and phase is Phase.SEARCH else direction
        if self._inputs & self._limit_ahead:
            self._happens(self._end_of_way)
            return
        self._feed.move_to(self._sign * self._direction * I32_MAX, limits)
        if not self._motion.running:
            self._happens(SearchEvent.DEAD_END)

    def _brake(self, phase: Phase) -> None:
        if phase is Phase.LATCHED:
            self.latched_step = self._motion.counter_steps
        self.phase = phase
        if self._motion.running:
            self._feed.stop(self._strokes[Phase.SEARCH][1])
        if not self._motion.running:
            self._stopped()
