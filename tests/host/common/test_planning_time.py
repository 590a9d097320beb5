"""Planning ends after the processor time that it has, with a sentence that names the step."""

import re
from collections.abc import Iterator
from contextvars import copy_context
from itertools import count
from threading import Thread

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import (
    PlanningTimeError,
    check_planning_time,
    in_planning_time,
    plan_within,
    planning_step,
)


class Clock:
    """A clock that each look moves on by a second."""

    def __init__(self) -> None:
        self._looks: Iterator[int] = count()

    def __call__(self) -> float:
        return float(next(self._looks))


@in_planning_time()
def work(rounds: int, *, hides: bool = False) -> int:
    """Look at the time as often as asked; with `hides` an error of input is swallowed."""
    for _ in range(rounds):
        with planning_step("step 7 (go pick)"):
            try:
                check_planning_time()
            except InputError:
                if not hides:
                    raise
    return rounds


def test_what_ends_in_time_is_returned() -> None:
    with plan_within(10, Clock()):
        assert work(9) == 9


def test_the_error_names_the_step_and_the_time() -> None:
    with plan_within(10, Clock()), pytest.raises(PlanningTimeError) as raised:
        work(10)
    assert str(raised.value) == (
        "step 7 (go pick): is not planned after 10 s of processor time: make it simpler or shorter, or give it more"
        " time, such as plan_within=20"
    )
    assert raised.value.exit_code == 2


def test_blocks_share_the_time_and_other_work_does_not_count() -> None:
    clock = Clock()
    with plan_within(10, clock):
        assert work(4) == 4  # 5 s, with the look at its end
        for _ in range(100):
            clock()
        assert work(4) == 4
        with pytest.raises(PlanningTimeError):
            work(1)


def test_nothing_hides_that_the_time_is_over() -> None:
    with plan_within(10, Clock()), pytest.raises(PlanningTimeError, match=r"^step 7 \(go pick\): "):
        work(20, hides=True)


def test_another_error_after_the_time_does_not_hide_it_either() -> None:
    @in_planning_time()
    def wrong() -> None:
        for _ in range(20):
            try:
                check_planning_time()
            except InputError as error:
                raise InputError("no value passes") from error

    with plan_within(10, Clock()), pytest.raises(PlanningTimeError, match=r"^the motion: is not planned after 10 s"):
        wrong()


def test_without_a_bound_around_each_call_has_the_usual_one() -> None:
    assert work(1000) == 1000
    check_planning_time()  # nothing is planned: no bound


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan")])
def test_a_bound_is_above_0(seconds: float) -> None:
    told = re.escape(f"plan_within={seconds:g}: is not above 0")
    with pytest.raises(InputError, match=f"^{told}$"), plan_within(seconds):
        pass


def test_a_thread_with_the_context_of_another_one_has_its_own_time() -> None:
    """Its processor time begins at 0 too, so the clock of another thread says nothing about it."""
    done: list[int] = []
    with plan_within(1, Clock()):
        context = copy_context()
        thread = Thread(target=lambda: context.run(lambda: done.append(work(50))))
        thread.start()
        thread.join()
    assert done == [50]
