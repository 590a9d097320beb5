"""Values that are drawn: what each kind gives, and what is refused."""

from random import Random
from typing import Any

import pytest

from steptwin.features.campaigns.values import AtPart, PlannedAt, drawn, read_template
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from tests.messages import refusing


@pytest.mark.parametrize(
    ("value", "all_values"),
    [
        (3, {3}),
        ({"choose": ["a", 2, True]}, {"a", 2, True}),
        ({"whole": [-1, 2]}, {-1, 0, 1, 2}),
        ({"any": "joint"}, {"th1", "th2", "d3", "th4"}),
        ({"choose": [{"whole": [1, 2]}, 7]}, {1, 2, 7}),
    ],
)
def test_each_value_is_drawn(teaching: Robot, value: object, all_values: set[object]) -> None:
    template = read_template(value)
    assert {drawn(template, Random(seed), teaching) for seed in range(100)} == all_values


@pytest.mark.parametrize(("kind", "lower", "upper"), [("uniform", -2.0, 3.0), ("log_uniform", 0.001, 10.0)])
def test_numbers_fill_their_range(teaching: Robot, kind: str, lower: float, upper: float) -> None:
    template = read_template({kind: [lower, upper]})
    numbers = sorted(drawn(template, Random(seed), teaching) for seed in range(500))
    assert lower <= numbers[0] <= numbers[-1] <= upper
    middle = (lower + upper) / 2 if kind == "uniform" else (lower * upper) ** 0.5
    assert numbers[100] < middle < numbers[400]
    assert [float(f"{number:.6g}") for number in numbers] == numbers


def test_parts_of_the_motion_are_placed_later(teaching: Robot) -> None:
    template = read_template({"at_s": {"part_of_motion": [0.25, 0.25]}, "value": {"on_the_way": [0.5, 0.5]}})
    assert drawn(template, Random(0), teaching) == {"at_s": AtPart(0.25), "value": PlannedAt(0.5)}


def test_values_in_tables_and_lists_are_drawn(teaching: Robot) -> None:
    template = read_template({"fault": [{"do": "slip", "n": {"whole": [4, 4]}}, {"joint": {"any": "joint"}}]})
    found = drawn(template, Random(1), teaching)
    assert found["fault"][0] == {"do": "slip", "n": 4}
    assert found["fault"][1]["joint"] in teaching.joint_names


@pytest.mark.parametrize(
    "value",
    [
        {"choose": []},
        {"uniform": [1]},
        {"uniform": [2, 1]},
        {"log_uniform": [0, 1]},
        {"whole": [0.5, 1]},
        {"any": "joints"},
        {"part_of_motion": [0, 1.1]},
        [1, {"b": {"whole": "x"}}],
    ],
    ids=str,
)
def test_wrong_draws_are_refused(value: Any) -> None:
    with refusing(InputError):
        read_template(value)
