"""Spread a robot's axes over several boards on one bus, in the order of the joints.

Node ids continue from board to board, so a program that talks to the axes need not know where one board ends.
"""

import re
from collections.abc import Sequence
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import AXES_MAX

_COUNT: Final = re.compile(r"\s*[0-9]{1,4}\s*")


def read_axes_per_board(text: str, axes: int) -> list[int]:
    """Return the number of axes of each board from a text such as `4,2`; raise InputError if it has another form."""
    words = text.split(",")
    if not all(map(_COUNT.fullmatch, words)):
        raise InputError(
            f"axes_per_board={text}: does not list the axes of each board, as in {_listed(_spread([4], axes))}"
        )
    return [int(word) for word in words]


def check_axes_per_board(counts: Sequence[int], axes: int) -> None:
    """Raise InputError unless each board can drive its number of axes and together they are the robot's."""
    given, nearest = _listed(counts), _listed(_spread(counts, axes))
    for count in counts:
        if not 1 <= count <= AXES_MAX:
            limits = f"a board drives 1 to {AXES_MAX} axes, not {count}"
            raise InputError(f"axes_per_board={given}: {limits}; try {nearest}")
    if sum(counts) != axes:
        raise InputError(f"axes_per_board={given}: {sum(counts)} axes in all, but the robot has {axes}; try {nearest}")


def _spread(counts: Sequence[int], axes: int) -> list[int]:
    """Return the nearest valid numbers: each cut to what a board drives, their sum to the robot's axes."""
    nearest: list[int] = []
    for count in [*counts, *[AXES_MAX] * axes]:
        left = axes - sum(nearest)
        if left:
            nearest.append(min(max(count, 1), AXES_MAX, left))
    return nearest


def _listed(counts: Sequence[int]) -> str:
    return ",".join(map(str, counts))
