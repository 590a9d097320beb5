"""A held button: its lease to the microsecond, and that what is over stays so."""

from collections.abc import Callable

import pytest

from steptwin.features.panel.service.commands import Jog, JointJog, ToolJog
from steptwin.features.panel.service.guards import BEAT_S, EXPIRED, LEASE_S, RELEASED, Presses
from steptwin.features.panel.service.messages import RefusedError
from tests.features.panel.service.clock import Clock

JOG = JointJog("th1", 10.0)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def presses(told: list[str], clock: Clock) -> Presses:
    return Presses(told.append, clock)


def refused(presses: Presses, client: str, number: int, jog: Jog = JOG) -> str:
    with pytest.raises(RefusedError) as refusal:
        presses.beat(client, number, jog)
    return str(refusal.value)


def test_a_press_lasts_for_its_lease_after_the_last_beat(clock: Clock, presses: Presses) -> None:
    presses.beat("a", 1, JOG)
    for _ in range(20):
        clock.now_s += BEAT_S
        presses.beat("a", 1, JOG)
    clock.now_s += LEASE_S
    held = presses.present
    assert held is not None
    assert (held.client, held.number, held.jog) == ("a", 1, JOG)
    clock.now_s += 1e-6
    assert presses.present is None
    assert presses.present is not held
    assert refused(presses, "a", 1) == EXPIRED
    presses.beat("a", 2, JOG)
    assert presses.present is not held


ENDS: dict[str, Callable[[Presses, Clock], object]] = {
    RELEASED: lambda presses, _: presses.release("a", 7),
    EXPIRED: lambda _, clock: setattr(clock, "now_s", clock.now_s + 1.0),
    "at the end": lambda presses, _: presses.end("at the end"),
}


@pytest.mark.parametrize("why", ENDS)
def test_a_press_that_is_over_stays_so(clock: Clock, presses: Presses, why: str) -> None:
    """Beats that were held up on their way come after the end."""
    presses.beat("a", 7, JOG)
    ENDS[why](presses, clock)
    for _ in range(3):
        assert refused(presses, "a", 7) == why
        assert presses.present is None
    assert refused(presses, "a", 6) == RELEASED  # an older one, too
    presses.beat("b", 1, JOG)  # each client has its own numbers
    presses.beat("a", 8, JOG)


def test_a_release_that_overtakes_its_beats_counts(presses: Presses) -> None:
    presses.release("a", 3)
    assert refused(presses, "a", 3) == RELEASED
    presses.beat("a", 4, JOG)
    presses.release("a", 3)  # a release that comes twice ends no later press
    assert presses.is_present("a", 4)


def test_a_new_press_ends_the_one_before(presses: Presses) -> None:
    presses.beat("a", 1, JOG)
    first = presses.present
    presses.beat("a", 2, ToolJog("x", 1.0))
    assert first
    assert presses.present is not first
    assert presses.is_present("a", 2)
    assert refused(presses, "a", 1) == RELEASED


def test_a_client_that_is_gone_leaves_nothing(presses: Presses) -> None:
    presses.beat("a", 1, JOG)
    presses.forget("a")
    assert presses.present is None


IN_VAIN = {
    RELEASED: "jog th1: nothing has moved: the button was released before the drives were ready: hold it longer",
    EXPIRED: "jog th1: nothing has moved: the page has fallen silent: press the button again",
}


@pytest.mark.parametrize("why", ENDS)
def test_a_press_that_nobody_served_is_told_once_with_why(
    clock: Clock, presses: Presses, told: list[str], why: str
) -> None:
    presses.beat("a", 6, JOG)
    assert presses.serve() is presses.present
    presses.release("a", 6)
    assert told == []
    presses.beat("a", 7, JOG)
    missed = presses.present
    assert missed is not None
    ENDS[why](presses, clock)
    assert presses.present is None
    assert (missed.number, missed.over) == (7, why)
    assert told == ([IN_VAIN[why]] if why in IN_VAIN else [])


@pytest.mark.parametrize("why", ENDS)
def test_a_release_says_why_the_press_was_over_before(clock: Clock, presses: Presses, why: str) -> None:
    presses.beat("a", 7, JOG)
    held = presses.serve()
    assert held is not None
    assert held.over == ""
    ENDS[why](presses, clock)
    assert presses.present is None
    assert held.over == why
    assert presses.release("a", 7) == (None if why == RELEASED else why)
