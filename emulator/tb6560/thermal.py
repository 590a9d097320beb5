"""How hot the chip becomes, and the shutdown that its Protect pin tells of.

The model is one thermal resistance and one thermal capacity between the junction and the ambient air: with the power P
dissipated since then, the junction goes exponentially to ambient + P R, with the time constant R C. P is I^2 Ron of
both phases, Ron = 0.6 ohm being the typical upper and lower transistor together (pages 6 to 8): in microstep modes the
currents are a cosine and a sine, which makes I_peak^2 Ron; in two-phase mode both are full, which makes twice as much.

R = 25 K/W without a heat sink follows from 5 W that may be dissipated at 25 degC, where 150 degC is the limit (pages 6
to 8). The capacity is not in the datasheet: 4 J/K is assumed, 10 g of copper and plastic.

At 170 degC (170 +- 20, pages 6 to 8) the outputs switch off and Protect goes low. The datasheet gives a hysteresis of
20 K and names no latch; the model is the stricter reading: off until RESET is low with the junction at 150 degC or
below.
"""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, exp, floor, log
from operator import attrgetter
from typing import Final, NamedTuple

COUNTS_PER_SECOND: Final = 72_000_000

SHUTDOWN_CELSIUS: Final = 170
HYSTERESIS_K: Final = 20
ON_RESISTANCE_OHM: Final = 0.6


@dataclass(frozen=True, slots=True)
class Cooling:
    """What takes the chip's heat away; the default is the bare package in still air."""

    resistance_k_per_w: float = 25.0
    capacity_j_per_k: float = 4.0
    ambient_celsius: float = 25.0

    @property
    def time_constant_counts(self) -> float:
        """In which 63 % of a change of temperature are over."""
        return self.resistance_k_per_w * self.capacity_j_per_k * COUNTS_PER_SECOND


class _Span(NamedTuple):
    """From an instant on the junction goes from one temperature towards another."""

    from_counts: int
    start_celsius: float
    steady_celsius: float
    shut_down: bool


class Junction:
    """The junction's temperature at any instant since power-up, when it was at ambient."""

    def __init__(self, cooling: Cooling) -> None:
        self._cooling = cooling
        self._power_w = 0.0
        self._spans = [_Span(0, cooling.ambient_celsius, cooling.ambient_celsius, False)]

    def heat(self, counts: int, power_w: float) -> None:
        """From an instant on, the outputs would dissipate this power if they were not shut down."""
        self._power_w = power_w
        self._begin(counts, self.shut_down(counts))

    def release(self, counts: int) -> None:
        """RESET is low: end a shutdown, unless it is still too hot."""
        if self.shut_down(counts) and self.celsius(counts) <= SHUTDOWN_CELSIUS - HYSTERESIS_K:
            self._begin(counts, shut_down=False)

    def celsius(self, counts: int) -> float:
        """The temperature at an instant."""
        span = self._span(counts)
        left = exp(-(counts - span.from_counts) / self._cooling.time_constant_counts)
        return span.steady_celsius + (span.start_celsius - span.steady_celsius) * left

    def shut_down(self, counts: int) -> bool:
        """Whether the outputs are shut down at an instant."""
        return self._span(counts).shut_down

    def shutdown_not_before(self, counts: int, power_max_w: float) -> int | None:
        """Before when the outputs cannot be shut down, seen from an instant, by no more than a power.

        None: never; also while they are shut down.
        """
        steady_celsius = self._cooling.ambient_celsius + power_max_w * self._cooling.resistance_k_per_w
        if self.shut_down(counts) or steady_celsius <= SHUTDOWN_CELSIUS:
            return None
        part = log((steady_celsius - self.celsius(counts)) / (steady_celsius - SHUTDOWN_CELSIUS))
        return counts + floor(part * self._cooling.time_constant_counts)

    def forget(self, counts: int) -> None:
        """Everything before an instant."""
        del self._spans[: max(self._at(counts), 0)]

    def shutdowns(self, until_counts: int) -> list[tuple[int, int]]:
        """As far as it is not forgotten: when the outputs were shut down, 1, and when they came back, 0."""
        known = [span for span in self._spans if span.from_counts <= until_counts]
        return [
            (now.from_counts, int(now.shut_down)) for last, now in pairwise(known) if now.shut_down != last.shut_down
        ]

    def _span(self, counts: int) -> _Span:
        return self._spans[max(self._at(counts), 0)]

    def _at(self, counts: int) -> int:
        """The index of the span at an instant, -1 before the first."""
        return bisect_right(self._spans, counts, key=attrgetter("from_counts")) - 1

    def _begin(self, counts: int, shut_down: bool) -> None:
        start_celsius = self.celsius(counts)
        while self._spans[-1].from_counts > counts:  # a shutdown that was to come if all had stayed as it was
            self._spans.pop()
        power_w = 0.0 if shut_down else self._power_w
        steady_celsius = self._cooling.ambient_celsius + power_w * self._cooling.resistance_k_per_w
        self._spans.append(_Span(counts, start_celsius, steady_celsius, shut_down))
        if steady_celsius > SHUTDOWN_CELSIUS:
            part = log((steady_celsius - start_celsius) / (steady_celsius - SHUTDOWN_CELSIUS))
            at_counts = counts + ceil(part * self._cooling.time_constant_counts)
            self._spans.append(_Span(at_counts, SHUTDOWN_CELSIUS, self._cooling.ambient_celsius, True))
