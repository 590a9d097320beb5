"""Pallets: grids of tool positions in a frame; a program visits their cells in order."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product as combinations
from math import prod
from typing import Annotated, Any, Final, Literal

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable
from steptwin.host.common.file_values import ReadBy, Within
from steptwin.host.common.findings import judged
from steptwin.host.common.numbers import digits_in
from steptwin.host.common.tables import Table
from steptwin.host.planning.programs.positions import (
    Position,
    ToolPosition,
    position_schema,
    read_position,
    read_target,
)
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
    def read(cls, value: object, _: object = None) -> "WorkFrame":
        """Return a frame from a table with x, y, z and phi or an orientation, all of which may be left out."""
        if value == {}:
            return STATION_FRAME
        position = read_position(Table(value, "table"))
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

_NAME_SCHEMA: Final = {"type": "string", "description": "name of a frame"}
AnyFrame = Annotated[WorkFrame, ReadBy(lambda name, reading: reading.named("frames", name), lambda: _NAME_SCHEMA)]
"""A frame of which a file has the name."""


def _read_placed(value: object, reading: FileReading) -> Position:
    """Return a named position, which may be in a frame, as one in the station."""
    table = Table(value, "table")
    if "frame" not in table:
        return read_position(table)
    with prefixed("frame: "):
        frame: WorkFrame = reading.named("frames", table.values["frame"])
    position = read_position(Table({key: table.values[key] for key in table if key != "frame"}, "table"))
    if not isinstance(position, ToolPosition):
        raise InputError("frame: beside joints; a position in a frame is the tool's")
    return frame.placed(position)


PlacedPosition = Annotated[Position, ReadBy(_read_placed, lambda: position_schema(frame=_NAME_SCHEMA))]
"""A position in the station, which a file may have in a frame."""


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


def _read_cell(value: object, reading: FileReading) -> ToolPosition:
    """Return the tool's position from its name, or from a table."""
    target = read_target(value, reading)
    if isinstance(target, str):
        saved = reading.read.get("positions_file")
        own = saved.positions.get(target) if saved else None
        target = own or reading.named("positions", target, "position")
    if not isinstance(target, ToolPosition):
        raise InputError("a cell is a position of the tool: x, y and z in mm, and phi or an orientation")
    return target


_Cell = Annotated[ToolPosition, ReadBy(_read_cell, lambda: {"oneOf": [{"type": "string"}, position_schema()]})]


@dataclass(frozen=True, slots=True)
class PalletDirection(FileTable):
    """The cells of a pallet in a direction: exactly one of `to` and `pitch` says how far they are apart.

    Attributes:
        count: number of cells.
        to: the last cell.
        pitch: distances from a cell to the next one in mm and degrees, by coordinate.
    """

    count: Annotated[int, Within(1)]
    to: _Cell | None = None
    pitch: Mapping[str, float] | None = None

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the direction; raise InputError if it has not exactly one of `to` and `pitch`."""
        if ("to" in reading.table) == ("pitch" in reading.table):
            raise InputError("has exactly one of `to`, its last cell, and `pitch`, the way from a cell to the next")
        return judged(cls, values, reading.findings)

    def step(self, first: ToolPosition) -> Mapping[str, float]:
        """Return the distances from a cell to the next one."""
        if self.to is None:
            _way(first, ToolPosition(self.pitch or {}))
            return self.pitch or {}
        if self.count == 1:
            raise InputError("to: a direction with one cell has no last one; leave the direction out")
        return {name: distance / (self.count - 1) for name, distance in _way(first, self.to).items()}


_ONE_CELL: Final = PalletDirection(1)


@dataclass(frozen=True, slots=True)
class PalletTable(FileTable):
    """A grid of positions of the tool.

    Attributes:
        first: the first cell.
        frame: name of the frame in which the cells are.
        along: the cells in the first direction.
        across: the cells in the second direction.
        up: the cells in the third direction.
        fourth: the corner across from the first one, where the grid is no parallelogram; cells between take a part.
        order: the directions in the order in which the cells are visited, the one that runs fastest first.
        zigzag: true if they are visited back and forth.
    """

    first: _Cell
    frame: AnyFrame = STATION_FRAME
    along: PalletDirection = _ONE_CELL
    across: PalletDirection = _ONE_CELL
    up: PalletDirection = _ONE_CELL
    fourth: _Cell | None = None
    order: tuple[Literal["along", "across", "up"], ...] = ("along", "across", "up")
    zigzag: bool = False

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Pallet:
        """Return the pallet; raise InputError for what is wrong, and for too many cells with those before."""
        table: PalletTable = judged(cls, values, reading.findings)
        if missing := [name for name in PLACE if name not in table.first.coordinates]:
            raise InputError(f"first: {missing[0]}: is missing: the first cell has x, y and z")
        if sorted(table.order) != sorted(_DIRECTIONS):
            raise InputError(f"order: is not all of {', '.join(_DIRECTIONS)}, each once")
        counts = [direction.count for direction in table.directions]
        if prod(counts) > CELLS_MAX:
            raise InputError(f"has {prod(counts)} cells; a pallet has at most {CELLS_MAX}")
        reading.known.cells += prod(counts)
        if reading.known.cells > PROGRAM_CELLS_MAX:
            before = f"{reading.known.cells} cells with the pallets before"
            raise InputError(f"makes {before}; a program has at most {PROGRAM_CELLS_MAX}")
        indices = list(table.indices(counts))
        cells = tuple(map(table.frame.placed, table.cells(indices, counts)))
        return Pallet(cells, tuple(",".join(str(i + 1) for i in index) for index in indices), table.frame)

    @property
    def directions(self) -> tuple[PalletDirection, ...]:
        """The directions along, across and up."""
        return self.along, self.across, self.up

    def cells(self, indices: Iterable[tuple[int, ...]], counts: Sequence[int]) -> Iterator[ToolPosition]:
        """Yield the cells with these numbers, in the pallet's frame."""
        steps, bend = list[Mapping[str, float]](), dict[str, float]()
        for name, direction in zip(_DIRECTIONS, self.directions, strict=True):
            with prefixed(f"{name}: "):
                steps.append(direction.step(self.first))
        if self.fourth is not None:
            if min(counts[:2]) < 2:
                raise InputError("fourth: a pallet has a fourth corner if it has several cells along and across")
            corner = _add(_add(self.first.coordinates, steps[0], counts[0] - 1), steps[1], counts[1] - 1)
            with prefixed("fourth: "):
                bend = _way(ToolPosition(corner), self.fourth)
        for along, across, up in indices:
            u, v = along / max(counts[0] - 1, 1), across / max(counts[1] - 1, 1)
            moved = self.first.coordinates
            for step, number in ((steps[0], along), (steps[1], across), (steps[2], up), (bend, u * v)):
                moved = _add(moved, step, number)
            yield ToolPosition(moved, self.first.branch, self.first.orientation)

    def indices(self, counts: Sequence[int]) -> Iterator[tuple[int, ...]]:
        """Yield the numbers of all cells in their order."""
        fast, middle, slow = map(_DIRECTIONS.index, self.order)
        for k, j in combinations(range(counts[slow]), range(counts[middle])):
            back = self.zigzag and (k * counts[middle] + j) % 2 == 1
            for i in reversed(range(counts[fast])) if back else range(counts[fast]):
                index = {fast: i, middle: j, slow: k}
                yield index[0], index[1], index[2]


def _way(start: ToolPosition, goal: ToolPosition) -> dict[str, float]:
    """Return the distances between two cells; coordinates that the second one leaves out stay."""
    if goal.orientation is not None or (strange := set(goal.coordinates) - set(start.coordinates)):
        name = goal.orientation.key if goal.orientation is not None else sorted(strange)[0]
        raise InputError(f"{shortened(name)}: is not of the first cell, from which the others are shifted")
    return {name: value - start.coordinates[name] for name, value in goal.coordinates.items()}


def _add(coordinates: Mapping[str, float], step: Mapping[str, float], number: float) -> dict[str, float]:
    return {name: value + number * step.get(name, 0.0) for name, value in coordinates.items()}


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
