"""Pull-out curves of motors on a robot's drivers, each computed once."""

from typing import Final

import numpy as np

from steptwin.emulator.motor import Motor
from steptwin.emulator.pull_out import pull_out_nm
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.drives import supply_of
from steptwin.host.twin.motors.torques import Curve

_CURVE_SPEEDS: Final = 25


class Curves:
    """The pull-out curves of motors on a robot's drivers, up to a speed in turns a minute."""

    def __init__(self, robot: Robot, rpm_max: float, fast_decay_part: float) -> None:
        self._robot, self._fast_decay_part = robot, fast_decay_part
        self._rpm = np.linspace(0.0, rpm_max, _CURVE_SPEEDS)
        self._known: dict[tuple[Motor, float], Curve] = {}

    def of(self, motor: Motor, current_a: float) -> Curve:
        """Return the curve of a motor at an amplitude of the phase current."""
        if (motor, current_a) not in self._known:
            supply = supply_of(self._robot, 0, current_a, self._fast_decay_part)
            self._known[motor, current_a] = Curve(self._rpm, pull_out_nm(motor, supply, self._rpm))
        return self._known[motor, current_a]
