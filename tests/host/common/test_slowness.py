"""A computer that is too slow is told of once, and again each time the time lost has doubled."""

from steptwin.host.common.processes import ClockStood, Slowness


def test_it_is_told_at_100_ms_and_then_at_the_double() -> None:
    slowness = Slowness()
    told = [ms for ms in (0, 99, 100, 150, 199, 200, 399, 400) if slowness.worth_telling(ClockStood(1, ms, ms))]
    assert told == [100, 200, 400]


def test_in_words() -> None:
    assert str(ClockStood(1, 120.0, 120.0)) == (
        "computer too slow: the board's clock stood once, 0.12 s in all, longest 120 ms"
    )
    assert str(ClockStood(21597.0, 273_620.0, 916.0)) == (
        "computer too slow: the board's clock stood 21597 times, 273.62 s in all, longest 916 ms"
    )
