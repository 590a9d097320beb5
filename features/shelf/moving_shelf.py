"""An emulated shelf with drawers, spots for single boxes, and the hand there; everything that happens is an event.

A drawer slides along -y from shut to its end stop. Its catch holds it unless the hand's lock is in its striker; a
locked drawer stays shut even then. The magnet takes or releases a box in a drawer that the hand holds open, or at a
spot. Nothing else moves. Positions are the tool tip's in mm; instants are counts of the timer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import dist, hypot
from typing import Final, NamedTuple

Point = tuple[float, float, float]

END_MM: Final = 1.0
"""Distance from its end stop within which a drawer's sensor is on."""


class ShelfEventKind(StrEnum):
    """Kinds of events at a shelf."""

    LOCKED_ON = "hand locked onto the drawer"
    UNLOCKED = "hand unlocked from the drawer"
    TAKEN = "box taken"
    PUT = "box put down"
    LOCK_MISSED = "hand locked onto nothing"
    NOTHING_TAKEN = "magnet switched on where no box is"
    PULLED_LOCKED = "pull on a locked drawer"
    PULLED_TOO_FAR = "drawer pulled beyond its end stop"
    PUSHED_TOO_FAR = "drawer pushed beyond shut"
    FORCED_ASIDE = "drawer forced aside"
    DROPPED = "box dropped"
    FILLED_TWICE = "filled twice"

    @property
    def is_fault(self) -> bool:
        """True for an event that must not happen at a real shelf."""
        return self in _FAULTS


_FAULTS: Final = frozenset(
    {
        ShelfEventKind.PULLED_LOCKED,
        ShelfEventKind.PULLED_TOO_FAR,
        ShelfEventKind.PUSHED_TOO_FAR,
        ShelfEventKind.FORCED_ASIDE,
        ShelfEventKind.DROPPED,
        ShelfEventKind.FILLED_TWICE,
    }
)


class ShelfHappening(NamedTuple):
    """An event: instant, slot or spot, box, and tip; slot and box may be empty."""

    counts: int
    kind: ShelfEventKind
    where: str
    box: str
    tip_mm: Point


class SpotConfig(NamedTuple):
    """A spot: lid position of its box, and whether it feeds or clears boxes.

    The hand may take a box up to `grip_mm` below its lid. It must put the box down with the same grip.
    """

    lid_mm: Point
    feeds: bool = False
    clears: bool = False
    grip_mm: float = 0.0

    def depth_mm(self, tip_mm: Point) -> float:
        """Return the depth of the hand's grip on a box: from its lid down to a tip, at most `grip_mm`."""
        return min(max(self.lid_mm[2] - tip_mm[2], 0.0), self.grip_mm)


class Sensed(NamedTuple):
    """Levels of the shelf's sensors."""

    lock_engaged: bool = False
    box_present: bool = False
    drawer_end: bool = False


@dataclass(frozen=True, slots=True)
class ShelfConfig:
    """Construction of a shelf, and its contents at power-up.

    Attributes:
        strikers_mm: striker of each slot's shut drawer.
        spots: spots for single boxes.
        travel_mm: travel of a drawer to its end stop.
        opening_mm: least opening of a drawer for a box to pass.
        capture_mm: reach of lock and magnet from the tip, and play of a drawer that the hand holds.
        stock: box of each occupied slot and spot.
        locked: slots with locked drawers.
    """

    strikers_mm: Mapping[str, Point]
    spots: Mapping[str, SpotConfig]
    travel_mm: float
    opening_mm: float
    capture_mm: float
    stock: Mapping[str, str] = field(default_factory=dict)
    locked: frozenset[str] = frozenset()


class MovingShelf:
    """The shelf at run time. Call `look` at every change of an output, and often while the hand holds a drawer."""

    def __init__(self, config: ShelfConfig) -> None:
        self._config = config
        self.events: list[ShelfHappening] = []
        """Events in order of time that have not been dropped."""
        self.out_mm: dict[str, float] = dict.fromkeys(config.strikers_mm, 0.0)
        """Opening of each drawer."""
        self.stock: dict[str, str] = dict(config.stock)
        """Box of each occupied slot and spot."""
        self.carried: str = ""
        """Box at the magnet; empty without one."""
        self.held: str = ""
        """Slot of the drawer that the hand holds; empty without one."""
        self._grip_mm = (0.0, 0.0, 0.0)
        """Distance of the tip from the striker when the lock went in."""
        self._lock = self._magnet = False
        self._depth_mm = 0.0
        """Depth of the tip below the lid of the carried box."""
        self._fed = 0
        """Number of boxes that have arrived at feeding spots."""
        for name, spot in config.spots.items():
            if spot.feeds and name not in self.stock:
                self._feed(name)

    @property
    def sensed(self) -> Sensed:
        """Levels of the sensors."""
        at_end = bool(self.held) and self.out_mm[self.held] >= self._config.travel_mm - END_MM
        return Sensed(bool(self.held), bool(self.carried), at_end)

    def cells_out(self, out_mm: float) -> int:
        """Return the number of cells of a drawer that are wholly out; a cell is as long as the least opening."""
        return int((out_mm + END_MM) // self._config.opening_mm)

    def look(self, counts: int, tip_mm: Point, *, lock: bool, magnet: bool) -> None:
        """Move the tool's tip to a position, then set the outputs to their levels."""
        if self.held:
            self._follow(counts, tip_mm)
        if lock != self._lock:
            self._lock = lock
            (self._lock_on if lock else self._unlock)(counts, tip_mm)
        if magnet != self._magnet:
            self._magnet = magnet
            (self._take if magnet else self._release)(counts, tip_mm)

    # --- the drawer in the hand

    def _follow(self, counts: int, tip_mm: Point) -> None:
        """Move the drawer with the tip; if it cannot follow, the lock tears out of the striker."""
        slot, config = self.held, self._config
        dx_mm, dy_mm, dz_mm = (
            tip - striker - grip
            for tip, striker, grip in zip(tip_mm, config.strikers_mm[slot], self._grip_mm, strict=True)
        )
        out_mm, play_mm = -dy_mm, config.capture_mm
        torn = None
        if slot in config.locked and out_mm > play_mm:
            out_mm, torn = 0.0, ShelfEventKind.PULLED_LOCKED
        elif hypot(dx_mm, dz_mm) > play_mm:
            torn = ShelfEventKind.FORCED_ASIDE
        elif out_mm > config.travel_mm + play_mm:
            torn = ShelfEventKind.PULLED_TOO_FAR
        elif out_mm < -play_mm:
            torn = ShelfEventKind.PUSHED_TOO_FAR
        self.out_mm[slot] = 0.0 if slot in config.locked else min(max(out_mm, 0.0), config.travel_mm)
        if torn:
            self._note(counts, torn, slot, "", tip_mm)
            self.held = ""

    def _lock_on(self, counts: int, tip_mm: Point) -> None:
        for slot, (x_mm, y_mm, z_mm) in self._config.strikers_mm.items():
            striker_mm = x_mm, y_mm - self.out_mm[slot], z_mm
            if dist(tip_mm, striker_mm) <= self._config.capture_mm:
                dx_mm, dy_mm, dz_mm = (tip - at for tip, at in zip(tip_mm, striker_mm, strict=True))
                self.held, self._grip_mm = slot, (dx_mm, dy_mm, dz_mm)
                self._note(counts, ShelfEventKind.LOCKED_ON, slot, "", tip_mm)
                return
        self._note(counts, ShelfEventKind.LOCK_MISSED, "", "", tip_mm)

    def _unlock(self, counts: int, tip_mm: Point) -> None:
        if self.held:
            self._note(counts, ShelfEventKind.UNLOCKED, self.held, "", tip_mm)
            self.held = ""

    # --- the box at the magnet

    def _place_at(self, tip_mm: Point, depth_mm: float | None = None) -> str:
        """Return the slot or spot where the magnet can take or release a box now; empty if there is none.

        The hand holds a box at a depth below its lid; None: the hand is empty and may grip at any depth that the spot
        allows.
        """
        if self.held:
            return self.held if self.out_mm[self.held] >= self._config.opening_mm else ""
        for name, spot in self._config.spots.items():
            x_mm, y_mm, z_mm = tip_mm
            lid_mm = x_mm, y_mm, z_mm + (spot.depth_mm(tip_mm) if depth_mm is None else depth_mm)
            if dist(lid_mm, spot.lid_mm) <= self._config.capture_mm:
                return name
        return ""

    def _take(self, counts: int, tip_mm: Point) -> None:
        place = self._place_at(tip_mm)
        if place not in self.stock:
            self._note(counts, ShelfEventKind.NOTHING_TAKEN, place, "", tip_mm)
            return
        self.carried, spot = self.stock.pop(place), self._config.spots.get(place)
        self._depth_mm = 0.0 if spot is None else spot.depth_mm(tip_mm)
        self._note(counts, ShelfEventKind.TAKEN, place, self.carried, tip_mm)
        if spot is not None and spot.feeds:
            self._feed(place)

    def _release(self, counts: int, tip_mm: Point) -> None:
        if not self.carried:
            return
        box, self.carried = self.carried, ""
        place = self._place_at(tip_mm, self._depth_mm)
        if not place:
            self._note(counts, ShelfEventKind.DROPPED, self.held, box, tip_mm)
        elif place in self.stock:
            self._note(counts, ShelfEventKind.FILLED_TWICE, place, box, tip_mm)
        else:
            self._note(counts, ShelfEventKind.PUT, place, box, tip_mm)
            if place not in self._config.spots or not self._config.spots[place].clears:
                self.stock[place] = box

    def _feed(self, spot: str) -> None:
        self._fed += 1
        self.stock[spot] = f"{spot}-{self._fed}"

    def _note(self, counts: int, kind: ShelfEventKind, where: str, box: str, tip_mm: Point) -> None:
        self.events.append(ShelfHappening(counts, kind, where, box, tip_mm))
