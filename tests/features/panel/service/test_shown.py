"""From which of the states that a page has shown a command may be asked for: both sides of each limit."""

from collections.abc import Callable

import pytest

from steptwin.features.panel.service.guards import ShownStates
from steptwin.features.panel.service.messages import RefusedError
from tests.features.panel.service.clock import Clock
from tests.messages import refused_with


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def shown(clock: Clock) -> ShownStates:
    return ShownStates(clock)


def refusal(require: Callable[[int | None], float], number: int | None) -> str:
    with pytest.raises(RefusedError) as refused:
        require(number)
    return refused_with(str(refused.value))


def test_a_state_counts_for_a_second(clock: Clock, shown: ShownStates) -> None:
    number = shown.add()
    clock.now_s += 1.0
    assert shown.require(number) == 100.0
    clock.now_s += 1e-6
    too_late = "too late: the page had shown the machine of 1.0 s ago, more than 1 s: ask again"
    assert refusal(shown.require, number) == too_late
    assert shown.require(shown.add()) == clock.now_s


@pytest.mark.parametrize("number", [None, -1, 1, 1 << 70])
def test_what_was_never_shown_does_not_count(shown: ShownStates, number: int | None) -> None:
    not_yet = "the page had not shown the machine yet: look, and ask again"
    assert refusal(shown.require, 0) == not_yet
    shown.add()
    assert refusal(shown.require, number) == not_yet
    assert shown.require(0) == 100.0


def test_what_was_shown_before_an_event_is_void_but_young(shown: ShownStates) -> None:
    before = shown.add()
    shown.void("an emergency stop came")
    after = shown.add()
    void = "void, since an emergency stop came after it was asked for: look, and ask again"
    assert refusal(shown.require, before) == void
    assert shown.require_young(before) == 100.0
    assert shown.require(after) == 100.0
    shown.void("the machine was reset")
    assert (
        refusal(shown.require, after) == "void, since the machine was reset after it was asked for: look, and ask again"
    )


def test_states_from_long_ago_are_too_late(clock: Clock, shown: ShownStates) -> None:
    first = shown.add()
    for _ in range(10_000):
        clock.now_s += 0.015
        newest = shown.add()
    refusal(shown.require, first)
    assert shown.require(newest) == clock.now_s
