"""Where an image's time goes: by function, asleep, with all interrupts off; and how much stack it needs."""

from bisect import bisect_right
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.image import FLASH_START, FlashImage
from steptwin.protocol.timer import COUNTS_PER_SECOND

_GRAINS_PER_SECOND: Final = COUNTS_PER_SECOND * c.GRAINS
_GRAINS_PER_US: Final = _GRAINS_PER_SECOND / 1e6
ELSEWHERE: Final = "(code in RAM)"
UNNAMED: Final = "(no symbol)"


@dataclass(frozen=True, slots=True)
class FunctionTime:
    """Time that a function took, without those that it called and without interrupts."""

    name: str
    time_s: float
    percent: float


@dataclass(frozen=True, slots=True)
class ImageProfile:
    """What an image did with its time and its stack.

    Attributes:
        functions: the functions that took time, the longest first.
        asleep_percent: time in WFI and WFE.
        exceptions_percent: time of the hardware to enter handlers and to return.
        masked_us_max: longest time with PRIMASK or FAULTMASK set, without the time asleep.
        masked_by: the code that began it; empty if there was none.
        stack_used_bytes: most bytes of the main stack that were used.
        stack_bytes: bytes between the variables and the top of the main stack.
        flash_writes: half-words of the flash that were programmed.
        flash_erases: pages that were erased.
    """

    functions: tuple[FunctionTime, ...]
    asleep_percent: float
    exceptions_percent: float
    masked_us_max: float
    masked_by: str
    stack_used_bytes: int
    stack_bytes: int
    flash_writes: int
    flash_erases: int

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def profile_of(chip: Stm32Chip, image: FlashImage) -> ImageProfile:
    """Return the profile of a chip since its power-up."""
    spent = chip.state[c.SPENT : c.SPENT + c.BLOCK_COSTS]
    grains: Counter[str] = Counter()
    for place in np.flatnonzero(spent).tolist():
        name = ELSEWHERE if place == c.BLOCK_COSTS - 1 else _function(image, FLASH_START + 2 * place)
        grains[name] += int(spent[place])
    slept, total = chip.cells[c.SLEPT], chip.cells[c.NOW] - chip.powered_counts * c.GRAINS
    masked, by = chip.cells[c.LONGEST_MASKED], chip.cells[c.LONGEST_MASKED_BY]
    if chip.cells[c.MASKED_AT] != c.NEVER and chip.cells[c.NOW] - chip.cells[c.MASKED_AT] > masked:
        masked, by = chip.cells[c.NOW] - chip.cells[c.MASKED_AT], chip.cells[c.MASKED_BY]
    used, size = chip.stack_used()
    part = 100 / max(total, 1)
    return ImageProfile(
        functions=tuple(
            FunctionTime(name, time / _GRAINS_PER_SECOND, time * part) for name, time in grains.most_common()
        ),
        asleep_percent=slept * part,
        exceptions_percent=max(total - slept - grains.total(), 0) * part,
        masked_us_max=masked / _GRAINS_PER_US,
        masked_by=image.place(by) if masked else "",
        stack_used_bytes=used,
        stack_bytes=size,
        flash_writes=chip.cells[c.FLASH_WRITES],
        flash_erases=chip.cells[c.FLASH_ERASES],
    )


def _function(image: FlashImage, pc: int) -> str:
    number = bisect_right(image.functions, (pc, 1 << 32, "")) - 1
    if number < 0 or pc >= image.functions[number][1]:
        return UNNAMED
    return image.functions[number][2]
