"""The warehouse robot at its shelf: `store` puts a box into a slot's drawer, `fetch` takes one out.

The hand locks onto the drawer and pulls it out, the electromagnet releases or takes the box, the hand pushes the
drawer shut and unlocks. The slides move before the arm, and outputs change while all joints stand still.

Source of the procedure: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot",
2019, DOI 10.3969/j.issn.1009-9492.2019.05.018. Slots, hand-over, approach and their speeds are assumed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.drawer_pull import LOCKED_DEG, REACH_MM, TRAVEL_MM
from steptwin.host.planning.jobs.elbows import with_elbow
from steptwin.host.planning.jobs.fitting import in_reach_at_most
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number, place
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.out_of_reach import OutOfReachError
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot

HAND_OVER: Final = "hand-over"
APPROACH_MM: Final = 60.0
"""Distance from in front of the shelf to the drawer's striker."""
LOWERING_MM: Final = 30.0
"""Distance from above a box down to its lid; less if the lift ends above that."""


@dataclass(frozen=True, slots=True)
class ShelfOptions:
    """The options: the slot, the elbow's side, the drawer's way and the way from in front of it to its striker."""

    slot: str = place("A1", other_than=HAND_OVER)
    elbow: Elbow = Elbow.RIGHT
    travel_mm: float = number(TRAVEL_MM, 1.0, 1000.0, "mm", in_reach_at_most(TRAVEL_MM, REACH_MM))
    approach_mm: float = number(APPROACH_MM, 1.0, 1000.0, "mm", in_reach_at_most(APPROACH_MM, REACH_MM))


class _Shelf:
    """The robot's moves between the hand-over and a slot."""

    def __init__(self, robot: Robot, options: ShelfOptions) -> None:
        self._robot = robot
        self._elbow = options.elbow
        self._travel_mm, self._approach_mm = options.travel_mm, options.approach_mm
        self._slot = dict(robot.places[options.slot])
        self._hand_over = self._place(HAND_OVER)
        self._lift_mm = self._slot.pop("L1", robot.home[robot.joint_names.index("L1")])

    def above_box(self) -> Composer:
        """Begin above the hand-over."""
        return Composer(self._robot, self._hand_over)

    def in_front(self) -> Composer:
        """Begin with the arm drawn back, the slides at the hand-over."""
        return Composer(self._robot, self._drawn_back())

    def to_slot(self, moves: Composer) -> None:
        """Draw the arm back, then move the slides to the slot."""
        moves.go(self._drawn_back())
        moves.go_some(self._slot)

    def to_hand_over(self, moves: Composer) -> None:
        """Move the slides to the hand-over, then the arm."""
        moves.go(self._drawn_back())
        moves.go(self._hand_over)

    def at_box(self, moves: Composer, *, take: bool) -> None:
        """Go down onto the box, switch the magnet, go up again."""
        lift_mm = moves.joints[self._robot.joint_names.index("L1")]
        lowest_mm = self._robot.joint("L1").lower
        if not lift_mm > lowest_mm:
            raise InputError(
                f"places.{HAND_OVER}.L1: {lift_mm:g} mm is the lift's lower end: it cannot go down to a box"
            )
        moves.go_some({"L1": max(lift_mm - LOWERING_MM, lowest_mm)})
        moves.switch("magnet", on=take)
        moves.go_some({"L1": lift_mm})

    def at_drawer(self, moves: Composer, *, take: bool) -> None:
        """Lock, pull the drawer out, take or release a box, push the drawer shut, unlock."""
        branch = self._elbow.value
        approach = Trapezoid.fastest(self._approach_mm, speed_max=40.0, acceleration_max=80.0)
        pull = Trapezoid(self._travel_mm, 10.0, 2.0)
        moves.line(branch, (0.0, self._approach_mm, 0.0), approach)
        moves.switch("lock", on=True)
        moves.line(branch, (0.0, -self._travel_mm, 0.0), pull)
        moves.switch("magnet", on=take)
        moves.line(branch, (0.0, self._travel_mm, 0.0), pull)
        moves.switch("lock", on=False)
        moves.line(branch, (0.0, -self._approach_mm, 0.0), approach)

    def _place(self, name: str) -> FloatArray:
        """Return a place that must name every joint, with the chosen elbow."""
        position = self._robot.places.get(name, {})
        missing = [joint for joint in self._robot.joint_names if joint not in position]
        if missing:
            raise InputError(f"places.{name}.{missing[0]}: is missing in the robot's file")
        joints = np.array([position[joint] for joint in self._robot.joint_names])
        return with_elbow(self._robot, joints, self._elbow)

    def _drawn_back(self) -> FloatArray:
        """Return the joints with the arm in front of the shelf and the slides at the hand-over."""
        sx_mm, sz_mm = self._hand_over[:2]
        locked = np.array([sx_mm, sz_mm, self._lift_mm, *LOCKED_DEG])
        kinematics = make_kinematics(self._robot)
        pose = kinematics.forward(locked[np.newaxis]) - np.array([0.0, self._approach_mm, 0.0, 0.0])
        solved = kinematics.solve(pose, self._elbow.value, locked)
        if not solved.reachable[0]:
            raise OutOfReachError(f"in front of the shelf: {solved.reason(0)}")
        joints: FloatArray = solved.joints[0]
        return joints


def store(robot: Robot, options: ShelfOptions) -> Trajectory:
    """Return the motion that brings a box from the hand-over to the slot.

    Raise InputError if the robot file lacks a place or an output, or if a pose is out of reach.
    """
    shelf = _Shelf(robot, options)
    moves = shelf.above_box()
    shelf.at_box(moves, take=True)
    shelf.to_slot(moves)
    shelf.at_drawer(moves, take=False)
    return moves.sequence()


def fetch(robot: Robot, options: ShelfOptions) -> Trajectory:
    """Return the motion that brings the box from the slot to the hand-over; raise InputError as `store` does."""
    shelf = _Shelf(robot, options)
    moves = shelf.in_front()
    shelf.to_slot(moves)
    shelf.at_drawer(moves, take=True)
    shelf.to_hand_over(moves)
    shelf.at_box(moves, take=False)
    return moves.sequence()


STORE: Final = Job("store", "take a box at the hand-over and put it into a slot's drawer", ShelfOptions, store)
FETCH: Final = Job("fetch", "take a box out of a slot's drawer and bring it to the hand-over", ShelfOptions, fetch)
