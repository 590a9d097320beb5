"""The warehouse robot pulls a drawer 180 mm out of its shelf: straight, at constant attitude, against y.

Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018: start, distance and 10 s are the paper's, the ramps of 2 s are assumed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from host.errors import InputError
from host.jobs.job import Job
from host.jobs.options import Range, number, parse_options
from host.kinematics import Elbow, WarehouseScara
from host.laws import TrapezoidalLaw
from host.robot import Robot
from host.trajectory import FloatArray

START_DEG: Final = (0.0, 60.0, 30.0)
"""th1, th2, th3 where the hand has locked onto the drawer, with the elbow to the right."""

TRAVEL_Y_MM: Final = -180.0

_PATH_CHECKS: Final = 181
"""Points of the path asked for reach before anything moves: one each mm."""


@dataclass(frozen=True, slots=True)
class DrawerPullOptions:
    """The elbow's side, the time law, and where lift and slides stand meanwhile."""

    elbow: Elbow = Elbow.RIGHT
    duration_s: float = number(10.0, 0.002, 3600.0, "s")
    ramp_s: float = number(2.0, 0.001, 1800.0, "s")
    sx_mm: float = number(0.0, -np.inf, np.inf, "mm")
    sz_mm: float = number(0.0, -np.inf, np.inf, "mm")
    L1_mm: float = number(100.0, -np.inf, np.inf, "mm")
