"""The step rules of controllers: both sides of their limits."""

import numpy as np
import pytest

from steptwin.features.captures.step_rules import CONTROLLERS, ESTIMATES, controller
from steptwin.host.common.errors import InputError
from tests.messages import refusing

BY_NAME = {rule.name: rule for rule in (*ESTIMATES, *CONTROLLERS.values())}


@pytest.mark.parametrize(
    ("name", "position", "right", "wrong"),
    [
        ("klipper", 10.4, [10], [9, 11]),
        ("klipper", 10.505, [10, 11], [9]),
        ("grbl", -3.6, [-4], [-3, -5]),
        ("steptwin", 10.56, [10, 11], [9, 12]),
        ("steptwin", 10.58, [11], [10, 12]),
        ("step below", 10.9, [10], [11]),
        ("step below", 10.999, [11], [10]),
        ("step above", -10.9, [-10], [-11]),
        ("other", 10.4, [10, 11], [9, 12]),
        ("other", 2800.0, [2800], [2799, 2801]),
    ],
)
def test_counts_at_standstill(name: str, position: float, right: list[int], wrong: list[int]) -> None:
    rule = BY_NAME[name]
    place = np.array([position])
    assert [bool(rule.rests(np.array([float(count)]), place)[0]) for count in right] == [True] * len(right)
    assert [bool(rule.rests(np.array([float(count)]), place)[0]) for count in wrong] == [False] * len(wrong)


def test_counts_at_turning_points_may_be_further_away() -> None:
    """Where a step below is a whole step, either may be right: rounding decides."""
    place = np.array([2800.0])
    assert [bool(BY_NAME["step below"].turns(np.array([c]), place)[0]) for c in (2798.0, 2799.0, 2800.0)] == [0, 1, 1]
    assert [bool(BY_NAME["grbl"].turns(np.array([c]), place)[0]) for c in (2798.9, 2798.95)] == [False, True]


def test_a_step_of_klipper_is_early_by_half_of_its_interval_at_most() -> None:
    rule = CONTROLLERS["klipper"]
    assert [rule.half_at(rate_hz, 0.0) for rate_hz in (0.0, 10e3, 50e3)] == pytest.approx([0.56, 0.81, 1.06])


def test_chords_count_on_curved_paths_only() -> None:
    rule = CONTROLLERS["grblhal"]
    assert [rule.half_at(1e3, steps) for steps in (0.0, 400.0)] == pytest.approx([1.2, 2.0])


def test_each_controller_says_where_its_rule_is_written() -> None:
    assert list(CONTROLLERS) == ["klipper", "grbl", "grblhal", "marlin", "linuxcnc", "other"]
    assert all(rule.source and rule.says for rule in CONTROLLERS.values())
    assert [name for name, rule in CONTROLLERS.items() if not rule.both_edges] == ["grbl", "linuxcnc"]


def test_another_controller_is_refused() -> None:
    with refusing(InputError):
        controller("smoothie")
