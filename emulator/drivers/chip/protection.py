"""Model what switches a chip's outputs off to protect it: its heat, and causes that it answers with a latch.

A short circuit trips it as soon as current flows, a supply that is too high as soon as it is there. The latch holds the
outputs off after the cause has gone, until what its source says: ENABLE, reset, a power cycle, or nothing at all, for a
chip without such a protection, which a short destroys. While the cause lasts it trips again.
"""

from collections.abc import Iterator, Mapping

from steptwin.emulator.drivers.chip.junction import Junction
from steptwin.emulator.drivers.limits import Rule
from steptwin.protocol.drivers import Release


class Protection:
    """Whether a chip's outputs are shut down, at any instant since power-up."""

    def __init__(self, junction: Junction, latches: Mapping[Rule, Release]) -> None:
        self.junction = junction
        self.causes: set[Rule] = set()
        """The rules that are broken now."""
        self._latches = latches
        self._latched: set[Rule] = set()
        self._edges: list[tuple[int, bool]] = [(0, False)]
        """Instants from which on a latch holds the outputs off, or none does; the first stands for all before it."""

    def trip(self, counts: int, powered: Mapping[Rule, bool], freed: Mapping[Release, bool]) -> Iterator[Rule]:
        """Take what holds from an instant on; yield the rules whose latches trip.

        Args:
            counts: the instant.
            powered: whether the cause of each rule would trip now.
            freed: whether each release is at hand now.
        """
        for rule, release in self._latches.items():
            if rule in self._latched and freed[release]:
                self._latched.discard(rule)
            if rule in self.causes and powered[rule] and rule not in self._latched:
                self._latched.add(rule)
                yield rule
        if self.latched != self._edges[-1][1]:
            self._edges.append((max(counts, self._edges[-1][0]), self.latched))

    @property
    def latched(self) -> bool:
        """Whether a latch holds the outputs off now."""
        return bool(self._latched)

    def shut_down(self, counts: int) -> bool:
        """Return True if the outputs are shut down at an instant."""
        return self.junction.shut_down(counts) or self._held(counts)

    def told(self, counts: int) -> bool:
        """Return True if a fault output tells of it: nothing tells that a chip is destroyed."""
        silent = Release.NEVER in self._latches.values()
        return self.junction.shut_down(counts) or (self._held(counts) and not silent)

    def _held(self, counts: int) -> bool:
        return next((held for since, held in reversed(self._edges) if since <= counts), self._edges[0][1])

    def shutdowns(self, until_counts: int) -> list[tuple[int, int]]:
        """Return the instants when a shutdown began, 1, or ended, 0, unless they are forgotten."""
        hot = self.junction.shutdowns(until_counts)
        if len(self._edges) == 1 and not self._edges[0][1]:
            return hot
        instants = sorted({counts for counts, _ in (*hot, *self._edges[1:]) if counts <= until_counts})
        found: list[tuple[int, int]] = []
        before = self.shut_down(instants[0] - 1) if instants else False
        for counts in instants:
            if self.shut_down(counts) != before:
                before = not before
                found.append((counts, int(before)))
        return found

    def forget(self, counts: int) -> None:
        """Drop the history before an instant."""
        self.junction.forget(counts)
        held = self._held(counts)
        self._edges = [(counts, held), *(edge for edge in self._edges if edge[0] > counts)]
