"""Faults that no machine could have are refused."""

from collections.abc import Callable

import pytest

from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds.machine import BoardTemperature, Slip, Supply
from steptwin.features.faults.kinds.wiring import StuckSwitch
from steptwin.protocol.cia402 import DigitalInput
from tests.messages import refusing


@pytest.mark.parametrize(
    ("make", "valid", "invalid"),
    [
        (Supply, (0, 65_535), (-1, 65_536)),
        (BoardTemperature, (-32_768, 32_767), (-32_769, 32_768)),
        (lambda bits: StuckSwitch(0, DigitalInput(bits), closed=None), (1, 2, 4), (0, 3, 1 << 18)),
    ],
)
def test_what_is_impossible_is_refused(
    make: Callable[[int], Fault], valid: tuple[int, ...], invalid: tuple[int, ...]
) -> None:
    for value in valid:
        make(value)
    for value in invalid:
        with refusing(ValueError):
            make(value)


def test_only_whole_cycles_are_a_slip() -> None:
    for full_steps in (-4, 4, 400):
        Slip(0, full_steps)
    for full_steps in (0, 1, -6):
        with refusing(ValueError):
            Slip(0, full_steps)
