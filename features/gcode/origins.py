"""Where the origin of a file's coordinates is: coordinate systems, their common offset, and the tool's length."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from steptwin.host.common.errors import InputError

Spot = tuple[float, float, float, float]
"""A place in the file's coordinates: x, y and z in mm and the turn in degrees."""

_NOWHERE: Final = (0.0, 0.0, 0.0, 0.0)
_SYSTEMS: Final = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
"""Coordinate systems, by their numbers less one in `G10 L2 P`."""


@dataclass(slots=True)
class Origins:
    """The origins in the machine's coordinates, which are those of the step's frame.

    Attributes:
        total: sum of all offsets that hold.
    """

    total: Spot = _NOWHERE
    _system: str = _SYSTEMS[0]
    _systems: dict[str, Spot] = field(default_factory=dict)
    """Origins of coordinate systems; those of the others are the machine's."""
    _shift: Spot = _NOWHERE
    """Offset by G92 or G52."""
    _kept_shift: Spot = _NOWHERE
    """The same, which G92.3 brings back."""
    _length_mm: float = 0.0
    """Offset along z by the tool's length (G43.1)."""

    def select(self, system: str) -> None:
        """Select a coordinate system: G54 to G59.3."""
        self._system = system
        self._sum()

    def set_length(self, length_mm: float) -> None:
        """Set the tool's length: G43.1, G49."""
        self._length_mm = length_mm
        self._sum()

    def set_shift(self, code: str, given: Mapping[int, float], here: Spot) -> None:
        """Set the offset of some axes by G52, or by the coordinates that the present place is to have (G92)."""
        if code == "G92":
            without = zip(here, self._systems.get(self._system, _NOWHERE), self._along_z(), strict=True)
            zero = [place - system - length for place, system, length in without]
            given = {i: zero[i] - value for i, value in given.items()}
        self._shift = self._kept_shift = replaced(self._shift, given)
        self._sum()

    def end_shift(self, code: str) -> None:
        """Remove the offset (G92.1), suspend it (G92.2), or bring it back (G92.3)."""
        self._shift = self._kept_shift if code == "G92.3" else _NOWHERE
        if code == "G92.1":
            self._kept_shift = _NOWHERE
        self._sum()

    def end_shift_of(self, axes: Iterable[int]) -> None:
        """Remove the offset of some axes."""
        self._shift = replaced(self._shift, dict.fromkeys(axes, 0.0))
        self._sum()

    def set_system(self, numbers: Mapping[str, float], given: Mapping[int, float], here: Spot) -> None:
        """Set the origin of a coordinate system: G10 with L2, or L20, by the coordinates of the present place.

        Raises:
            InputError: L, P or R of the line is wrong.
        """
        kind, number = numbers.get("L"), numbers.get("P", 0.0)
        if kind not in (2.0, 20.0):
            raise InputError(f"G10: {f'L{kind:g} is' if kind is not None else 'without L, it is'} not L2 or L20")
        if numbers.get("R"):
            raise InputError(f"R{numbers['R']:g}: beside G10; coordinates are not turned")
        if number not in range(len(_SYSTEMS) + 1):
            raise InputError(f"P{number:g}: a coordinate system has a number from 0 to {len(_SYSTEMS)}")
        if kind == 20.0:
            without = zip(here, self._shift, self._along_z(), strict=True)
            zero = [place - shift - length for place, shift, length in without]
            given = {i: zero[i] - value for i, value in given.items()}
        system = _SYSTEMS[int(number) - 1] if number else self._system
        self._systems[system] = replaced(self._systems.get(system, _NOWHERE), given)
        self._sum()

    def _along_z(self) -> Spot:
        return 0.0, 0.0, self._length_mm, 0.0

    def _sum(self) -> None:
        offsets = (self._systems.get(self._system, _NOWHERE), self._shift, self._along_z())
        x, y, z, turn_deg = (sum(each) for each in zip(*offsets, strict=True))
        self.total = x, y, z, turn_deg


def replaced(spot: Spot, values: Mapping[int, float]) -> Spot:
    """Return a spot with some of its values replaced."""
    x, y, z, turn_deg = (values.get(i, value) for i, value in enumerate(spot))
    return x, y, z, turn_deg
