"""The kernel keeps the widths that it promises, whatever it is told, and a promise too narrow is found."""

import pytest

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import python_kernel
from steptwin.emulator.kernel_c.promises import checked_kernel, keep_promise
from steptwin.emulator.kernel_c.ranges import Range, promised
from tests.controller.motion.kernel_rig import KernelRig
from tests.emulator.kernel_c.scenarios import play, scenario


def test_promises_are_kept_and_checking_changes_nothing() -> None:
    events: set[int] = set()
    for seed in range(60):
        found = play(checked_kernel(), scenario(seed), 1 << 20)
        assert found == play(python_kernel(), scenario(seed), 1 << 20)
        events |= {event for part in found if isinstance(part, list) for _, _, event in part}
    assert events == {k.EVENT_FINISHED, k.EVENT_UNDERRUN, k.EVENT_LATE_STEP}  # the scenarios have all that there is


@pytest.mark.parametrize(
    ("width", "low", "high"), [("U5", 0, 31), ("I32", -(1 << 31), (1 << 31) - 1), ("Q30", -(1 << 30), 1 << 30)]
)
def test_both_ends_of_a_promise(width: str, low: int, high: int) -> None:
    assert promised(width) == Range(low, high)
    assert [keep_promise(value, width, "x") for value in (low, high)] == [low, high]
    for value in (low - 1, high + 1):
        with pytest.raises(OverflowError, match=f"x is {value}, but {width} promises {low} to {high}"):
            keep_promise(value, width, "x")


@pytest.mark.parametrize(("field", "value"), [(k.MICROSTEPS, 32), (k.TAIL_VELOCITY, 1 << 31)])
def test_a_cell_that_breaks_its_promise_is_found_where_it_is_used(field: int, value: int) -> None:
    rig = KernelRig(checked_kernel())
    rig.set(field, value)
    with pytest.raises(OverflowError, match=str(value)):
        rig.push(100, 0, 10)
