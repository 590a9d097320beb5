"""Find the switch edge that defines home, from any start position.

All methods work alike: search for the switch at high speed, move in front of the edge, cross it at low speed. So the
axis always crosses the edge in the same direction and at the same speed. The step counter is latched in the servo tick
in which the inputs show the edge. Then the axis ramps down and is at standstill a little behind the edge.
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
    """Phase of a search."""

    START = auto()
    SEARCH = auto()
    """Move fast until the switch closes."""
    LEAVE = auto()
    """Move fast in the edge's direction, from inside of the switch until it opens."""
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
    """Event of a search."""

    AWAY = auto()
    """At standstill the switch is open, and its side is unknown."""
    IN_FRONT = auto()
    """At standstill the axis is in front of the edge, as seen in the edge's direction."""
    BEHIND = auto()
    """At standstill the axis is behind the edge."""
    CROSSED = auto()
    """The switch has changed to the level for which the phase waits."""
    LIMIT = auto()
    """The limit switch ahead is closed, and the search may still reverse."""
    DEAD_END = auto()
    """The axis cannot continue, because of a limit switch or the end of the i32 range."""
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
"""Phase, or error, after each event. An error means FAILED; other events change nothing."""

_LIMIT_SWITCHES = DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT
_LIMIT_AHEAD = {POSITIVE: DigitalInput.POSITIVE_LIMIT, NEGATIVE: DigitalInput.NEGATIVE_LIMIT}


class Speeds(NamedTuple):
    """Limits of fast and slow strokes; `sign` is -1 if the axis moves down while the switches are passed upwards."""

    fast: Limits
    slow: Limits
    sign: int


class SwitchSearch:
    """One search, from standstill to standstill. The caller reads `phase` after every call."""

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
        """Reason of FAILED."""
        self.latched_step: int = 0
        """Step counter at the edge; valid from LATCHED on."""
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
        """Direction of the present or last stroke, in which the switches are passed."""

    # --- events

    def begin(self) -> None:
        """Begin the search from standstill."""
        self._stopped()

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """Handle new input levels."""
        before, self._inputs = self._inputs, inputs
        closed = inputs & ~before
        if (inputs ^ before) & self._method.switch and self._closed is self._wanted:
            self._happens(SearchEvent.CROSSED)
        elif closed & self._limit_ahead:
            self._happens(self._limit_event)
        elif closed & _LIMIT_SWITCHES & ~self._method.switch:
            self._happens(SearchEvent.WRONG_LIMIT)

    def finished(self) -> None:
        """Handle the end of a motion: the axis is at standstill."""
        if self.phase in _STROKES:
            self._happens(SearchEvent.DEAD_END)
        else:
            self._stopped()

    def time_out(self) -> None:
        """Fail, because the search has timed out."""
        self._happens(SearchEvent.TIMEOUT)

    def _stopped(self) -> None:
        self._happens(self._place)

    @property
    def _place(self) -> SearchEvent:
        """Event that tells where the axis is at standstill.

        If the switch is open and the axis has just crossed it, the axis is on the side to which it has moved.
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
        """True if the present stroke waits until the switch closes, False if until it opens."""
        if self.phase is Phase.SEARCH:
            return True
        return self._method.closes is not (self.phase is Phase.BACK)

    @property
    def _limit_ahead(self) -> DigitalInput:
        """Limit switch towards which the axis moves, unless the method searches for it."""
        return _LIMIT_AHEAD[self._direction] & ~self._method.switch

    @property
    def _limit_event(self) -> SearchEvent:
        """Event that the limit switch ahead causes."""
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
        """Begin a stroke, which lasts until an event or the end of the i32 range."""
        direction, limits = self._strokes[phase]
        self.phase = phase
        self._direction = -direction if turned and phase is Phase.SEARCH else direction
        if self._inputs & self._limit_ahead:
            self._happens(self._limit_event)
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
