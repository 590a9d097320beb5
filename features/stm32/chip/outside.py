"""Questions to devices outside of the chip, which plain Python answers: one call for both forms of the chip."""

import ctypes
from functools import cache
from typing import Any, Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells

SELECT, TRANSFER, START, WRITE, READ, STOP = range(6)
"""Questions: a pin has changed; SPI: a byte or word; I2C: address with its read bit, a byte out, a byte in, the end."""
ANSWER: Final = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
"""The type of what answers: question, number of the peripheral or pin, value."""


@cache
def _function(address: int) -> Any:
    return ANSWER(address)


def ask(s: Cells, question: int, number: int, value: int) -> int:
    """Return the answer of the world outside."""
    answer: int = _function(s[c.ANSWERS])(question, number, value)
    return answer


def address_of(answer: Any) -> int:
    """Return the address of what answers, for `ANSWERS`; it must be kept as long as that stands there."""
    return ctypes.cast(answer, ctypes.c_void_p).value or 0


NOBODY: Final = ANSWER(lambda question, _number, _value: 0xFFFF if question == TRANSFER else 0)
"""What answers without devices: SPI's input is pulled up, and nobody acknowledges."""
