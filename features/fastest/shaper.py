"""An input shaper: a motion is the sum of parts of itself that begin one after the other, so that a swing cancels out.

Speeds and accelerations of the sum are at most those of the motion, and it begins and ends at rest.

Source: N. Singer, W. Seering, "Preshaping Command Inputs to Reduce System Vibration", Journal of Dynamic Systems,
Measurement, and Control 112(1), 1990.
"""

from typing import Final, NamedTuple


class Shaper(NamedTuple):
    """Parts of a motion, which add up to 1, and when each begins, rising from 0."""

    parts: tuple[float, ...]
    delays_s: tuple[float, ...]


NO_SHAPER: Final = Shaper((1.0,), (0.0,))

_OUTER: Final = 1.0 - 0.5**0.5


def mzv_shaper(period_s: float) -> Shaper:
    """Return the modified ZV shaper of an undamped swing: three parts within three quarters of its period.

    Where the period is 10 % off, a ninth of the swing is left.
    """
    return Shaper((_OUTER, 1.0 - 2.0 * _OUTER, _OUTER), (0.0, 0.375 * period_s, 0.75 * period_s))
