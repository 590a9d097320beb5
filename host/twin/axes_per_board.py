"""How a robot's axes are spread over boards on one bus: so many on each, in the order of the joints.

Node ids go on from board to board, so that whoever talks to the axes need not know where one board ends.
"""

import re
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import AXES_MAX

_COUNT: Final = re.compile(r"\s*[0-9]{1,4}\s*")


def read_axes_per_board(text: str, axes: int) -> tuple[int, ...]:
    """Axes of each board, as in `4,2`; InputError unless each board drives them and together they are the robot's."""
    words = text.split(",")
    if not all(map(_COUNT.fullmatch, words)):
        raise InputError(f"--boards {text}: is no list of each board's axes, as in {_listed(_spread([4], axes))}")
    counts = [int(word) for word in words]
    nearest = _listed(_spread(counts, axes))
    for count in counts:
        if not 1 <= count <= AXES_MAX:
            raise InputError(f"--boards {text}: a board of {count} axes, it drives 1 to {AXES_MAX}; try {nearest}")
    if sum(counts) != axes:
        raise InputError(f"--boards {text}: {sum(counts)} axes, and the robot has {axes}; try {nearest}")
    return tuple(counts)


def _spread(counts: list[int], axes: int) -> list[int]:
    """The nearest that there may be: cut to what a board drives, and in the end to what the robot has."""
    nearest: list[int] = []
    for count in [*counts, *[AXES_MAX] * axes]:
        left = axes - sum(nearest)
        if left:
            nearest.append(min(max(count, 1), AXES_MAX, left))
    return nearest


def _listed(counts: list[int]) -> str:
    return ",".join(map(str, counts))
