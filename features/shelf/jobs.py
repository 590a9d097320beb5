"""Jobs at a shelf: `drawer-pull` opens a drawer, `store` puts a box into one, `fetch` takes one out.

The hand locks onto the drawer and pulls it out, the electromagnet releases or takes the box, and the hand pushes the
drawer shut and unlocks. `drawer-pull` is the experiment of the paper's section 3: the drawer stays out, in the hand.
The slides move while the arm is drawn back; outputs change while all joints are still.

The classroom robot's job `carry` moves parts between spots. If the shelf of the robot's file has the presets among its
spots, a part is at the first one, and each repetition brings one to the second.

Source of the procedure: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot",
2019(05), DOI 10.3969/j.issn.1009-9492.2019.05.018. Slots, hand-over, approach and speeds are assumptions.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from math import dist
from typing import Final

import numpy as np

from steptwin.features.papers import carry
from steptwin.features.papers.carry import CARRY, GOAL, GOAL_RAD, START, START_RAD, CarryOptions
from steptwin.features.papers.pull_line import COMPARTMENTS, KIND, LOCKED_DEG, REACH_MM, TRAVEL_MM
from steptwin.features.papers.scaling import fitted, in_reach_at_most, with_elbow
from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.errand import Carry
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import number, place
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.paths import OutOfReachError
from steptwin.host.robots.kinematics import Elbow, make_kinematics
from steptwin.host.robots.robot import Robot

HAND_OVER: Final = "hand-over"
APPROACH_MM: Final = 60.0
"""Distance from the front position to the drawer's striker."""
LOWERING_MM: Final = 30.0
"""Distance down to the lid of a box; less if the lift ends above that."""
PULL_S: Final = 10.0
RAMP_PART: Final = 0.2
"""Duration of a drawer's full travel, from the paper, and the fraction of it for each ramp."""
SENSOR_TIMEOUT_S: Final = 2.0
"""Timeout for the sensor of the hand's last action."""
_SLIDES: Final = 2
"""The first joints, sx and sz, are the slides."""


class Sensors(Enum):
    """Whether a job waits for the shelf's sensors after its actions."""

    IGNORE = "ignore"
    WAIT = "wait"


def _slots(robot: Robot) -> Iterable[str]:
    shelf = shelf_of(robot)
    return shelf.slots if shelf else (name for name in robot.places if name != HAND_OVER)


def _spots(robot: Robot) -> Iterable[str]:
    shelf = shelf_of(robot)
    return shelf.spots if shelf else (HAND_OVER,)


@dataclass(frozen=True, slots=True)
class _AtShelf:
    """Options of all jobs.

    They are the elbow's side, the drawer's travel, the distance from the front position to its striker, the duration of
    a pull or push, and the wait for sensors.
    """

    elbow: Elbow = Elbow.RIGHT
    travel_mm: float = number(TRAVEL_MM, 1.0, 1000.0, "mm", in_reach_at_most(TRAVEL_MM, REACH_MM))
    approach_mm: float = number(APPROACH_MM, 1.0, 1000.0, "mm", in_reach_at_most(APPROACH_MM, REACH_MM))
    pull_s: float = number(PULL_S, 1.0, 600.0, "s")
    sensors: Sensors = Sensors.IGNORE


@dataclass(frozen=True, slots=True)
class DrawerPullOptions(_AtShelf):
    """Options of `drawer-pull`: also the slot, and the number of compartments to pull out."""

    slot: str = place("A1", _slots)
    compartments: int = number(COMPARTMENTS, 1, COMPARTMENTS, "compartments")


@dataclass(frozen=True, slots=True)
class StoreOptions(_AtShelf):
    """Options of `store`: also the slot and the spot of the box."""

    slot: str = place("A1", _slots)
    pick_up: str = place(HAND_OVER, _spots)


@dataclass(frozen=True, slots=True)
class FetchOptions(_AtShelf):
    """Options of `fetch`: also the slot and the spot for the box."""

    slot: str = place("A1", _slots)
    output: str = place(HAND_OVER, _spots)


@dataclass(frozen=True, slots=True)
class EverySlotOptions(_AtShelf):
    """Options of `every-slot`: also the spots to take boxes from and to put them."""

    pick_up: str = place(HAND_OVER, _spots)
    output: str = place(HAND_OVER, _spots)


class _Shelf:
    """Moves of a robot between spots and slots."""

    def __init__(self, robot: Robot, options: _AtShelf) -> None:
        self._robot, self._shelf = robot, shelf_of(robot)
        self._elbow = options.elbow
        self._travel_mm, self._approach_mm = options.travel_mm, options.approach_mm
        self._pull_s = options.pull_s
        self._waits = options.sensors is Sensors.WAIT

    def above(self, spot: str) -> FloatArray:
        """Return the joints above a spot, which must name every joint, with the chosen elbow."""
        position = self._robot.places.get(spot, {})
        missing = [joint for joint in self._robot.joint_names if joint not in position]
        if missing:
            raise InputError(f"places.{spot}.{missing[0]}: is missing in the robot's file")
        joints = np.array([position[joint] for joint in self._robot.joint_names])
        return with_elbow(self._robot, joints, self._elbow)

    def drawn_back(self, spot: str, slot: str) -> FloatArray:
        """Return the joints with the arm drawn back in front of a slot, and the slides at a spot."""
        return self.in_front(self.above(spot)[:_SLIDES], slot)

    def in_front(self, slides_mm: FloatArray, slot: str) -> FloatArray:
        """Return the joints with the arm drawn back in front of a slot, and the slides at a position."""
        lift_mm = self._robot.places[slot].get("L1", self._robot.home[self._robot.joint_names.index("L1")])
        locked = np.array([*slides_mm, lift_mm, *LOCKED_DEG])
        kinematics = make_kinematics(self._robot)
        pose = kinematics.forward(locked[np.newaxis]) - np.array([0.0, self._approach_mm, 0.0, 0.0])
        solved = kinematics.solve(pose, self._elbow.value, locked)
        if not solved.reachable[0]:
            raise OutOfReachError(f"in front of the shelf: {solved.reason(0)}")
        joints: FloatArray = solved.joints[0]
        return joints

    def to_slot(self, moves: Composer, spot: str, slot: str) -> None:
        """Draw the arm back from a spot, then move the slides to a slot."""
        moves.go(self.drawn_back(spot, slot))
        self.slides_to(moves, slot)

    def slides_to(self, moves: Composer, slot: str) -> None:
        """Move the slides to a slot, with the arm drawn back."""
        moves.go_some({name: at for name, at in self._robot.places[slot].items() if name != "L1"})

    def to_spot(self, moves: Composer, slot: str, spot: str) -> None:
        """Move the slides from a slot to a spot, then the arm."""
        _slides_first(moves, self.drawn_back(spot, slot))
        moves.go(self.above(spot))

    def to_other_spot(self, moves: Composer, spot: str, other: str, slot: str) -> None:
        """Draw the arm back, move the slides to another spot, then the arm."""
        if spot != other:
            moves.go(self.drawn_back(spot, slot))
            self.to_spot(moves, slot, other)

    def at_box(self, moves: Composer, spot: str, *, take: bool) -> None:
        """Lower the tool onto the box, switch the magnet, and raise the tool."""
        lift_mm = moves.joints[self._robot.joint_names.index("L1")]
        lowest_mm = self._robot.joint("L1").lower
        if not lift_mm > lowest_mm:
            raise InputError(f"places.{spot}.L1: {lift_mm:g} mm is the lift's lower end: it cannot go down to a box")
        moves.go_some({"L1": max(lift_mm - LOWERING_MM, lowest_mm)})
        self._magnet(moves, spot, on=take)
        moves.go_some({"L1": lift_mm})

    def at_drawer(self, moves: Composer, slot: str, *, take: bool) -> None:
        """Lock, pull the drawer out, take or release a box, push the drawer shut, unlock."""
        self.pull_out(moves, slot)
        self._magnet(moves, slot, on=take)
        moves.line(self._elbow.value, (0.0, self._travel_mm, 0.0), self._pull)
        moves.switch("lock", on=False)
        self._wait(moves, "lock_engaged", slot, on=False)
        moves.line(self._elbow.value, (0.0, -self._approach_mm, 0.0), self._approach)

    def pull_out(self, moves: Composer, slot: str) -> None:
        """Reach to the drawer, lock, pull it out."""
        moves.line(self._elbow.value, (0.0, self._approach_mm, 0.0), self._approach)
        moves.switch("lock", on=True)
        self._wait(moves, "lock_engaged", slot, on=True)
        moves.line(self._elbow.value, (0.0, -self._travel_mm, 0.0), self._pull)
        if self._shelf and self._travel_mm >= self._shelf.travel_mm:
            self._wait(moves, "drawer_end", slot, on=True)

    @property
    def _approach(self) -> Trapezoid:
        return Trapezoid.fastest(self._approach_mm, speed_max=40.0, acceleration_max=80.0)

    @property
    def _pull(self) -> Trapezoid:
        return Trapezoid(self._travel_mm, self._pull_s, round(self._pull_s * RAMP_PART, 3))

    def _magnet(self, moves: Composer, where: str, *, on: bool) -> None:
        moves.switch("magnet", on=on)
        self._wait(moves, "box_present", where, on=on)

    def _wait(self, moves: Composer, sensor: str, where: str, *, on: bool) -> None:
        """Wait for a sensor if the job uses sensors."""
        if not self._waits:
            return
        wired = self._shelf.sensors if self._shelf else {}
        if sensor not in wired:
            raise InputError(f"shelf.{sensor}: is missing in the robot's file: sensors=ignore does without it").plainly(
                f"the robot's file names no sensor {sensor}: choose to ignore the sensors"
            )
        moves.wait(wired[sensor], on=on, timeout_s=SENSOR_TIMEOUT_S, place=where)

    def lid(self, spot: str) -> FloatArray:
        """Return the joints with the magnet on the lid of a box at a spot."""
        joints = self.above(spot)
        lift = self._robot.joint_names.index("L1")
        joints[lift] = max(joints[lift] - LOWERING_MM, self._robot.joints[lift].lower)
        return joints

    def locked(self, slot: str) -> FloatArray:
        """Return the joints with the hand locked onto a slot's drawer and the elbow on the right."""
        place, home = self._robot.places[slot], dict(zip(self._robot.joint_names, self._robot.home, strict=True))
        return np.array([*({**home, **place}[name] for name in ("sx", "sz", "L1")), *LOCKED_DEG])


def missed_places(robot: Robot) -> list[str]:
    """Return a line for each slot and spot of a robot's shelf with a striker or lid that the hand misses."""
    shelf = shelf_of(robot)
    if shelf is None or robot.kinematics != KIND:
        return []
    moves, forward = _Shelf(robot, StoreOptions()), make_kinematics(robot).forward
    goals = {f"slots.{slot}": (moves.locked(slot), shelf.striker_mm(slot, robot.boxes)) for slot in shelf.slots}
    for name, spot in shelf.spots.items():
        if set(robot.places[name]) >= set(robot.joint_names):
            goals[f"spots.{name}"] = (moves.lid(name), spot.lid_mm)
    lines = []
    for key, (joints, goal_mm) in goals.items():
        tip_mm = forward(joints[np.newaxis])[0, :3]
        away_mm = float(np.linalg.norm(tip_mm - np.array(goal_mm)))
        if away_mm > shelf.capture_mm:
            x_mm, y_mm, z_mm = tip_mm.tolist()
            lines.append(
                f"shelf.{key}: the jobs bring the hand to x {x_mm:.1f}, y {y_mm:.1f}, z {z_mm:.1f} mm,"
                f" {away_mm:.1f} mm away; it reaches {shelf.capture_mm:g} mm"
            )
    return lines


def _slides_first(moves: Composer, goal: FloatArray) -> None:
    """Move the slides to their goal, then the arm."""
    slides = moves.joints.copy()
    slides[:_SLIDES] = goal[:_SLIDES]
    moves.go(slides)
    moves.go(goal)


def drawer_pull(robot: Robot, options: DrawerPullOptions) -> Motion:
    """Return the paper's experiment: slides to the slot, arm to the drawer, lock, pull; the drawer stays out.

    Raise InputError if the robot file lacks a place or an output, or if a pose is out of reach.
    """
    travel_mm = options.travel_mm * (options.compartments / COMPARTMENTS)
    shelf = _Shelf(robot, replace(options, travel_mm=travel_mm))
    moves = Composer(robot, shelf.in_front(np.array(robot.home[:_SLIDES]), options.slot))
    shelf.slides_to(moves, options.slot)
    shelf.pull_out(moves, options.slot)
    return moves.sequence({"leaves_open": (options.slot,)})


def store(robot: Robot, options: StoreOptions) -> Motion:
    """Return the motion that brings a box from a spot to the slot.

    Raise InputError if the robot file lacks a place or an output, or if a pose is out of reach.
    """
    shelf = _Shelf(robot, options)
    moves = Composer(robot, shelf.above(options.pick_up))
    _bring(shelf, moves, options.pick_up, options.slot)
    return moves.sequence()


def fetch(robot: Robot, options: FetchOptions) -> Motion:
    """Return the motion that brings the box from the slot to a spot; raise InputError as `store` does."""
    shelf = _Shelf(robot, options)
    moves = Composer(robot, shelf.drawn_back(options.output, options.slot))
    shelf.to_slot(moves, options.output, options.slot)
    _take_out(shelf, moves, options.slot, options.output)
    return moves.sequence()


def every_slot(robot: Robot, options: EverySlotOptions) -> Motion:
    """Return the motion that stores a box in each slot in turn and fetches it; raise InputError as `store` does."""
    shelf = _Shelf(robot, options)
    moves = Composer(robot, shelf.above(options.pick_up))
    slots = list(_slots(robot))
    for slot in slots:
        _bring(shelf, moves, options.pick_up, slot)
        _take_out(shelf, moves, slot, options.output)
        if slot != slots[-1]:
            shelf.to_other_spot(moves, options.output, options.pick_up, slot)
    return moves.sequence()


def _bring(shelf: _Shelf, moves: Composer, spot: str, slot: str) -> None:
    shelf.at_box(moves, spot, take=True)
    shelf.to_slot(moves, spot, slot)
    shelf.at_drawer(moves, slot, take=False)


def _take_out(shelf: _Shelf, moves: Composer, slot: str, spot: str) -> None:
    shelf.at_drawer(moves, slot, take=True)
    shelf.to_spot(moves, slot, spot)
    shelf.at_box(moves, spot, take=False)


def _stored(_: Robot, options: StoreOptions) -> tuple[Carry, ...]:
    return (Carry(options.pick_up, options.slot),)


def _fetched(_: Robot, options: FetchOptions) -> tuple[Carry, ...]:
    return (Carry(options.slot, options.output),)


def _carried_everywhere(robot: Robot, options: EverySlotOptions) -> tuple[Carry, ...]:
    there_and_back = ((Carry(options.pick_up, slot), Carry(slot, options.output)) for slot in _slots(robot))
    return tuple(carry for pair in there_and_back for carry in pair)


DRAWER_PULL: Final = Job(
    "drawer-pull",
    "go to a drawer, lock on, pull it out: 180 mm or by compartments; it stays out",
    DrawerPullOptions,
    drawer_pull,
)
STORE: Final = Job("store", "take a box at the hand-over and put it into a slot's drawer", StoreOptions, store, _stored)
FETCH: Final = Job(
    "fetch", "take a box out of a slot's drawer and bring it to the hand-over", FetchOptions, fetch, _fetched
)
EVERY_SLOT: Final = Job(
    "every-slot",
    "put a box into each slot in turn and take it out again",
    EverySlotOptions,
    every_slot,
    _carried_everywhere,
)


# --- parts of the classroom robot


def _carried(robot: Robot, options: CarryOptions) -> tuple[Carry, ...]:
    shelf = shelf_of(robot)
    spots = shelf.spots if shelf else {}
    presets = options.from_ is None and options.to is None and START in spots and GOAL in spots
    return (Carry(START, GOAL),) * options.repetitions if presets and options.depth_mm else ()


def missed_presets(robot: Robot) -> list[str]:
    """Return a line for each preset among a robot's spots where `carry` misses the part."""
    shelf, lines = shelf_of(robot), list[str]()
    if shelf is None or robot.kinematics != carry.KIND:
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
