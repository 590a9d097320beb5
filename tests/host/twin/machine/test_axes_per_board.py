"""Axes on several boards: which numbers are valid, and which ones an error message offers instead of the others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.boards import board_configs, check_axes_per_board
from steptwin.host.twin.machine.machine_options import MachineOptions, read_axes_per_board
from tests.messages import refusing


def checked(text: str, axes: int) -> tuple[int, ...]:
    """Return the text's numbers; raise InputError if they are not valid."""
    counts = read_axes_per_board(text)
    check_axes_per_board(counts, axes)
    return tuple(counts)


@pytest.mark.parametrize(
    ("text", "axes", "counts"),
    [("6", 6, (6,)), ("4,2", 6, (4, 2)), (" 1, 1 ,4", 6, (1, 1, 4)), ("8", 8, (8,)), ("8,1", 9, (8, 1))],
)
def test_valid_numbers(text: str, axes: int, counts: tuple[int, ...]) -> None:
    assert checked(text, axes) == counts


@pytest.mark.parametrize(
    "text",
    [
        "4,3",
        "4,1",
        "9",
        "0,6",
        "",
        "4,",
        "-1,7",
        "9" * 5000,
    ],
)
def test_invalid_numbers(text: str) -> None:
    with refusing(InputError):
        checked(text, 6)


@pytest.mark.slow
@given(st.lists(st.integers(0, 20), min_size=1, max_size=6), st.integers(1, 8))
def test_the_numbers_offered_are_valid(counts: list[int], axes: int) -> None:
    text = ",".join(map(str, counts))
    try:
        taken = checked(text, axes)
    except InputError as error:
        taken = checked(str(error).rpartition("try ")[2], axes)
    assert sum(taken) == axes
    assert set(taken) <= set(range(1, 9))


def test_switches_and_positions_go_to_their_boards() -> None:
    """Axis numbers begin at 0 on each board; node ids continue from board to board."""
    robot = load_robot("warehouse-scara")
    (whole,) = board_configs(robot)
    first, second = board_configs(robot, MachineOptions(axes_per_board=[4, 2]))
    assert (first.axis_count, first.first_node_id) == (4, 0x10)
    assert (second.axis_count, second.first_node_id) == (2, 0x14)
    assert first.start_substeps + second.start_substeps == whole.start_substeps
    of_both = [*((switch.axis, switch) for switch in first.switches), *((s.axis + 4, s) for s in second.switches)]
    assert [(axis, switch.input, switch.from_substeps, switch.to_substeps) for axis, switch in of_both] == [
        (switch.axis, switch.input, switch.from_substeps, switch.to_substeps) for switch in whole.switches
    ]
    with refusing(InputError):
        board_configs(robot, MachineOptions(axes_per_board=[4, 3]))
