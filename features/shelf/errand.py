"""Errand: the boxes of a shelf that a motion carries, and their places."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.options import ShelfOptions
from steptwin.features.shelf.section import Shelf
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_intent
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.robot import Robot

A_BOX: Final = "box"
"""Name of a box without a name from the user."""


class Carry(NamedTuple):
    """Transport of a box from a slot or spot to another."""

    source: str
    target: str


@dataclass(frozen=True, slots=True)
class Errand:
    """Boxes of a shelf and their transports.

    Attributes:
        stock: box of each occupied slot and spot before the motion.
        carries: transports in order.
    """

    stock: Mapping[str, str]
    carries: tuple[Carry, ...]

    @classmethod
    def alone(cls, carries: tuple[Carry, ...], box: str = A_BOX) -> "Errand":
        """Return the errand with a box only at each place that is emptied before it is filled."""
        stock, filled = dict[str, str](), set[str]()
        for source, target in carries:
            if source not in filled:
                stock.setdefault(source, box if not stock else f"{box}-{len(stock) + 1}")
            filled |= {source, target}
        return cls(stock, carries)

    def stock_after(self, shelf: Shelf) -> dict[str, str]:
        """Return the box of each occupied slot and spot after the motion.

        Raises:
            InputError: a place to be emptied has no box, or a place to be filled has one.
        """
        stock = dict(self.stock)
        for source, target in self.carries:
            if source not in stock and not _feeds(shelf, source):
                raise InputError(f"{source}: holds no box that could be taken")
            box = stock.pop(source, A_BOX)
            if target in stock:
                raise InputError(f"{target}: holds {stock[target]} already")
            if not _clears(shelf, target):
                stock[target] = box
        return stock

    def planned(self, shelf: Shelf) -> "PlannedStock":
        """Return the planned contents of all slots, and of the spots that neither feed boxes nor clear them away."""
        spots = (name for name in shelf.spots if not (_feeds(shelf, name) or _clears(shelf, name)))
        cleared = Counter(target for _, target in self.carries if _clears(shelf, target))
        return PlannedStock((*shelf.slots, *spots), self.stock_after(shelf), cleared=dict(cleared))


@dataclass(frozen=True, slots=True)
class PlannedStock:
    """Planned stock of a shelf after a motion.

    Attributes:
        places: slots and spots with known contents at the end.
        boxes: box of each occupied place.
        leaves_open: slots with open drawers at the end.
        cleared: number of boxes put down at each clearing spot.
    """

    places: tuple[str, ...] = ()
    boxes: Mapping[str, str] = field(default_factory=dict)
    leaves_open: tuple[str, ...] = ()
    cleared: Mapping[str, int] = field(default_factory=dict)


def _feeds(shelf: Shelf, place: str) -> bool:
    return place in shelf.spots and shelf.spots[place].feeds


def _clears(shelf: Shelf, place: str) -> bool:
    return place in shelf.spots and shelf.spots[place].clears


def job_carries(robot: Robot, job: str, options: Mapping[str, str] | None = None) -> tuple[Carry, ...]:
    """Return the boxes that a job carries, in order; empty for most jobs. Raises as `make_job` for its options."""
    return carries_of(job_intent(robot, job, options))


def carries_of(intent: Any) -> tuple[Carry, ...]:
    """Return the boxes carried by a job with this intent; empty for an intent of another kind."""
    return intent if isinstance(intent, tuple) and all(isinstance(each, Carry) for each in intent) else ()


def expected(robot: Robot, motion: Motion, options: ShelfOptions | None) -> PlannedStock | None:
    """Return the planned stock of a robot's shelf after a motion; None if nothing is planned."""
    shelf, errand = shelf_of(robot), options.errand if options else None
    planned = errand.planned(shelf) if errand and shelf else None
    if leaves_open := motion.expects.get("leaves_open"):
        return replace(planned or PlannedStock(), leaves_open=tuple(leaves_open))
    return planned
