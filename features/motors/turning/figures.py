"""What the rotors of a board have done since power-up, in memory that does not grow: for boards that run for ever."""

from typing import Any

import numpy as np

from steptwin.features.motors.rotors.rotors import RotorRecord, Rotors
from steptwin.features.motors.turning.drives import check_described
from steptwin.features.motors.turning.verdict import AMBIENT_CELSIUS
from steptwin.host.robots.robot import Robot
from steptwin.protocol.timer import COUNTS_PER_SECOND


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

    def slips_s(self) -> dict[str, float]:
        """Return the joints whose rotors have slipped, and when they did first, in seconds since power-up."""
        slips = zip(self._robot.axis_names, self._rotors.first_slips(), strict=True)
        return {name: counts / COUNTS_PER_SECOND for name, counts in slips if counts is not None}

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, under the keys of `MotorVerdict`; times since power-up."""
        dynamics, slips_s, lost = check_described(self._robot), self.slips_s(), self._rotors.lost_full_steps()
        return {
            "payload_kg": dynamics.payload_kg,
            "supply_v": dynamics.supply_v,
            "kept_step": not slips_s,
            "assumed": ["masses"],
            "joints": [
                {
                    "name": joint.name,
                    "load_angle_deg": float(np.rad2deg(self._worst_rad[axis])),
                    "load_angle_at_s": int(self._worst_counts[axis]) / COUNTS_PER_SECOND,
                    "first_slip_s": slips_s.get(joint.name),
                    "lost_full_steps": lost[axis],
                    "winding_celsius": AMBIENT_CELSIUS + float(self._warmer_k[axis]),
                }
                for axis, joint in enumerate(self._robot.axes)
            ],
        }
