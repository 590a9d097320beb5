"""A short run of a robot, for tests of its motors."""

import numpy as np

from steptwin import load_robot
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.stretched import stretched
from steptwin.host.planning.planner import plan
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.verify import Comparison


def shoulder_turn(stretch: float = 1.0) -> Comparison:
    """Turn the teaching SCARA's shoulder from home by 30 degrees, as fast as its limits allow or slower."""
    robot = load_robot("teaching-scara")
    motion = Composer(robot, np.array(robot.home))
    motion.go_some({"th1": 30.0})
    return execute(plan(robot, stretched(motion.sequence(), stretch)), "turn").comparison
