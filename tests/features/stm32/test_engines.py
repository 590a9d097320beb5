"""The compiled chip does what plain Python does, to the count."""

from pathlib import Path
from typing import Final

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.image import read_image
from tests.features.stm32.examples import EXAMPLES

_COUNTS: Final = 72_000 * 60


def _made(path: Path, *, compiled: bool) -> tuple[list[int], list[int], list[int]]:
    """Return the edges of an example, and the chip's state beside what belongs to its process."""
    image = read_image(path)
    chip = Stm32Chip(image.segments, image.vectors, main=image.address_of("main"), compiled=compiled)
    for pin in range(16):
        chip.watch(pin, released=False)
    counts, pins = list[int](), list[int]()
    while chip.now_counts < _COUNTS:
        chip.run(_COUNTS)
        at, which = chip.take_edges()
        counts += at.tolist()
        pins += which.tolist()
    state = [*chip.state[c.NOW : c.EDGES].tolist(), *chip.state[c.COUNTER : c.KNOWN_SIZE].tolist()]
    chip.close()
    return counts, pins, state


@pytest.mark.slow  # numba compiles for half a minute
@pytest.mark.parametrize("name", ["compare_stepper", "systick_stepper"])
def test_plain_python_and_numba_make_the_same_edges_and_end_in_the_same_state(name: str) -> None:
    pytest.importorskip("numba")
    path = EXAMPLES / f"{name}.elf"
    reference = _made(path, compiled=False)
    assert len(reference[0]) > 70
    assert _made(path, compiled=True) == reference
