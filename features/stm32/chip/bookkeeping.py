"""Accesses to what is not modelled: each place with the first instruction that went there."""

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.libunicorn import read_register
from steptwin.features.stm32.chip.nvic import PC


@integer
def note_strange(s: Cells, address: int, kind: int) -> None:
    """Count an access whose effect is not modelled."""
    for i in range(s[c.STRANGE_COUNT]):
        place = c.STRANGE + c.STRANGE_FIELDS * i
        if s[place] == address and s[place + 1] == kind:
            s[place + 2] += 1
            return
    if s[c.STRANGE_COUNT] == c.STRANGE_CAPACITY:
        s[c.STRANGE_LOST] += 1
        return
    place = c.STRANGE + c.STRANGE_FIELDS * s[c.STRANGE_COUNT]
    s[place], s[place + 1], s[place + 2], s[place + 3] = address, kind, 1, read_register(s, PC)
    s[c.STRANGE_COUNT] += 1
