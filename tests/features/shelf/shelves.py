"""The warehouse robot and its shelf, for tests."""

from dataclasses import replace
from typing import Final

from steptwin.features.shelf.evidence import ShelfEvidence
from steptwin.features.shelf.section import Shelf
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Evidence


def shelf_of(robot: Robot) -> Shelf:
    """Return the shelf of a robot that has one."""
    shelf = robot.sections["shelf"]
    assert isinstance(shelf, Shelf)
    return shelf


ROBOT: Final = load_robot("warehouse-scara")
SHELF: Final = shelf_of(ROBOT)


def with_shelf(robot: Robot, shelf: Shelf) -> Robot:
    """Return a robot with another shelf."""
    return replace(robot, sections={**robot.sections, "shelf": shelf})


def shelf_evidence_of(evidence: Evidence) -> ShelfEvidence | None:
    """Return what happened at the shelf of a run; None without one."""
    found: ShelfEvidence | None = evidence.features.get("shelf")
    return found
