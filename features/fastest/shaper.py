"""Input shapers: a motion is the sum of parts of itself that begin one after the other, so that an oscillation cancels.

Speeds and accelerations of the sum are at most those of the motion, and it begins and ends at rest. The parts of a
shaper for a damped oscillation decay as the oscillation does.

Sources: N. Singer, W. Seering, "Preshaping Command Inputs to Reduce System Vibration", Journal of Dynamic Systems,
Measurement, and Control 112(1), 1990, for ZV; W. Singhose, W. Seering, N. Singer, "Residual Vibration Reduction Using
Vector Diagrams to Generate Shaped Inputs", Journal of Mechanical Design 116(2), 1994, for EI; Klipper's documentation,
"Resonance Compensation", describes MZV in words.
"""

from cmath import exp as turned
from enum import StrEnum
from math import exp, floor, pi, sqrt
from typing import Final, NamedTuple


class Shaper(NamedTuple):
    """Parts of a motion, which add up to 1, and when each begins, rising from 0."""

    parts: tuple[float, ...]
    delays_s: tuple[float, ...]


NO_SHAPER: Final = Shaper((1.0,), (0.0,))


class ShaperKind(StrEnum):
    """A kind of shaper.

    `ZV`, zero vibration, is the shortest, half a period. `MZV`, modified ZV, lasts three quarters of a period: where
    the period is 10 % off, a ninth of the oscillation is left. `EI`, extra insensitive, lasts a whole period and leaves
    at most 5 % of the oscillation at and around the frequency.
    """

    ZV = "zv"
    MZV = "mzv"
    EI = "ei"


_OUTER: Final = 1.0 - 0.5**0.5
EI_LEFT: Final = 0.05
"""Fraction of an undamped oscillation that EI leaves at its frequency, so that it leaves no more beside it."""
_SHAPERS: Final = {
    ShaperKind.ZV: Shaper((0.5, 0.5), (0.0, 0.5)),
    ShaperKind.MZV: Shaper((_OUTER, 1.0 - 2.0 * _OUTER, _OUTER), (0.0, 0.375, 0.75)),
    ShaperKind.EI: Shaper(((1.0 + EI_LEFT) / 4.0, (1.0 - EI_LEFT) / 2.0, (1.0 + EI_LEFT) / 4.0), (0.0, 0.5, 1.0)),
}
"""The kinds for an undamped oscillation, with delays in periods."""


class Oscillation(NamedTuple):
    """An oscillation: the frequency that it would have without damping, and the damping ratio, below 1."""

    frequency_hz: float
    damping: float = 0.0

    @property
    def period_s(self) -> float:
        """The period with its damping."""
        return 1.0 / (self.frequency_hz * sqrt(1.0 - self.damping**2))

    @property
    def decay_s(self) -> float:
        """The rate of decay in 1/s."""
        return 2.0 * pi * self.frequency_hz * self.damping


def shaper_of(kind: ShaperKind, oscillation: Oscillation) -> Shaper:
    """Return the shaper of a kind against an oscillation."""
    parts, periods = _SHAPERS[kind]
    delays_s = tuple(each * oscillation.period_s for each in periods)
    return _whole(
        tuple(part * exp(-oscillation.decay_s * delay_s) for part, delay_s in zip(parts, delays_s, strict=True)),
        delays_s,
    )


def on_milliseconds(shaper: Shaper, oscillation: Oscillation, later_s: float = 0.0) -> Shaper:
    """Return a shaper whose parts begin at whole milliseconds, `later_s` later in all.

    Each part is divided between the milliseconds before and after it, so that both together excite the oscillation as
    the part does. So what cancels goes on to cancel exactly. The frequency must be below 500 Hz.
    """
    turn = complex(oscillation.decay_s, 2.0 * pi / oscillation.period_s) / 1000.0
    parts: dict[int, float] = {}
    for part, delay_s in zip(*shaper, strict=True):
        late_ms = 1000.0 * (delay_s + later_s)
        first_ms = floor(late_ms + _WHOLE_MS)
        wanted, next_one = part * turned(turn * max(late_ms - first_ms, 0.0)), turned(turn)
        second = wanted.imag / next_one.imag
        parts[first_ms] = parts.get(first_ms, 0.0) + wanted.real - second * next_one.real
        if second > _NOTHING:
            parts[first_ms + 1] = parts.get(first_ms + 1, 0.0) + second
    return _whole(tuple(parts.values()), tuple(each / 1000.0 for each in parts))


_WHOLE_MS: Final = 1e-9
"""Time in ms by which a delay may miss its millisecond."""
_NOTHING: Final = 1e-12
"""Largest part that is left out."""


def _whole(parts: tuple[float, ...], delays_s: tuple[float, ...]) -> Shaper:
    total = sum(parts)
    return Shaper(tuple(part / total for part in parts), delays_s)
