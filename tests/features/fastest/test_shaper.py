"""Shaped motions: the swing that they leave, and the stops that windows of a chain's parts make cheapest."""

import cmath
from itertools import combinations, pairwise

import numpy as np
import pytest

from steptwin.features.fastest.averaged import Averaged
from steptwin.features.fastest.shaper import NO_SHAPER, Oscillation, Shaper, ShaperKind, on_milliseconds, shaper_of
from steptwin.features.fastest.worthwhile_stops import _cheapest
from steptwin.host.common.arrays import FloatArray

PERIOD_S = 0.3


def law(shaper: Shaper) -> Averaged:
    """Return a way of 3 with ramps, averaged over 0.02 s and shaped."""
    squares = np.array([0.0, 16.0, 16.0, 0.0])
    return Averaged.of(np.array([0.0, 1.0, 2.0, 3.0]), squares, 0.02, shaper=shaper)


def mzv(period_s: float) -> Shaper:
    """Return the MZV shaper of an undamped oscillation."""
    return shaper_of(ShaperKind.MZV, Oscillation(1.0 / period_s))


def swing_left(shaper: Shaper, period_s: float = PERIOD_S) -> float:
    """Return how far an undamped oscillator swings when its base has come to rest, by the sum of its accelerations."""
    made = law(shaper)
    t_s = np.arange(0.0, made.duration_s, 1e-4)
    speed = made.at(t_s)[1]
    omega = 2.0 * np.pi / period_s
    turned = np.exp(-1j * omega * t_s[:-1])
    return float(abs((np.diff(speed) * turned).sum()) / omega)


def test_a_shaped_motion_leaves_no_swing_of_its_period_and_little_of_one_nearby() -> None:
    unshaped = swing_left(NO_SHAPER)
    assert unshaped > 0.02
    assert swing_left(mzv(PERIOD_S)) < 0.005 * unshaped
    for part in (0.9, 1.1):
        assert swing_left(mzv(part * PERIOD_S)) < 0.15 * unshaped


def test_a_shaped_motion_keeps_the_highest_speed_and_acceleration_and_ends_at_rest() -> None:
    plain, shaped = law(NO_SHAPER), law(mzv(PERIOD_S))
    assert shaped.duration_s == pytest.approx(plain.duration_s + 0.75 * PERIOD_S, abs=0.001)
    highest = []
    for each in (plain, shaped):
        speed = each.at(np.arange(0.0, each.duration_s, 1e-3))[1]
        highest.append((speed.max(), np.abs(np.diff(speed)).max()))
    assert highest[1][0] <= highest[0][0] + 1e-9
    assert highest[1][1] <= highest[0][1] + 1e-9
    value, speed = shaped.at(np.array([0.0, shaped.duration_s]))
    assert value.tolist() == [0.0, 3.0]
    assert speed == pytest.approx([0.0, 0.0], abs=1e-9)


def left(shaper: Shaper, oscillation: Oscillation) -> float:
    """Return the fraction of an oscillation that a shaper leaves, just after its last part."""
    turn = complex(oscillation.decay_s, 2.0 * cmath.pi / oscillation.period_s)
    last_s = shaper.delays_s[-1]
    return abs(sum(part * cmath.exp(turn * (at_s - last_s)) for part, at_s in zip(*shaper, strict=True)))


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("hz", [3.8, 45.0, 150.0])
@pytest.mark.parametrize("kind", ShaperKind)
def test_what_cancels_at_any_time_cancels_at_whole_milliseconds(kind: ShaperKind, hz: float, damping: float) -> None:
    oscillation = Oscillation(hz, damping)
    exact = shaper_of(kind, oscillation)
    for later_s in (0.0, 0.0033):
        made = on_milliseconds(exact, oscillation, later_s)
        assert [1000.0 * each for each in made.delays_s] == [round(1000.0 * each) for each in made.delays_s]
        assert min(made.parts) > 0.0
        assert sum(made.parts) == pytest.approx(1.0, abs=1e-15)
        mean_s, exact_s = (sum(part * at_s for part, at_s in zip(*each, strict=True)) for each in (made, exact))
        assert mean_s - later_s == pytest.approx(exact_s, abs=1e-4)
        if kind is ShaperKind.EI:
            assert left(made, oscillation) <= left(exact, oscillation)
        else:
            assert left(made, oscillation) < 1e-12


@pytest.mark.parametrize(
    ("kind", "periods", "at_20_percent_less", "at_20_percent_more"),
    [("zv", 0.5, 0.309, 0.309), ("mzv", 0.75, 0.233, 0.143), ("ei", 1.0, 0.050, 0.050)],
)
def test_what_each_kind_leaves_beside_its_frequency(
    kind: str, periods: float, at_20_percent_less: float, at_20_percent_more: float
) -> None:
    shaper = shaper_of(ShaperKind(kind), Oscillation(40.0))
    assert shaper.delays_s[-1] == pytest.approx(periods / 40.0)
    assert left(shaper, Oscillation(40.0)) == pytest.approx(0.05 if kind == "ei" else 0.0, abs=1e-12)
    beside = [left(shaper, Oscillation(part * 40.0)) for part in (0.8, 1.2)]
    assert beside == pytest.approx([at_20_percent_less, at_20_percent_more], abs=0.001)


def lasting_s(windows: list[FloatArray], begin: int, end: int) -> float:
    """Return how long parts last from stop to stop: the first windows, then what each further part adds."""
    size = min(end - begin, 3)
    found = float(windows[size - 1][begin])
    return found + sum(float(windows[2][i - 2] - windows[1][i - 2]) for i in range(begin + 3, end))


@pytest.mark.parametrize("seed", range(8))
def test_no_other_choice_of_stops_takes_less_time(seed: int) -> None:
    random = np.random.default_rng(seed)
    parts = 7
    one = random.uniform(0.1, 0.3, parts)
    two = np.append(one[:-1] + one[1:] + random.uniform(-0.04, 0.03, parts - 1), np.inf)
    three = np.append(two[:-2] + one[2:] + random.uniform(-0.04, 0.03, parts - 2), [np.inf, np.inf])
    windows = [one, two, three]

    def whole_s(stops: tuple[int, ...]) -> float:
        bounds = [0, *(stop + 1 for stop in stops), parts]
        return sum(lasting_s(windows, begin, end) for begin, end in pairwise(bounds))

    corners = range(parts - 1)
    best = min(whole_s(stops) for count in range(parts) for stops in combinations(corners, count))
    assert whole_s(tuple(_cheapest(list(corners), windows))) == pytest.approx(best, abs=1e-12)
