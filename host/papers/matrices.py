"""Show homogeneous transforms as the papers print them."""

from collections.abc import Sequence

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.frames import link_frames, tool_frames
from steptwin.host.robots.robot import Robot

COLUMNS = ("row", "n", "o", "a", "p mm")
"""The columns of a transform: the tool's axes and its position."""


def matrix_rows(names: Sequence[str], matrices: Sequence[FloatArray]) -> list[list[str]]:
    """Return a row of texts for each row of each 4 by 4 matrix but the last one, which is always 0 0 0 1."""
    return [
        [f"{name}, {axis}", *(f"{element:z.6f}" for element in row[:3]), f"{row[3]:z.3f}"]
        for name, matrix in zip(names, matrices, strict=True)
        for axis, row in zip("xyz", matrix[:3].tolist(), strict=True)
    ]


def link_rows(robot: Robot, joints: Sequence[float]) -> list[list[str]]:
    """Return the rows of every link's transform at a joint position, T1, T2 ..., and of their product."""
    kinematics, position = make_kinematics(robot), np.array([joints])
    links = [link[0] for link in link_frames(kinematics, position)]
    names = [f"T{i}" for i in range(1, len(links) + 1)]
    return matrix_rows([*names, f"0T{len(links)}"], [*links, tool_frames(kinematics, position)[0]])
