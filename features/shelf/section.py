"""A robot's shelf and loads: drawers with the hand's lock, and spots for single boxes.

A drawer slides along -y. Its own catch holds it unless the hand's lock is in its striker, the middle of its front. A
box moves only with the hand's magnet or gripper. A robot may have spots without drawers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, Final

from steptwin.host.common.bad_input import prefixed, require_positive, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable
from steptwin.host.common.file_values import Within, check_limits
from steptwin.host.common.findings import Findings, check_all, judged
from steptwin.host.robots.board_settings import Input, Output
from steptwin.host.robots.box import Box
from steptwin.host.robots.motor import Triple
from steptwin.host.robots.robot import Robot

Point = tuple[float, float, float]

SENSORS: Final = ("lock_engaged", "box_present", "drawer_end")
"""Sensors by their keys in the robot file: the lock is in a striker; a box hangs at the magnet; the drawer that the
hand holds is at its end stop.
"""


@dataclass(frozen=True, slots=True)
class Spot(FileTable):
    """A spot for one box outside of the shelf, such as a table for handing over.

    Attributes:
        lid_mm: x, y and z of the tool's tip at the middle of the box's lid, where it takes or releases the box.
        feeds: True if the next box arrives when one has been taken away.
        clears: True if a box that is put here is taken away at once.
        grip_mm: depth below the lid to which the hand may grip the box, as a gripper does; 0 for a magnet.
    """

    lid_mm: Triple
    feeds: bool = False
    clears: bool = False
    grip_mm: Annotated[float, Within(0.0, unit="mm")] = 0.0

    def __post_init__(self) -> None:
        check_limits(self)
        if self.feeds and self.clears:
            raise InputError("clears: a spot that feeds boxes cannot clear them away as well")


@dataclass(frozen=True, slots=True)
class Shelf(FileTable):
    """A shelf and the spots around it; lengths in mm.

    Attributes:
        magnet: name of the output that takes a box: a magnet by its lid, or a gripper.
        capture_mm: reach of lock and magnet from the tool's tip, and largest distance of the hand from the path of a
            drawer that it holds.
        spots: spots by name.
        slots: drawer of each slot, as the name of one of the robot's boxes; without slots, lock and lengths of drawers
            are meaningless.
        lock: name of the output that puts the hand's lock into a striker.
        travel_mm: travel of a drawer from shut to its end stop.
        opening_mm: least opening of a drawer to put a box in or take one out.
        arm_radius_mm: half the thickness of the arm's parts, for the check against obstacles.
        obstacles: names of the robot's boxes that the arm must not touch on its way to a job's start.
        lock_engaged: name of the input that is on while the lock is in a striker; empty without this sensor.
        box_present: name of the input that is on while a box hangs at the magnet; empty without this sensor.
        drawer_end: name of the input that is on while the drawer in the hand is at its end stop; empty without it.
    """

    magnet: str
    capture_mm: float
    spots: Mapping[str, Spot] = field(default_factory=dict)
    slots: Mapping[str, str] = field(default_factory=dict)
    lock: str = ""
    travel_mm: float = 0.0
    opening_mm: float = 0.0
    arm_radius_mm: float = 0.0
    obstacles: tuple[str, ...] = ()
    lock_engaged: str = ""
    box_present: str = ""
    drawer_end: str = ""

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the shelf from a table; drawers need all of their keys, spots alone need none."""
        drawers = any(name in reading.table for name in (*_DRAWERS, "obstacles", *SENSORS))
        needed = _DRAWERS if drawers or "spots" not in reading.table else ("spots",)
        for name in [name for name in needed if name in values and values[name] is None]:
            reading.findings.add(f"{name}: is missing")
            del values[name]
        return judged(cls, values, reading.findings)

    def __post_init__(self) -> None:
        lengths = ("travel_mm", "opening_mm", "capture_mm", "arm_radius_mm") if self.slots else ("capture_mm",)
        check_all(*(partial(require_positive, self, name) for name in lengths), self._check_opening, self._check_slots)

    def _check_opening(self) -> None:
        if self.opening_mm > self.travel_mm:
            raise InputError(f"opening_mm: {self.opening_mm:g} mm is more than a drawer's way, {self.travel_mm:g} mm")

    def _check_slots(self) -> None:
        if not self.slots and not self.spots:
            raise InputError("slots: names no slot, and spots no spot")
        first_of = dict[str, str]()
        for name, drawer in self.slots.items():
            first = first_of.setdefault(drawer, name)
            if first != name:
                raise InputError(f"slots.{name}: {drawer} is the drawer of {first} already")
            if name in self.spots:
                raise InputError(f"slots.{name}: is the name of a spot as well")

    def check(self, robot: Robot) -> None:
        """Raise InputError, with all errors, if the robot lacks anything that the shelf names."""
        if self.slots and robot.base.phi_deg % 360.0:
            raise InputError(
                f"base.phi_deg: {robot.base.phi_deg:g} deg is for a robot without a shelf, whose drawers open along y;"
                " 0 is right here"
            )
        with prefixed("shelf."):
            self._check_names(robot.outputs, robot.inputs, robot.places, robot.boxes)

    def _check_names(
        self,
        outputs: Mapping[str, Output],
        inputs: Mapping[str, Input],
        places: Mapping[str, Mapping[str, float]],
        boxes: Mapping[str, Box],
    ) -> None:
        hand = ("lock", "magnet") if self.slots else ("magnet",)
        checks = [partial(_check, key, "output", getattr(self, key), outputs) for key in hand]
        checks += [partial(_check, key, "input", name, inputs) for key, name in self.sensors.items()]
        checks += [partial(_check, f"slots.{slot}", "box", drawer, boxes) for slot, drawer in self.slots.items()]
        checks += [partial(_check, f"slots.{slot}", "place", slot, places) for slot in self.slots]
        checks += [partial(_check, f"spots.{spot}", "place", spot, places) for spot in self.spots if self.slots]
        checks += [partial(_check, f"obstacles[{i}]", "box", name, boxes) for i, name in enumerate(self.obstacles)]
        check_all(*checks)

    @property
    def sensors(self) -> dict[str, str]:
        """Input of each existing sensor, by the sensor's key."""
        return {key: name for key in SENSORS if (name := getattr(self, key))}

    def striker_mm(self, slot: str, boxes: Mapping[str, Box]) -> Point:
        """Return the place of a slot's striker on its shut drawer: the middle of its front."""
        drawer = boxes[self.slots[slot]]
        return (sum(drawer.x_mm) / 2, drawer.y_mm[0], sum(drawer.z_mm) / 2)


def _check(key: str, what: str, name: str, known: Mapping[str, object]) -> None:
    if name not in known:
        raise unknown(f"{key}: {what}", name, known)


_DRAWERS: Final = ("lock", "travel_mm", "opening_mm", "arm_radius_mm", "slots")
"""Keys of a shelf with drawers."""


def check_slots(robot: Robot, slots: Sequence[str]) -> None:
    """Raise InputError for each slot that a robot's shelf does not have."""
    shelf, findings = robot.sections.get("shelf"), Findings()
    known = shelf.slots if isinstance(shelf, Shelf) else {}
    for slot in slots:
        with findings.collecting("leaves_open: "):
            if not known:
                raise InputError(f"{slot!r}: {robot.name} has no shelf")
            if slot not in known:
                raise unknown("slot", slot, known)
    findings.raise_first()
