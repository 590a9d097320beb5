"""The warehouse robot's drawer pull without a drawer: `pull-line` moves the hand as if to pull one out.

180 mm straight along -y in 10 s, at constant attitude. Start, distance and duration are the paper's, the ramps of 2 s
are assumed.

Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019(05),
DOI 10.3969/j.issn.1009-9492.2019.05.018.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.papers.scaling import in_reach_at_most, with_elbow
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import joint_position, number
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.tool_move import tool_move
from steptwin.host.planning.paths import StraightLine
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot

KIND: Final = "warehouse-scara"
"""Kind of mechanism with this job."""
LOCKED_DEG: Final = (0.0, 60.0, 30.0)
"""th1, th2, th3 with the hand locked onto a drawer, elbow on the right."""

TRAVEL_MM: Final = 180.0
REACH_MM: Final = 350.0
"""Travel of the drawer, and reach of the paper's arm from shoulder to wrist; a smaller arm pulls less."""


COMPARTMENTS: Final = 3
"""Number of the drawer's compartments, which come out one after another in the paper's figure 7; equal lengths are
assumed.
"""


@dataclass(frozen=True, slots=True)
class PullLineOptions:
    """Options: the elbow's side, the times of the law, the positions of slides and lift, and the drawer's travel.

    The travel is that of the whole drawer; for some of its compartments the hand pulls a fraction of it.
    """

    elbow: Elbow = Elbow.RIGHT
    duration_s: float = number(10.0, 0.002, 600.0, "s")
    ramp_s: float = number(2.0, 0.001, 300.0, "s")
    sx_mm: float = joint_position(0.0, "sx")
    sz_mm: float = joint_position(0.0, "sz")
    L1_mm: float = joint_position(100.0, "L1")
    travel_mm: float = number(TRAVEL_MM, 1.0, 1000.0, "mm", in_reach_at_most(TRAVEL_MM, REACH_MM))
    compartments: int = number(COMPARTMENTS, 1, COMPARTMENTS, "compartments")


def pull_line(robot: Robot, options: PullLineOptions) -> Motion:
    """Return the pull, from one tool pose with either elbow; raise InputError for times that give no trapezoid."""
    travel_mm = options.travel_mm * (options.compartments / COMPARTMENTS)
    law = Trapezoid(travel_mm, options.duration_s, options.ramp_s)
    right = np.array([options.sx_mm, options.sz_mm, options.L1_mm, *LOCKED_DEG])
    start = with_elbow(robot, right, options.elbow)
    x_mm, y_mm, z_mm, attitude_deg = make_kinematics(robot).forward(right[np.newaxis])[0].tolist()
    path = StraightLine((x_mm, y_mm, z_mm, attitude_deg), (x_mm, y_mm - travel_mm, z_mm, attitude_deg))
    return tool_move(robot, path, law, options.elbow.value, start)


PULL_LINE: Final = Job(
    "pull-line", "move as if to pull a drawer out, straight, 180 mm or by compartments", PullLineOptions, pull_line
)
