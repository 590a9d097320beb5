"""What the rotors of a board have done since power-up, in memory that does not grow: for boards that run for ever."""

import numpy as np

from steptwin.features.motors.evidence import RotorFacts, RotorsSoFar
from steptwin.features.motors.rotors.rotors import RotorRecord, Rotors
from steptwin.features.motors.turning.verdict import AMBIENT_CELSIUS
from steptwin.host.robots.robot import Robot


class RotorFigures:
    """The extremes of each rotor's record."""

    def __init__(self, robot: Robot, rotors: Rotors) -> None:
        self._robot, self._rotors = robot, rotors
        self._worst_rad = np.zeros(len(robot.axes))
        self._worst_counts = np.zeros(len(robot.axes), dtype=np.int64)
        self._warmer_k = np.zeros(len(robot.axes))

    def add(self, record: RotorRecord) -> None:
        """Take the next ms."""
        sizes = np.abs(record.worst_rad)
        rows = sizes.argmax(axis=0)
        for axis in np.flatnonzero(sizes.max(axis=0) > np.abs(self._worst_rad)):
            self._worst_rad[axis] = record.worst_rad[rows[axis], axis]
            self._worst_counts[axis] = record.counts[rows[axis]]
        self._warmer_k = record.warmer_k[-1]

    def so_far(self) -> RotorsSoFar:
        """Return what the rotors have done up to now."""
        slips, lost = self._rotors.first_slips(), self._rotors.lost_full_steps()
        return RotorsSoFar(
            self._robot,
            tuple(
                RotorFacts(
                    name=name,
                    load_angle_deg=float(np.rad2deg(self._worst_rad[axis])),
                    load_angle_counts=int(self._worst_counts[axis]),
                    first_slip_counts=slips[axis],
                    lost_full_steps=lost[axis],
                    winding_celsius=AMBIENT_CELSIUS + float(self._warmer_k[axis]),
                )
                for axis, name in enumerate(self._robot.axis_names)
            ),
        )
