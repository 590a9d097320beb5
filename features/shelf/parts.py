"""Parts of the classroom robot at spots, and its job `carry`, which moves them.

If the shelf of the robot's file has the presets among its spots, a part is at the first one, and each repetition brings
one to the second.
"""

from dataclasses import replace
from math import dist
from typing import Final

import numpy as np

from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.errand import Carry
from steptwin.host.planning.jobs.carry import CARRY, GOAL, GOAL_RAD, KIND, START, START_RAD, CarryOptions
from steptwin.host.planning.jobs.job import fitted
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot


def _carried(robot: Robot, options: CarryOptions) -> tuple[Carry, ...]:
    shelf = shelf_of(robot)
    spots = shelf.spots if shelf else {}
    presets = options.from_ is None and options.to is None and START in spots and GOAL in spots
    return (Carry(START, GOAL),) * options.repetitions if presets and options.depth_mm else ()


def missed_presets(robot: Robot) -> list[str]:
    """Return a line for each preset among a robot's spots where `carry` misses the part."""
    shelf, lines = shelf_of(robot), list[str]()
    if shelf is None or robot.kinematics != KIND:
        return lines
    for name, preset_rad in ((START, START_RAD), (GOAL, GOAL_RAD)):
        if name in shelf.spots:
            joints = fitted(robot, np.rad2deg(preset_rad))
            x_mm, y_mm, _, _ = make_kinematics(robot).forward(joints[np.newaxis])[0].tolist()
            away_mm = dist((x_mm, y_mm), shelf.spots[name].lid_mm[:2])
            if away_mm > shelf.capture_mm:
                lines.append(
                    f"shelf.spots.{name}: carry brings the gripper to x {x_mm:.1f}, y {y_mm:.1f} mm, {away_mm:.1f} mm"
                    f" away; it reaches {shelf.capture_mm:g} mm"
                )
    return lines


CARRY_PARTS: Final = replace(CARRY, intent=_carried)
