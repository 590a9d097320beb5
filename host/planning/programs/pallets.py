"""Pallets: grids of tool positions in a frame; a program visits their cells in order."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product as combinations
from math import prod
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import digits_in
from steptwin.host.common.tables import Table
from steptwin.host.planning.programs.positions import Position, ToolPosition, read_position, read_target
from steptwin.host.robots.poses import DIRECTION, PLACE, Orientation
from steptwin.host.robots.poses.rotations import of_rotation_vector, product, turned

CELLS_MAX: Final = 5_000
"""Largest number of cells of a pallet, that of a program's steps."""
PROGRAM_CELLS_MAX: Final = 4 * CELLS_MAX
"""Largest number of cells of a program's pallets; its steps visit at most a quarter."""

Cells = Mapping[str, int]
"""Number of the present cell, from 0 on, of each pallet in use."""

_DIRECTIONS: Final = ("along", "across", "up")


@dataclass(frozen=True, slots=True, eq=False)
class WorkFrame:
    """A frame in the station, in which positions rotate and move along.

    Attributes:
        place: shape (3,), its origin in mm.
        rotation: shape (4,), its rotation as a unit quaternion x y z w.
        phi_deg: its rotation about the vertical; None if it tilts.
    """

    place: FloatArray
    rotation: FloatArray
    phi_deg: float | None

    @classmethod
    def read(cls, table: Table) -> "WorkFrame":
        """Return a frame from a table with x, y, z and phi or an orientation, all of them optional."""
        if not table.values:
            return STATION_FRAME
        position = read_position(table)
        if not isinstance(position, ToolPosition) or position.branch is not None:
            raise InputError("a frame has x, y, z in mm, and phi in degrees or an orientation such as rpy_deg")
        coordinates = dict(position.coordinates)
        place = np.array([coordinates.pop(name, 0.0) for name in PLACE])
        phi_deg = coordinates.pop("phi", 0.0)
        if coordinates:
            raise unknown("key", next(iter(coordinates)), (*PLACE, "phi", "rpy_deg"))
        if position.orientation is not None:
            return cls(place, position.orientation.rotation, None)
        return cls(place, of_rotation_vector(np.array([0.0, 0.0, phi_deg])), phi_deg)

    def turned(self, way_mm: FloatArray) -> FloatArray:
        """Convert vectors of shape (..., 3) from the frame's axes to the station's."""
        return turned(way_mm, self.rotation)

    def placed(self, position: ToolPosition) -> ToolPosition:
        """Convert a position from the frame to the station; raise InputError if it lacks the necessary coordinates."""
        own = dict(position.coordinates)
        needed = [name for name in PLACE if name not in own and (name != "z" or self.phi_deg is None)]
        if needed:
            raise InputError(f"{needed[0]}: is missing; a position in a frame says x and y, and z if the frame tilts")
        place = self.place + self.turned(np.array([own.get(name, 0.0) for name in PLACE]))
        own |= {name: value for name, value in zip(PLACE, place.tolist(), strict=True) if name in own}
        if "phi" in own:
            if self.phi_deg is None:
                raise InputError("phi: the frame tilts, so phi is no turn about the vertical: write an orientation")
            own["phi"] += self.phi_deg
        orientation = position.orientation
        if orientation is not None and orientation.key == DIRECTION:
            orientation = Orientation(DIRECTION, tuple(self.turned(orientation.direction).tolist()))
        elif orientation is not None:
            orientation = Orientation("quaternion_xyzw", tuple(product(self.rotation, orientation.rotation).tolist()))
        return ToolPosition(own, position.branch, orientation)


STATION_FRAME: Final = WorkFrame(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Pallet:
    """A grid of positions.

    Attributes:
        cells: position of each cell in the station, in the order of a program's visits.
        labels: number of each cell along, across and up, from 1 on, such as `2,1,1`.
        frame: frame of the pallet; offsets from its cells are along the frame's axes.
    """

    cells: tuple[ToolPosition, ...]
    labels: tuple[str, ...]
    frame: WorkFrame


def read_pallet(
    table: Table,
    frames: Mapping[str, WorkFrame | None],
    positions: Mapping[str, Position | None],
    cells_before: int = 0,
) -> Pallet:
    """Return a pallet from a table; raise InputError for errors, and for too many cells with those before."""
    table.check_keys(("frame", "first", *_DIRECTIONS, "fourth", "order", "zigzag"))
    frame = STATION_FRAME
    if "frame" in table:
        found = frames.get(table.text("frame", empty=False))
        if found is None:
            raise unknown("frame:", table.text("frame"), frames)
        frame = found
    first = _cell(table, "first", positions)
    if missing := [name for name in PLACE if name not in first.coordinates]:
        raise InputError(f"first: {missing[0]}: is missing: the first cell has x, y and z")
    steps, counts = zip(*(_direction(table, key, first, positions) for key in _DIRECTIONS), strict=True)
    if prod(counts) > CELLS_MAX:
        raise InputError(f"has {prod(counts)} cells; a pallet has at most {CELLS_MAX}")
    if (cells := prod(counts) + cells_before) > PROGRAM_CELLS_MAX:
        raise InputError(f"makes {cells} cells with the pallets before; a program has at most {PROGRAM_CELLS_MAX}")
    bend = _bend(table, first, steps, counts, positions)
    indices = list(_indices(table, counts))
    cells = []
    for along, across, up in indices:
        u, v = along / max(counts[0] - 1, 1), across / max(counts[1] - 1, 1)
        moved = _add(first.coordinates, steps[0], along)
        for step, number in ((steps[1], across), (steps[2], up), (bend, u * v)):
            moved = _add(moved, step, number)
        cells.append(frame.placed(ToolPosition(moved, first.branch, first.orientation)))
    return Pallet(tuple(cells), tuple(",".join(str(i + 1) for i in index) for index in indices), frame)


def _cell(table: Table, key: str, positions: Mapping[str, Position | None]) -> ToolPosition:
    """Return the tool's position under a key: its name, or a table."""
    target = read_target(table, key)
    if isinstance(target, str):
        if positions.get(target) is None:
            raise unknown(f"{key}: position", target, positions)
        target = positions[target] or target
    if not isinstance(target, ToolPosition):
        raise InputError(f"{key}: a cell is a position of the tool: x, y and z in mm, and phi or an orientation")
    return target


def _direction(
    table: Table, key: str, first: ToolPosition, positions: Mapping[str, Position | None]
) -> tuple[dict[str, float], int]:
    """Return the vector between cells in a direction, and the number of cells in it; 1 without the direction."""
    if key not in table:
        return {}, 1
    with table.section(key) as own:
        own.check_keys(("to", "pitch", "count"))
        count = own.integer("count")
        if count < 1:
            raise InputError(f"count: {count} is not at least 1")
        if ("to" in own) == ("pitch" in own):
            raise InputError("has exactly one of `to`, its last cell, and `pitch`, the way from a cell to the next")
        if "pitch" in own:
            with own.section("pitch") as pitch:
                return {name: pitch.number(name) for name in pitch}, count
        if count == 1:
            raise InputError("to: a direction with one cell has no last one; leave the direction out")
        way = _way(first, _cell(own, "to", positions))
        return {name: distance / (count - 1) for name, distance in way.items()}, count


def _way(start: ToolPosition, goal: ToolPosition) -> dict[str, float]:
    """Return the vector between two cells; missing coordinates of the second one stay."""
    if goal.orientation is not None or (strange := set(goal.coordinates) - set(start.coordinates)):
        name = goal.orientation.key if goal.orientation is not None else sorted(strange)[0]
        raise InputError(f"{name}: is not of the first cell, from which the others are shifted")
    return {name: value - start.coordinates[name] for name, value in goal.coordinates.items()}


def _bend(
    table: Table,
    first: ToolPosition,
    steps: tuple[dict[str, float], ...],
    counts: tuple[int, ...],
    positions: Mapping[str, Position | None],
) -> dict[str, float]:
    """Return the fourth corner's distance from the parallelogram of the others; cells between take a share."""
    if "fourth" not in table:
        return {}
    if min(counts[:2]) < 2:
        raise InputError("fourth: a pallet has a fourth corner if it has several cells along and across")
    corner = _add(_add(first.coordinates, steps[0], counts[0] - 1), steps[1], counts[1] - 1)
    return _way(ToolPosition(corner), _cell(table, "fourth", positions))


def _add(coordinates: Mapping[str, float], step: Mapping[str, float], number: float) -> dict[str, float]:
    if strange := set(step) - set(coordinates):
        raise InputError(f"{shortened(sorted(strange)[0])}: is not of the first cell")
    return {name: value + number * step.get(name, 0.0) for name, value in coordinates.items()}


def _indices(table: Table, counts: tuple[int, ...]) -> Iterator[tuple[int, int, int]]:
    """Yield the numbers of all cells in order: the first of `order` runs fastest, back and forth if requested."""
    order = [str(name) for name in table.elements("order")] if "order" in table else list(_DIRECTIONS)
    if sorted(order) != sorted(_DIRECTIONS):
        raise InputError(f"order: is not all of {', '.join(_DIRECTIONS)}, each once")
    zigzag = table.truth("zigzag") if "zigzag" in table else False
    fast, middle, slow = (_DIRECTIONS.index(name) for name in order)
    for k, j in combinations(range(counts[slow]), range(counts[middle])):
        back = zigzag and (k * counts[middle] + j) % 2 == 1
        for i in reversed(range(counts[fast])) if back else range(counts[fast]):
            index = [0, 0, 0]
            index[fast], index[middle], index[slow] = i, j, k
            yield index[0], index[1], index[2]


def cell_numbers(text: str, pallet: str, count: int) -> range:
    """Return the numbers, from 0 on, of `3..7` or `5` among a pallet's cells; raise InputError for other texts."""
    ends = [end.strip() for end in text.split("..")]
    with prefixed("cells: "):
        first, last = digits_in(ends[0]), digits_in(ends[-1])
        if len(ends) not in (1, 2) or first is None or last is None:
            raise InputError(f"{shortened(text)!r} is not such as 3..7, or 5")
        if not 1 <= first <= last <= count:
            raise InputError(f"{text}: the cells of {pallet} are 1..{count}")
    return range(first - 1, last)
