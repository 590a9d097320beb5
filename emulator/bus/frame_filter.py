"""Hold back, disturb, double or lose frames at the instant when a station begins to send: what a filter may do.

Which frames a filter strikes and how often is data: equal filters and seeds give equal strikes.
"""

from collections.abc import Callable, Collection, Container
from dataclasses import dataclass
from random import Random
from typing import NamedTuple, Protocol

from steptwin.protocol.frame import Frame


class StrikeEffect(NamedTuple):
    """What a strike does to an attempt to send; the bus carries it out.

    Attributes:
        hold_counts: time that the senders wait before they try again; 0 for none.
        sender_off: the senders go into bus-off.
        disturbed: the frame is disturbed before its receivers have it.
        doubled: the frame is disturbed when its receivers have it.
        lost_by: places of the stations on the bus that do not receive the frame.
    """

    hold_counts: int = 0
    sender_off: bool = False
    disturbed: bool = False
    doubled: bool = False
    lost_by: slice = slice(0)


class FrameFilter(Protocol):
    """Strikes the attempts to send which fulfil all its conditions, from its beginning to its end.

    Filters of one class hold back or double a frame only once.
    """

    @property
    def do(self) -> str:
        """What it is called in reports."""
        ...

    @property
    def cob_ids(self) -> Collection[int]:
        """Identifiers of the frames that it may strike."""
        ...

    @property
    def rate(self) -> float:
        """Part of the attempts that it strikes, 0 to 1, drawn from the bus' seeded generator."""
        ...

    @property
    def skip(self) -> int:
        """Number of attempts that it lets pass first."""
        ...

    @property
    def count(self) -> int | None:
        """Greatest number of strikes; None for no limit."""
        ...

    def effect(self) -> StrikeEffect:
        """Return what a strike does."""
        ...


class Strike(NamedTuple):
    """One strike of a filter: its instant since power-up, the filter, and the frame that it struck."""

    counts: int
    filter: FrameFilter
    frame: Frame


@dataclass(slots=True)
class _InForce:
    """A filter that may strike, how many attempts it has concerned, and how often it has struck."""

    filter: FrameFilter
    concerned: int = 0
    strikes: int = 0


class FiltersInForce:
    """The filters that may strike on a bus now, tried in the order of their beginnings, and what they have struck."""

    def __init__(self) -> None:
        """Begin without filters; `reseed` sets the seed of those that strike at random."""
        self.struck: list[Strike] = []
        """Every strike, in order of time."""
        self.on_strike: Callable[[Strike], None] = lambda _strike: None
        """Called at each strike."""
        self.in_force: list[_InForce] = []
        self._random = Random(0)

    def begin(self, added: FrameFilter) -> None:
        """Try a further filter from now on, after those that are there."""
        self.in_force.append(_InForce(added))

    def end(self, ended: FrameFilter) -> None:
        """Try this very filter no more; one that is not there, or an equal one, changes nothing."""
        self.in_force = [each for each in self.in_force if each.filter is not ended]

    def end_all(self) -> None:
        """Try no filter any more."""
        self.in_force = []

    def reseed(self, seed: int) -> None:
        """Draw from another seed from now on."""
        self._random = Random(seed)

    def strike(
        self, frame: Frame, now_counts: int, had: Container[type[FrameFilter] | None] = ()
    ) -> FrameFilter | None:
        """Return the filter that strikes an attempt to send, or None: none of the classes that the frame has had."""
        for each in self.in_force:
            if type(each.filter) not in had and frame.cob_id in each.filter.cob_ids and self._chosen(each):
                self.struck.append(Strike(now_counts, each.filter, frame))
                self.on_strike(self.struck[-1])
                return each.filter
        return None

    def _chosen(self, each: _InForce) -> bool:
        chosen = each.filter
        each.concerned += 1
        if each.concerned <= chosen.skip or each.strikes == chosen.count:
            return False
        if chosen.rate < 1 and self._random.random() >= chosen.rate:
            return False
        each.strikes += 1
        return True
