"""Shaped motions: the swing that they leave, and the stops that windows of a chain's parts make cheapest."""

from itertools import combinations, pairwise

import numpy as np
import pytest

from steptwin.features.fastest.averaged import Averaged
from steptwin.features.fastest.shaper import NO_SHAPER, Oscillation, Shaper, ShaperKind, shaper_of
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
