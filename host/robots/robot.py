"""A robot as data: its joints, the board that drives them, its dimensions and named positions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.output import Output

AXES_MAX: Final = 8
"""Axes that a board drives: two 16-bit timers with four compare channels each."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A machine.

    Attributes:
        name: as on the command line.
        title: one line for people.
        kinematics: the kind of mechanism, a name known to `steptwin.host.robots.kinematics`.
        geometry: the mechanism's dimensions in mm and degrees, by name.
        joints: in the order of their axes on the board.
        home: joint positions, in joint order, that the machine takes after homing.
        board: settings that all axes share.
        outputs: what is wired to the board's digital outputs, by name.
        places: named joint positions that jobs go to; a place may name only some of the joints.
        toml: the file that the robot was read from, word for word; empty for one that was made otherwise.

    Raises:
        InputError: no joints, too many for a board, a position outside the joints' limits, a place of no joint, an
            output of no joint or two of the same number.
    """

    name: str
    title: str
    kinematics: str
    geometry: Mapping[str, float]
    joints: tuple[Joint, ...]
    home: tuple[float, ...]
    board: BoardSettings
    outputs: Mapping[str, Output] = field(default_factory=dict)
    places: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    toml: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= len(self.joints) <= AXES_MAX:
            raise InputError(f"joints: {len(self.joints)} of them, a board drives 1 to {AXES_MAX}")
        self._check_place("home", dict(zip(self.joint_names, self.home, strict=True)))
        for name, place in self.places.items():
            self._check_place(f"places.{name}", place)
        wired: dict[Output, str] = {}
        for name, output in self.outputs.items():
            if output.joint not in self.joint_names:
                raise unknown(f"outputs.{name}.joint:", output.joint, self.joint_names)
            if wired.setdefault(output, name) != name:
                raise InputError(f"outputs.{name}: output {output.out} of {output.joint} is {wired[output]} already")

    def _check_place(self, key: str, place: Mapping[str, float]) -> None:
        if not place:
            raise InputError(f"{key}: names no joint")
        for name, position in place.items():
            if name not in self.joint_names:
                raise unknown(f"{key}: joint", name, self.joint_names)
            joint = self.joint(name)
            if not joint.lower <= position <= joint.upper:
                limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
                raise InputError(f"{key}.{name}: {position:g} {joint.unit} is outside {limits}")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """In axis order."""
        return tuple(joint.name for joint in self.joints)

    def joint(self, name: str) -> Joint:
        """A joint by its name; KeyError if there is none."""
        return {joint.name: joint for joint in self.joints}[name]

    @property
    def steps_per_unit(self) -> FloatArray:
        """Shape (joints,): steps per mm or degree."""
        return np.array([joint.transmission.steps_per_unit for joint in self.joints])

    @property
    def wire_units_per_unit(self) -> FloatArray:
        """Shape (joints,): wire units per mm or degree."""
        return np.array([joint.transmission.wire_units_per_unit for joint in self.joints])

    def to_units(self, positions: FloatArray) -> FloatArray:
        """Return positions of shape (n, joints) in wire units: whole numbers, half a unit rounded up.

        They stay floats, which have no bound, so that the caller can check them before they become integers.
        """
        return np.asarray(np.floor(positions * self.wire_units_per_unit + 0.5))
