"""The instant of the next event, by the instants of all devices' next ones."""

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer


@integer
def next_due(s: Cells) -> None:
    """Find the next event."""
    due = c.NEVER
    for device in range(c.DEVICES):
        due = min(due, s[c.DUES + device])
    s[c.DUE] = due
