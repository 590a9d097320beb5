"""The motors of one emulated machine, whose rotors turn with its boards."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from steptwin.emulator.simulation import Simulation
from steptwin.features.motors.evidence import RotorFacts, RotorsOfRun, RotorsSoFar
from steptwin.features.motors.rotors.rotor_watch import RotorWatch
from steptwin.features.motors.rotors.rotors import RotorRecord, Rotors
from steptwin.features.motors.turning.after_run import rotor_trace
from steptwin.features.motors.turning.drives import check_described, motor_wiring
from steptwin.features.motors.turning.driving import followed_ms
from steptwin.features.motors.turning.verdict import AMBIENT_CELSIUS
from steptwin.host.common.features import MachinePart
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


class MotorPart(MachinePart):
    """The motors of one machine, from power-up on."""

    def __init__(self, robot: Robot, start_joints: Sequence[float], axes_per_board: Sequence[int]) -> None:
        """Note where the joints of a robot stand at power-up, and the number of axes on each board.

        Raises:
            InputError: the robot's file does not describe its motors and masses.
        """
        check_described(robot)
        self._robot, self._start_joints, self._axes_per_board = robot, start_joints, axes_per_board
        self._watch: RotorWatch | None = None
        self._figures: RotorFigures | None = None
        self._records: list[RotorRecord] = []
        """What the rotors have done since power-up, or on a served board since the last round."""

    def join(self, simulation: Simulation) -> RotorWatch:
        """Return the rotors beside the boards of a simulation, which knows them by `rotor_watch`."""
        chip = simulation.boards[0].drivers.drivers[0].module.chip
        wiring = motor_wiring(self._robot, chip, self._start_joints, self._axes_per_board)
        self._watch = RotorWatch(wiring, simulation.boards, lambda: simulation.now_counts)
        self._figures = RotorFigures(self._robot, self._watch.rotors)
        self._watch.on_record = self._take
        simulation.rotor_watch = self._watch
        return self._watch

    def _take(self, record: RotorRecord) -> None:
        assert self._figures is not None
        self._figures.add(record)
        self._records.append(record)

    def evidence(self) -> None:
        """Rotors are judged when a run has ended and they have come to rest."""

    def seen(self) -> RotorsSoFar:
        """Return what the rotors have done up to now."""
        assert self._figures is not None, "the machine is not switched on"
        return self._figures.so_far()

    def settled(self, last_counts: int) -> RotorsOfRun:
        """Return what the rotors have done up to some ms after the boards' last edge."""
        watch = self._watch
        assert watch is not None, "the machine is not switched on"
        watch.finish(followed_ms(last_counts))
        trace = rotor_trace(self._robot, self._records, watch.rotors)
        return RotorsOfRun(self._robot, replace(trace, other_payloads_kg=tuple(watch.other_payloads_kg)))

    def end_round(self) -> None:
        """Forget all but the figures."""
        self._records.clear()
