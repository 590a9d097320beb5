"""Apply one step rule in all methods, so that only timing differs: up at counter + H, down at counter - H."""

from steptwin.bench.pulses.compiled import compiled

THRESHOLD_Q16 = 9 << 12
"""H = 9/16 step."""


@compiled
def counter_at(counter: int, position_q16: int) -> int:
    """Return the counter after a monotone motion from `counter` to a position."""
    away_q16 = position_q16 - (counter << 16)
    if away_q16 >= THRESHOLD_Q16:
        return counter + ((away_q16 - THRESHOLD_Q16) >> 16) + 1
    if away_q16 <= -THRESHOLD_Q16:
        return counter - ((-away_q16 - THRESHOLD_Q16) >> 16) - 1
    return counter
