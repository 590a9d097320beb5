"""Make the motions that every method is given: the records as sent over the wire, and the motion behind them.

Four are jobs of the robots. The fifth is a stress test: seven axes on sines of different frequencies, which all reach
14 kHz and accelerate with up to 77 000 steps/s^2.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.robot import Robot
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

JOBS: Final = (
    ("warehouse-scara", "pull-line"),
    ("lab-scara", "spiral"),
    ("hybrid-arm", "helix"),
    ("teaching-scara", "carry"),
)
AXES: Final = 7
MICROSTEPS: Final = 16
UNITS_PER_STEP: Final = UNITS_PER_FULL_STEP // MICROSTEPS
POINT_MS: Final = 10
STRESS_PEAK_HZ: Final = 14_000.0
STRESS_S: Final = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class PlannedMotion:
    """A motion of some axes from rest to rest.

    Attributes:
        name: its name in the tables.
        exact: the motion itself, from which the ideal steps are computed.
        steps_per_unit: steps per unit of the motion, shape (axes,).
        microsteps: microsteps per full step, shape (axes,).
        times_ms: times of the points from 0 to the end, shape (points,).
        points_units: positions in wire units, shape (axes, points).
        velocities: velocities in 1/64 wire unit per ms, shape (axes, points).
        board: the board's settings: pulse timing and drivers.
    """

    name: str
    exact: Motion
    steps_per_unit: FloatArray
    microsteps: Int64Array
    times_ms: Int64Array
    points_units: Int64Array
    velocities: Int64Array
    board: BoardSettings

    @property
    def axes(self) -> int:
        """Number of axes."""
        return len(self.microsteps)

    @property
    def points_q16(self) -> Int64Array:
        """Positions in Q16 steps, without rounding, shape (axes, points)."""
        return self.points_units * (self.microsteps[:, None] << 2)

    @property
    def velocities_hz(self) -> FloatArray:
        """Velocities at the points in steps per second, shape (axes, points)."""
        per_step = UNITS_PER_STEP * MICROSTEPS / self.microsteps[:, None]
        hz: FloatArray = self.velocities * 1000 / (VELOCITY_PER_UNIT_PER_MS * per_step)
        return hz

    @property
    def start_steps(self) -> tuple[int, ...]:
        """Each axis' counter before the motion: the step nearest to its position."""
        return tuple(int(q16 + (1 << 15)) >> 16 for q16 in self.points_q16[:, 0])

    @property
    def steps_max(self) -> int:
        """Upper bound of any axis' steps: what the velocity hulls of its records allow, and two for each record."""
        travel = np.abs(np.diff(self.points_q16, axis=1)) / 65_536
        way = np.abs(self.velocities_hz) * 0.001
        hull = np.diff(self.times_ms) * np.maximum(way[:, 1:], way[:, :-1])
        return int((3 * travel + 3 * hull + 2).sum(axis=1).max())


def motion_of_job(robot: Robot, job: str) -> PlannedMotion:
    """Plan a robot's job with its default options; raise InputError if the robot has no such job."""
    made = plan(robot, make_job(robot, job, {}))
    microsteps = np.array([joint.transmission.microsteps for joint in robot.axes])
    return PlannedMotion(
        f"{robot.name} {job}",
        made.motion,
        robot.steps_per_unit,
        microsteps,
        made.times_ms,
        np.ascontiguousarray(made.points_units.T),
        np.ascontiguousarray(made.velocities.T),
        robot.board,
    )


@dataclass(frozen=True, slots=True)
class Sines(JointLaw):
    """Positions A (1 - cos wt) in steps: an axis for each number of cycles, all with the same peak rate."""

    cycles: tuple[int, ...]
    peak_hz: float
    duration_s: float

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return positions in steps."""
        omega = self._omega()
        moved: FloatArray = self.peak_hz / omega * (1 - np.cos(omega * t_s[:, None]))
        return moved

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return velocities in steps per second."""
        rates: FloatArray = self.peak_hz * np.sin(self._omega() * t_s[:, None])
        return rates

    def _omega(self) -> FloatArray:
        return 2 * np.pi * np.array(self.cycles) / self.duration_s


def sines(name: str, law: Sines, board: BoardSettings, point_ms: int = POINT_MS) -> PlannedMotion:
    """Plan sines, rounded as the planner does."""
    times_ms = np.arange(0, round(1000 * law.duration_s) + 1, point_ms)
    t_s = times_ms / 1000
    velocities = np.round(law.velocities(t_s) * UNITS_PER_STEP * VELOCITY_PER_UNIT_PER_MS / 1000)
    axes = len(law.cycles)
    names = tuple(f"axis {i}" for i in range(1, axes + 1))
    return PlannedMotion(
        name,
        Motion(names, law.duration_s, law),
        np.ones(axes),
        np.full(axes, MICROSTEPS),
        times_ms,
        np.floor(law.positions(t_s).T * UNITS_PER_STEP + 0.5).astype(np.int64),
        np.ascontiguousarray(velocities.T).astype(np.int64),
        board,
    )


def stress() -> PlannedMotion:
    """Return the stress test: seven axes up to 14 kHz, 1 to 7 cycles in 8 s, with the first robot's board."""
    law = Sines(tuple(range(1, AXES + 1)), STRESS_PEAK_HZ, STRESS_S)
    return sines("seven axes, 14 kHz", law, load_robot(JOBS[0][0]).board)


def all_motions() -> list[PlannedMotion]:
    """Return the four jobs and the stress test."""
    return [*(motion_of_job(load_robot(robot), job) for robot, job in JOBS), stress()]
