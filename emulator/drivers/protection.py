"""Model a chip's protections, which switch its outputs off: thermal shutdown and latches.

The thermal model has one resistance and one capacity between junction and ambient air. At a power P, the junction
approaches ambient + P R exponentially, with the time constant R C. P is I^2 Ron of both phases, where Ron is the upper
and lower transistor together. In microstep modes the currents are a cosine and a sine, so P = I_peak^2 Ron. If both
phases carry the full current, as in a TB6560's two-phase mode, P is twice as high.

For the TB6560, R = 25 K/W without heat sink follows from the allowed 5 W at 25 degC with a limit of 150 degC (pages 6
to 8). The capacity is not in the datasheet: 4 J/K is assumed, for 10 g of copper and plastic. The datasheet gives a
hysteresis of 20 K and no latch. The model uses the stricter interpretation: the outputs stay off until RESET is low
while the junction is at 150 degC or below. RESET is a level (page 11), so it may also be low before the junction has
cooled down. Other chips switch on again as soon as they are cool enough (`Release`).

A short circuit trips the latch as soon as current flows; an overvoltage trips it at once. The latch keeps the outputs
off after the cause is gone, until its release: ENABLE, reset or a power cycle. A chip without such a protection is
destroyed by a short circuit: it has no release. While the cause lasts, the latch trips again.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import ceil, exp, floor, inf, log
from operator import attrgetter
from typing import NamedTuple

from steptwin.emulator.drivers.limits import Rule
from steptwin.protocol.drivers import Cooling, Release, Shutdown


class _Span(NamedTuple):
    """Time span in which the junction changes from one temperature towards another."""

    from_counts: int
    start_celsius: float
    steady_celsius: float
    shut_down: bool
    until_counts: int | None
    """Instant when a shutdown begins or ends; None if that needs an external change."""


class Junction:
    """Junction temperature at any instant since power-up, when it is ambient."""

    def __init__(self, cooling: Cooling, shutdown: Shutdown | None) -> None:
        self._cooling = cooling
        self._limit_celsius = inf if shutdown is None else shutdown.celsius
        self._release_celsius = inf if shutdown is None else shutdown.celsius - shutdown.hysteresis_k
        self._power_w = 0.0
        self._released = False
        """True while a shutdown ends by cooling alone."""
        self._spans = [_Span(0, cooling.ambient_celsius, cooling.ambient_celsius, shut_down=False, until_counts=None)]
        """Spans up to the latest instant of a query; while it is released, shutdowns may come and go without end."""

    def heat(self, counts: int, power_w: float) -> None:
        """Set the power that the outputs dissipate from an instant on, unless they are shut down."""
        self._reach(counts)  # what has come before, by the power before
        self._power_w = power_w
        self._turn(counts)

    def release(self, counts: int, *, on: bool) -> None:
        """Set whether, from an instant on, a shutdown ends when the junction is cool enough."""
        self._reach(counts)
        self._released = on
        self._turn(counts)

    def celsius(self, counts: int) -> float:
        """Return the temperature at an instant."""
        span = self._span(counts)
        left = exp(-(counts - span.from_counts) / self._cooling.time_constant_counts)
        return span.steady_celsius + (span.start_celsius - span.steady_celsius) * left

    def shut_down(self, counts: int) -> bool:
        """Return True if the outputs are shut down at an instant."""
        return self._span(counts).shut_down

    def shutdown_not_before(self, counts: int, power_max_w: float) -> int | None:
        """Return the instant before which no shutdown can begin at up to this power, from `counts` on; None for never.

        During a shutdown, return the instant of its end instead; None if it ends only by a change of a pin.
        """
        span = self._span(counts)
        if span.shut_down:
            return span.until_counts
        steady_celsius = self._steady_celsius(power_max_w)
        if steady_celsius <= self._limit_celsius:
            return None
        part = log((steady_celsius - self.celsius(counts)) / (steady_celsius - self._limit_celsius))
        return counts + floor(part * self._cooling.time_constant_counts)

    def forget(self, counts: int) -> None:
        """Drop the history before an instant."""
        del self._spans[: max(self._at(counts), 0)]

    def shutdowns(self, until_counts: int) -> list[tuple[int, int]]:
        """Return the instants since `forget` when a shutdown began (1) or ended (0)."""
        self._reach(until_counts)
        known = [span for span in self._spans if span.from_counts <= until_counts]
        return [
            (now.from_counts, int(now.shut_down)) for last, now in pairwise(known) if now.shut_down != last.shut_down
        ]

    def _steady_celsius(self, power_w: float) -> float:
        return self._cooling.ambient_celsius + power_w * self._cooling.resistance_k_per_w

    def _span(self, counts: int) -> _Span:
        return self._spans[max(self._at(counts), 0)]

    def _at(self, counts: int) -> int:
        """Return the index of the span at an instant, -1 before the first."""
        self._reach(counts)
        return bisect_right(self._spans, counts, key=attrgetter("from_counts")) - 1

    def _reach(self, counts: int) -> None:
        """Compute the spans up to an instant; each end of a span begins or ends a shutdown."""
        while (last := self._spans[-1]).until_counts is not None and last.until_counts <= counts:
            start_celsius = self._release_celsius if last.shut_down else self._limit_celsius
            self._begin(last.until_counts, start_celsius, not last.shut_down)

    def _turn(self, counts: int) -> None:
        """Begin a new span at an instant, because the power or the release has changed."""
        start_celsius, shut_down = self.celsius(counts), self.shut_down(counts)
        while self._spans[-1].from_counts > counts:  # these spans assumed no change
            self._spans.pop()
        self._begin(
            counts, start_celsius, shut_down and not (self._released and start_celsius <= self._release_celsius)
        )

    def _begin(self, counts: int, start_celsius: float, shut_down: bool) -> None:
        steady_celsius = self._steady_celsius(0.0 if shut_down else self._power_w)
        until_counts = None
        if steady_celsius > self._limit_celsius:
            until_counts = counts + self._counts_to(self._limit_celsius, start_celsius, steady_celsius)
        elif shut_down and self._released and steady_celsius < self._release_celsius:
            until_counts = counts + self._counts_to(self._release_celsius, start_celsius, steady_celsius)
        self._spans.append(_Span(counts, start_celsius, steady_celsius, shut_down, until_counts))

    def _counts_to(self, celsius: float, start_celsius: float, steady_celsius: float) -> int:
        """Return the time until a temperature is reached, from a start towards a steady temperature."""
        part = log((steady_celsius - start_celsius) / (steady_celsius - celsius))
        return ceil(part * self._cooling.time_constant_counts)


class Protection:
    """Shutdowns of a chip's outputs, by temperature or latch, at any instant since power-up."""

    def __init__(self, junction: Junction, latches: Mapping[Rule, Release]) -> None:
        self.junction = junction
        self.causes: set[Rule] = set()
        """Rules that are violated now."""
        self._latches = latches
        self._latched: set[Rule] = set()
        self._edges: list[tuple[int, bool]] = [(0, False)]
        """Instants when a latch began or ended; the first entry is valid for all earlier instants."""

    def trip(self, counts: int, powered: Mapping[Rule, bool], freed: Mapping[Release, bool]) -> Iterator[Rule]:
        """Update the latches with the conditions from an instant on; yield the rules whose latches trip.

        Args:
            counts: the instant.
            powered: by rule, True if its cause would trip the latch now.
            freed: by release, True if its condition is met now.
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
        """True if a latch keeps the outputs off now."""
        return bool(self._latched)

    def shut_down(self, counts: int) -> bool:
        """Return whether the outputs are shut down at an instant."""
        return self.junction.shut_down(counts) or self._held(counts)

    def reported(self, counts: int) -> bool:
        """Return whether a fault output reports a shutdown at an instant; it does not report a destroyed chip."""
        silent = Release.NEVER in self._latches.values()
        return self.junction.shut_down(counts) or (self._held(counts) and not silent)

    def _held(self, counts: int) -> bool:
        return next((held for since, held in reversed(self._edges) if since <= counts), self._edges[0][1])

    def shutdowns(self, until_counts: int) -> list[tuple[int, int]]:
        """Return the instants since `forget` when a shutdown began (1) or ended (0)."""
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
