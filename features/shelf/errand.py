"""The plan of a motion for the boxes of a shelf: which it carries from where to where."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.options import ShelfOptions
from steptwin.features.shelf.section import Shelf
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_intent
from steptwin.host.planning.trajectory import Trajectory, expected_of
from steptwin.host.robots.robot import Robot

A_BOX: Final = "box"
"""Name of a box to which the user gave none."""


class Carry(NamedTuple):
    """A box is carried from a slot or a spot to another."""

    source: str
    target: str


@dataclass(frozen=True, slots=True)
class Errand:
    """Boxes of a shelf, and what is done with them.

    Attributes:
        stock: the box in each slot and at each spot that has one before the motion.
        carries: what is carried, in order.
    """

    stock: Mapping[str, str]
    carries: tuple[Carry, ...]

    @classmethod
    def alone(cls, carries: tuple[Carry, ...], box: str = A_BOX) -> "Errand":
        """Return the errand in a shelf with a box at each place that it takes from before it fills it, and no other."""
        stock, filled = dict[str, str](), set[str]()
        for source, target in carries:
            if source not in filled:
                stock.setdefault(source, box if not stock else f"{box}-{len(stock) + 1}")
            filled |= {source, target}
        return cls(stock, carries)

    def stock_after(self, shelf: Shelf) -> dict[str, str]:
        """Return the box in each slot and at each spot after the motion.

        Raises:
            InputError: a box is to be taken where none is, or put where one is already.
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
        """Return what the motion leaves in all slots, and at the spots that neither feed boxes nor clear them away."""
        spots = (name for name in shelf.spots if not (_feeds(shelf, name) or _clears(shelf, name)))
        cleared = Counter(target for _, target in self.carries if _clears(shelf, target))
        return PlannedStock((*shelf.slots, *spots), self.stock_after(shelf), cleared=dict(cleared))


@dataclass(frozen=True, slots=True)
class PlannedStock:
    """What a motion is planned to leave at a shelf.

    Attributes:
        places: slots and spots whose contents at the end the plan knows.
        boxes: the box at each of these that has one.
        leaves_open: slots whose drawers are out at the end.
        cleared: how many boxes are put down at each spot that carries them away.
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
    """Return the boxes that a job carries, in order; none for most jobs. Raises as `make_job` does for its options."""
    return carries_of(job_intent(robot, job, options))


def carries_of(intent: Any) -> tuple[Carry, ...]:
    """Return the boxes that a job with this intent carries; none for an intent of another kind."""
    return intent if isinstance(intent, tuple) and all(isinstance(each, Carry) for each in intent) else ()


def expected(robot: Robot, trajectory: Trajectory, options: ShelfOptions | None) -> PlannedStock | None:
    """Return what a motion is planned to leave at a robot's shelf; None if nothing is planned."""
    shelf, errand = shelf_of(robot), options.errand if options else None
    planned = errand.planned(shelf) if errand and shelf else None
    if leaves_open := expected_of(trajectory).get("leaves_open"):
        return replace(planned or PlannedStock(), leaves_open=tuple(leaves_open))
    return planned
