"""Filters that delay, disturb, double or lose frames at the instant when a station begins to send.

A filter is data: it selects the frames, and how often it strikes them. Equal filters and seeds give equal strikes.
"""

from collections.abc import Callable, Collection, Container
from dataclasses import dataclass
from random import Random
from typing import NamedTuple, Protocol

from steptwin.protocol.frame import Frame


class StrikeEffect(NamedTuple):
    """Effect of a strike on an attempt to send; the bus executes it.

    Attributes:
        hold_counts: time that the senders wait before they try again; 0 for none.
        sender_off: True if the senders go into bus-off.
        disturbed: True if the frame is disturbed before its receivers have it.
        doubled: True if the frame is disturbed after its receivers have it.
        lost_by: slice of the bus' list of stations that do not receive the frame.
    """

    hold_counts: int = 0
    sender_off: bool = False
    disturbed: bool = False
    doubled: bool = False
    lost_by: slice = slice(0)


class FrameFilter(Protocol):
    """Strikes the attempts to send that fulfil all its conditions, while it is active.

    Filters of one class delay or double a frame only once.
    """

    @property
    def do(self) -> str:
        """Name in reports."""
        ...

    @property
    def cob_ids(self) -> Collection[int]:
        """COB-IDs of the frames that it may strike."""
        ...

    @property
    def rate(self) -> float:
        """Probability of a strike, 0 to 1, drawn from the bus' seeded generator."""
        ...

    @property
    def skip(self) -> int:
        """Number of attempts that pass before the first strike."""
        ...

    @property
    def count(self) -> int | None:
        """Highest number of strikes; None for no limit."""
        ...

    def effect(self) -> StrikeEffect:
        """Return the effect of a strike."""
        ...


class Strike(NamedTuple):
    """One strike: instant since power-up, filter, struck frame."""

    counts: int
    filter: FrameFilter
    frame: Frame


@dataclass(slots=True)
class _InForce:
    """An active filter, with the number of attempts that matched it and the number of its strikes."""

    filter: FrameFilter
    concerned: int = 0
    strikes: int = 0


class FiltersInForce:
    """The active filters of a bus, tried in the order of their beginning, and their strikes."""

    def __init__(self) -> None:
        """Begin without filters; `reseed` sets the seed of random strikes."""
        self.struck: list[Strike] = []
        """All strikes, in order of time."""
        self.on_strike: Callable[[Strike], None] = lambda _strike: None
        """Called at each strike."""
        self.in_force: list[_InForce] = []
        self._random = Random(0)

    def begin(self, added: FrameFilter) -> None:
        """Add a filter; it is tried after the present ones."""
        self.in_force.append(_InForce(added))

    def end(self, ended: FrameFilter) -> None:
        """Remove this filter object, if it is active; an equal one stays."""
        self.in_force = [each for each in self.in_force if each.filter is not ended]

    def end_all(self) -> None:
        """Remove all filters."""
        self.in_force = []

    def reseed(self, seed: int) -> None:
        """Set the seed of the random strikes from now on."""
        self._random = Random(seed)

    def strike(
        self, frame: Frame, now_counts: int, had: Container[type[FrameFilter] | None] = ()
    ) -> FrameFilter | None:
        """Return the filter that destroys an attempt to send, or None; filters of the classes in `had` are skipped."""
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
